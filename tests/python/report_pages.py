"""Opens the report of three materials in headless Chromium, and counts what a reader would see and what a console would say.

    python tests/python/report_pages.py BEAMSPOT FOLDER

Synthesizes captures of marble, skim milk and Spectralon, measures them into FOLDER, and opens each report.html wide and
narrow, light and dark, without its script (and with every box for enlarging ticked), as a press of every button makes
it, and printed. A picture of each
view is left in FOLDER, to be looked at (of the printed page only where `pip install pypdfium2` was called). Fails where
the console says anything, a figure is missing, a page has 2 MB or asks for anything from outside.

No part of CI, which has no Chromium. `CHROMIUM` names another binary.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MATERIALS = ("marble", "skimmilk", "spectralon")
CHROMIUM = os.environ.get("CHROMIUM", "chromium")
FLAGS = (
    "--headless --no-sandbox --disable-gpu --hide-scrollbars --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --enable-logging=stderr --virtual-time-budget=3000"
).split()
DARK = "--blink-settings=preferredColorScheme=0"
LIGHT = "--blink-settings=preferredColorScheme=1"
# name: width, height, option
VIEWS = {
    "wide": (1280, 7200, LIGHT),
    "dark": (1280, 7200, DARK),
    "narrow": (400, 9000, LIGHT),
}
MOST_BYTES = 2_000_000
# Presses every button of every figure, and drags and double clicks; then says how far it came.
DRIVER = """<script>
for (const button of document.querySelectorAll(".zoom button")) {
  if (button.textContent !== "1:1") { button.click(); button.click(); button.click(); }
  if (button.textContent === "+") {
    const svg = button.closest("figure").querySelector("svg.figure"), box = svg.getBoundingClientRect();
    const seen = () => svg.querySelector(".scaled").getAttribute("viewBox");
    const before = seen(), axes = [...svg.querySelectorAll(".axes")];
    const at = { clientX: box.left + 0.7 * box.width, clientY: box.top + 0.3 * box.height, bubbles: true };
    svg.dispatchEvent(new MouseEvent("dblclick", at));
    svg.dispatchEvent(new WheelEvent("wheel", { ...at, ctrlKey: true, deltaY: -90, cancelable: true }));
    const labels = axes.map(part => part.querySelectorAll("text").length);
    console.log("VIEW " + before + " / " + seen() + " / " + labels.join(" "));
  }
}
</script>"""


def chromium(*arguments):
    """What it said on its console."""
    with tempfile.TemporaryDirectory() as profile:
        call = [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", *map(str, arguments)]
        done = subprocess.run(call, capture_output=True, text=True, timeout=180, check=True)
    return [line for line in done.stderr.splitlines() if "CONSOLE" in line], done.stdout


def capture(beamspot, folder, material):
    result = folder / material
    if not (result / "report.html").exists():
        made = folder / f"capture_{material}"
        if not (made / "capture.toml").exists():
            synth = [beamspot, "synth", "--material", material, "--model", "monte-carlo", "--g", "0.8", "--seed", "7"]
            subprocess.run([*synth, "-o", made], check=True, capture_output=True)
        start = time.perf_counter()
        subprocess.run([beamspot, "measure", made / "capture.toml", "-o", result], check=True, capture_output=True)
        print(f"{material}: measured in {time.perf_counter() - start:.1f} s")
    return result / "report.html"


def check(folder, material, page):
    faults = []
    text = page.read_text(encoding="utf-8")
    figures = len(re.findall(r'<svg [^>]*class="figure"', text))
    pictures = text.count("data:image/png;base64,")
    said = []
    # Headless Chromium takes no screenshot where scripts are turned off: they are taken out instead.
    plain = re.sub("<script>.*</script>", "", text, flags=re.DOTALL)
    ticked = plain.replace('type="checkbox"', 'type="checkbox" checked=""')
    views = {view: (page, *options) for view, options in VIEWS.items()}
    for view, text_of_view in (("no_script", plain), ("no_script_enlarged", ticked)):
        copy = folder / f"{material}_{view}.html"
        copy.write_text(text_of_view, encoding="utf-8")
        views[view] = (copy, 1280, 7200, LIGHT)
    for view, (file, width, height, option) in views.items():
        shot = folder / f"{material}_{view}.png"
        console, _ = chromium(option, f"--window-size={width},{height}", f"--screenshot={shot}", file.as_uri())
        said += [f"{view}: {line}" for line in console]
        if not shot.exists():
            faults.append(f"no picture of the view {view}")
    printed = folder / f"{material}.pdf"
    console, _ = chromium(LIGHT, f"--print-to-pdf={printed}", "--no-pdf-header-footer", page.as_uri())
    said += [f"printed: {line}" for line in console]
    try:
        import pypdfium2
    except ImportError:
        pages = "not looked at"
    else:
        document = pypdfium2.PdfDocument(printed)
        pages = len(document)
        for number in range(pages):
            document[number].render(scale=1.2).to_pil().save(folder / f"{material}_printed_{number + 1}.png")
    # The page as it is after its script, and as its buttons make it.
    _, dom = chromium(LIGHT, "--dump-dom", page.as_uri())
    bars = dom.count('<div class="zoom">')
    driven = folder / f"{material}_driven.html"
    driven.write_text(re.sub("<meta http-equiv[^>]*>", "", text).replace("</body>", DRIVER + "</body>"))
    console, _ = chromium(
        LIGHT, "--window-size=1280,7200", f"--screenshot={folder / f'{material}_zoomed.png'}", driven.as_uri()
    )
    moved = [line for line in console if "VIEW" in line]
    said += [f"driven: {line}" for line in console if "VIEW" not in line]
    for line in moved:
        numbers = [float(number) for number in re.findall(r"[\d.]+", line.split("VIEW")[1].split('"')[0])]
        # The bar of a picture has one label; above and below a profile's axes have two or more each.
        labels = numbers[8:]
        if not numbers[6] < 0.5 * numbers[2] < 350 or labels != [1] and not (labels[0] >= 2 and labels[1] >= 4):
            faults.append(f"zoom: {line}")
    if said:
        faults.append(f"{len(said)} messages on the console: {said[0]}")
    if figures < 6 or pictures < 4:
        faults.append(f"{figures} figures and {pictures} pictures: expected a profile and a picture a channel, and a swatch")
    if bars != figures or len(moved) != figures:
        faults.append(f"{bars} figures can be enlarged and {len(moved)} were, of {figures}")
    if page.stat().st_size >= MOST_BYTES:
        faults.append(f"{page.stat().st_size} bytes, at most {MOST_BYTES} were asked")
    outside = re.findall(r'(?:href|src)="(?!data:image/png;base64,)[^"]*"|@import|url\(', text)
    faults += [f"refers to {found}" for found in outside]
    print(
        f"{material}: {page.stat().st_size} bytes, {figures} figures, {pictures} pictures, {len(said)} console messages in "
        f"{len(views) + 2} views, {len(moved)} figures enlarged, {pages} printed pages"
    )
    return [f"{material}: {fault}" for fault in faults]


def main(beamspot, folder):
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    faults = []
    for material in MATERIALS:
        faults += check(folder, material, capture(beamspot, folder, material))
    print("\n".join(faults) or "nothing to complain of")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
