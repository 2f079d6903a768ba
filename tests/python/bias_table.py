"""What each model makes of captures whose light obeys transport: all 36 channels of Jensen's table.

`python bias_table.py BEAMSPOT FOLDER` writes captures and results into FOLDER (about 1 GB at a
time) and prints the table of docs/bias.md. Takes a few minutes; no test runs it.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

MATERIALS = (
    "Apple Chicken1 Chicken2 Cream Ketchup Marble Potato Skimmilk Skin1 Skin2 Spectralon Wholemilk"
).split()
CHOICES = {
    "exact": ["--model", "dipole", "--constraint", "exact"],
    "joint": ["--model", "dipole"],
    "transport": ["--model", "monte-carlo"],
}
NAMES = ("sigma_a_per_mm", "sigma_s_prime_per_mm")


def fitted(beamspot, folder, arguments):
    """The channels of one measurement."""
    call = [beamspot, "measure", folder / "capture/capture.toml", "-o", folder / "result"]
    call += [*arguments, "--no-confirm", "--force", "--json"]
    done = subprocess.run([str(c) for c in call], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)["channels"]


def cell(channel, truth, in_u):
    """Both coefficients' errors, relative and where asked for in u."""
    parts = []
    for name in NAMES:
        value, u, true = channel[name]["value"], channel[name]["u"], truth[name]
        if true == 0:
            limit = channel["upper_limit"]
            parts.append(f"< {limit:.1e}" if limit else f"{value:.1e}")
        elif in_u:
            parts.append(f"{100 * (value / true - 1):+.2f} % ({(value - true) / u:+.1f})")
        else:
            parts.append(f"{100 * (value / true - 1):+.0f} %")
    return ", ".join(parts)


def main(beamspot, folder):
    """Prints the table."""
    folder = Path(folder)
    print("| channel | dipole, exact: σa, σs′ | dipole, joint: σa, σs′ | monte-carlo: σa, σs′ (in u) |")
    print("|---|---|---|---|")
    for material in MATERIALS:
        synth = ["synth", "--material", material, "--model", "monte-carlo", "--g", "0.8"]
        call = [beamspot, *synth, "--seed", "11", "-o", str(folder / "capture"), "--force"]
        subprocess.run(call, check=True, capture_output=True)
        truth = json.loads((folder / "capture/truth.json").read_text())["channels"]
        fits = {name: fitted(beamspot, folder, how) for name, how in CHOICES.items()}
        for i, true in enumerate(truth):
            cells = [cell(fits[name][i], true, name == "transport") for name in CHOICES]
            print(f"| {material} {true['channel']} | {' | '.join(cells)} |")
        shutil.rmtree(folder / "capture")


if __name__ == "__main__":
    main(*sys.argv[1:])
