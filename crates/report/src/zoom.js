
"use strict";
// Deepest enlargement, and how many ticks an axis has at most.
const DEEPEST = 32, TICKS = 7;
const SUPERSCRIPT = -4.5;
// The least of 1, 2 and 5 times a power of ten that is not below `least`, or the largest not above.
const step = (least, up) => {
  const decade = 10 ** Math.floor(Math.log10(least));
  const steps = [1, 2, 5, 10].map(digit => digit * decade);
  return up ? steps.find(s => s >= least * (1 - 1e-9)) : steps.reverse().find(s => least * (1 + 1e-9) >= s);
};
const decimals = unit => Math.max(0, Math.ceil(-Math.log10(unit) - 1e-9));
// A number told from its neighbours `unit` away, and the power of ten it has to be raised to.
const shown = (value, unit, plain) => {
  if (value === 0) return ["0", null];
  const minus = 0 > value ? "−" : "", size = Math.abs(value);
  if (plain) return [minus + size.toFixed(decimals(unit)), null];
  const power = Math.floor(Math.log10(size) + 1e-9);
  const digits = (size / 10 ** power).toFixed(decimals(unit / 10 ** power));
  return [minus + (Number(digits) === 1 ? "10" : digits + "×10"), power];
};
// Where ticks stand between the shares `from` and `to` of an axis, and what they say.
const ticks = (axis, from, to) => {
  const [kind, ...ends] = axis.split(" "), [low, high] = ends.map(Number);
  const at = share => low + share * (high - low), place = number => (number - low) / (high - low);
  const [first, last] = [at(from), at(to)], found = [];
  if (!(last > first)) return found;
  const even = (first, last, place) => {
    const unit = step((last - first) / TICKS, true);
    const plain = 1e4 > Math.max(Math.abs(first), Math.abs(last)) ? unit >= 1e-4 : false;
    const whole = Math.ceil(first / unit - 1e-9);
    for (let k = whole; last / unit + 1e-9 >= k; k++) {
      found.push([place(k * unit), ...shown(k * unit, unit, plain)]);
    }
  };
  if (kind === "linear") {
    even(first, last, place);
  } else if (0.7 > last - first) {
    even(10 ** first, 10 ** last, value => place(Math.log10(value)));
  } else {
    const every = Math.ceil((last - first) / TICKS), plain = first >= -3.05 ? 4.05 >= last : false;
    for (let power = Math.floor(first); last >= power; power++) {
      for (const digit of 2 > last - first ? [1, 2, 5] : [1]) {
        const number = power + Math.log10(digit);
        if (number >= first) if (last >= number) if (power % every === 0) {
          found.push([place(number), ...shown(digit * 10 ** power, 10 ** power, plain)]);
        }
      }
    }
  }
  return found;
};
const make = (parent, name, attributes, text = "") => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.textContent = text;
  parent.append(node);
  return node;
};
const label = (parent, attributes, [text, power]) => {
  const node = make(parent, "text", attributes, text);
  if (power !== null) {
    make(node, "tspan", { class: "small", dy: SUPERSCRIPT }, String(power).replace("-", "−"));
  }
};
for (const svg of document.querySelectorAll("figure svg.figure")) {
  const figure = svg.closest("figure"), [, , width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
  // A part of a figure that is enlarged inside its frame: what is in it, its axes or its bar of a
  // length, and which share of it is shown.
  const panels = [...svg.querySelectorAll(".axes")].map(axes => {
    const [x, y, wide, high] = axes.dataset.panel.split(" ").map(Number);
    const inside = [...svg.querySelectorAll(".scaled")].filter(part => Number(part.getAttribute("y")) === y);
    const homes = inside.map(part => part.getAttribute("viewBox").split(" ").map(Number));
    const marks = inside.flatMap(part => [...part.querySelectorAll("circle, .arrows path")]).map(mark => {
      const at = mark.tagName === "circle" ? [mark.getAttribute("cx"), mark.getAttribute("cy")]
        : mark.getAttribute("d").match(/[\d.]+/g).slice(0, 2);
      return [mark, at.join(" "), at.map(v => -v).join(" ")];
    });
    return { axes, data: axes.dataset, x, y, wide, high, inside, homes, marks, drawn: [...axes.childNodes], from: 0, to: 1 };
  });
  // All panels share what is shown from left to right.
  let left = 0, right = 1, held = null;
  const scale = (panel, whole) => {
    const { axes, data, x, y, wide, high } = panel;
    if (whole) return axes.replaceChildren(...panel.drawn);
    axes.replaceChildren();
    if (data.mm) {
      const per_mm = data.mm / (right - left), length = step(0.3 * wide / per_mm, false);
      for (const kind of ["rim", "outline"]) make(axes, "path", { class: kind, d: `M12 ${high - 12}h${length * per_mm}` });
      make(axes, "text", { class: "over", x: 12, y: high - 19 }, shown(length, length, length >= 1e-3)[0] + " mm");
      return;
    }
    const grid = make(axes, "path", { class: "grid" }), frame = make(axes, "path", { class: "frame" });
    let lines = "", notches = `M${x} ${y}h${wide}v${high}h${-wide}Z`;
    for (const [share, ...says] of ticks(data.x, left, right)) {
      const at = x + (share - left) / (right - left) * wide;
      lines += `M${at} ${y}v${high}`;
      notches += `M${at} ${y}v6M${at} ${y + high}v-6`;
      if ("below" in data) label(axes, { class: "middle", x: at, y: y + high + 18 }, says);
    }
    for (const [share, ...says] of ticks(data.y, panel.from, panel.to)) {
      const at = y + high - (share - panel.from) / (panel.to - panel.from) * high;
      lines += `M${x} ${at}h${wide}`;
      notches += `M${x} ${at}h6M${x + wide} ${at}h-6`;
      label(axes, { class: "end", x: x - 8, y: at + 4.5 }, says);
    }
    grid.setAttribute("d", lines);
    frame.setAttribute("d", notches);
  };
  const show = () => {
    const near = 1 > right - left;
    svg.classList.toggle("near", near);
    for (const panel of panels) {
      const [across, up] = [right - left, panel.to - panel.from];
      panel.inside.forEach((part, k) => {
        const [x, y, wide, high] = panel.homes[k];
        part.setAttribute("viewBox", [x + left * wide, y + (1 - panel.to) * high, across * wide, up * high].join(" "));
      });
      // Marks move and keep their size.
      for (const [mark, to, back] of panel.marks) {
        if (near) mark.setAttribute("transform", `translate(${to}) scale(${across} ${up}) translate(${back})`);
        else mark.removeAttribute("transform");
      }
      scale(panel, !near);
    }
  };
  // The part of 0 to 1 that is `factor` times as narrow as from `low` to `high`, with `fixed` where it was.
  const narrowed = (low, high, factor, fixed) => {
    const size = Math.min(1, Math.max(1 / DEEPEST, (high - low) / factor));
    return moved(fixed - (fixed - low) * size / (high - low), size);
  };
  const moved = (low, size) => {
    low = Math.max(0, Math.min(1 - size, low));
    return [low, low + size];
  };
  const zoom = (factor, at) => {
    [left, right] = narrowed(left, right, factor, at ? at.across : (left + right) / 2);
    for (const panel of panels) {
      if (at ? at.panel === panel : true) {
        [panel.from, panel.to] = narrowed(panel.from, panel.to, factor, at ? at.up : (panel.from + panel.to) / 2);
      }
      if (right - left === 1) [panel.from, panel.to] = [0, 1];
    }
    show();
  };
  // Where in the figure the pointer is.
  const pointed = event => {
    const seen = svg.getBoundingClientRect();
    return [(event.clientX - seen.left) / seen.width * width, (event.clientY - seen.top) / seen.height * height];
  };
  // The panel under the pointer, and where in it the pointer is.
  const under = event => {
    const [x, y] = pointed(event);
    const panel = panels.find(p => x >= p.x ? p.x + p.wide >= x ? y >= p.y ? p.y + p.high >= y : false : false : false);
    return panel ? place(panel, [x, y]) : null;
  };
  const place = (panel, [x, y]) => ({
    panel,
    across: left + (x - panel.x) / panel.wide * (right - left),
    up: panel.to - (y - panel.y) / panel.high * (panel.to - panel.from)
  });
  const whole = () => {
    [left, right] = [0, 1];
    for (const panel of panels) [panel.from, panel.to] = [0, 1];
    show();
  };
  const bar = document.createElement("div");
  bar.className = "zoom";
  for (const [sign, says, act] of [
    ["+", "nearer", () => zoom(1.6)],
    ["−", "farther", () => zoom(1 / 1.6)],
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
  svg.addEventListener("dblclick", event => {
    const at = under(event);
    if (at) zoom(2, at);
  });
  svg.addEventListener("wheel", event => {
    const at = event.ctrlKey ? under(event) : null;
    if (at) {
      event.preventDefault();
      zoom(Math.exp(-event.deltaY / 300), at);
    }
  }, { passive: false });
  svg.addEventListener("pointerdown", event => {
    if (1 > right - left) {
      held = under(event);
      if (held) svg.setPointerCapture(event.pointerId);
    }
  });
  svg.addEventListener("pointermove", event => {
    if (held) {
      const { panel } = held, now = place(panel, pointed(event));
      [left, right] = moved(left + held.across - now.across, right - left);
      [panel.from, panel.to] = moved(panel.from + held.up - now.up, panel.to - panel.from);
      show();
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    svg.addEventListener(end, () => { held = null; });
  }
  window.addEventListener("beforeprint", whole);
}
