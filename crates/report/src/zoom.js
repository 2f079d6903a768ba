
"use strict";
for (const svg of document.querySelectorAll("figure svg.figure")) {
  const figure = svg.closest("figure"), box = svg.viewBox.baseVal;
  const home = [box.x, box.y, box.width, box.height];
  let view = home.slice(), held = null;
  const show = () => {
    for (const k of [0, 1]) {
      view[k] = Math.min(home[k] + home[k + 2] - view[k + 2], Math.max(home[k], view[k]));
    }
    svg.setAttribute("viewBox", view.map(v => v.toFixed(2)).join(" "));
    svg.classList.toggle("near", home[2] > view[2]);
  };
  const zoom = (factor, x, y) => {
    const width = Math.min(home[2], Math.max(home[2] / 32, view[2] / factor)), by = width / view[2];
    view = [x - (x - view[0]) * by, y - (y - view[1]) * by, width, view[3] * by];
    show();
  };
  const at = event => {
    const seen = svg.getBoundingClientRect();
    return [
      view[0] + (event.clientX - seen.left) / seen.width * view[2],
      view[1] + (event.clientY - seen.top) / seen.height * view[3]
    ];
  };
  const middle = () => [view[0] + view[2] / 2, view[1] + view[3] / 2];
  const whole = () => { view = home.slice(); show(); };
  const bar = document.createElement("div");
  bar.className = "zoom";
  for (const [sign, says, act] of [
    ["+", "nearer", () => zoom(1.6, ...middle())],
    ["−", "farther", () => zoom(1 / 1.6, ...middle())],
    ["1:1", "the whole figure", whole]
  ]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = sign;
    button.title = says;
    button.addEventListener("click", act);
    bar.append(button);
  }
  bar.append(" double click: nearer; drag: move; Ctrl and wheel: zoom");
  figure.querySelector(".enlarge").replaceWith(bar);
  svg.addEventListener("dblclick", event => zoom(2, ...at(event)));
  svg.addEventListener("wheel", event => {
    if (event.ctrlKey) {
      event.preventDefault();
      zoom(Math.exp(-event.deltaY / 300), ...at(event));
    }
  }, { passive: false });
  svg.addEventListener("pointerdown", event => {
    if (home[2] > view[2]) {
      held = at(event);
      svg.setPointerCapture(event.pointerId);
    }
  });
  svg.addEventListener("pointermove", event => {
    if (held) {
      const [x, y] = at(event);
      view[0] += held[0] - x;
      view[1] += held[1] - y;
      show();
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    svg.addEventListener(end, () => { held = null; });
  }
  window.addEventListener("beforeprint", whole);
}
