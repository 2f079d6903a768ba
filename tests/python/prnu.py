"""Pixels of uneven sensitivity, the same ones under sample and white: how true u stays, and what it costs to leave them unstated.

    python tests/python/prnu.py BEAMSPOT FOLDER [SEEDS]

FOLDER is made. For each of SEEDS (10) captures of marble with a sensitivity that scatters by 1 % it prints the pulls, (found - true)/u,
with `prnu_relative` stated and with 0 in its place.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

CAMERA = """width = 256
height = 256
mm_per_pixel = 0.16
channels = "mono"
beam_fwhm_mm = 1.0
exposures_s = [0.004, 0.016, 0.064, 0.25, 1.0]
prnu_relative = 0.01
"""
NAMES = ("sigma_s_prime_per_mm", "sigma_a_per_mm")


def main(beamspot, folder, seeds=10):
    folder = Path(folder)
    folder.mkdir(parents=True)
    camera = folder / "camera.toml"
    camera.write_text(CAMERA)
    pulls, chi2 = {}, {}
    for seed in range(1, int(seeds) + 1):
        capture = folder / f"capture{seed}"
        synth = ["synth", "--material", "marble", "--camera", camera, "--seed", str(seed), "-o", capture]
        subprocess.run([beamspot, *synth], check=True, capture_output=True)
        truth = json.loads((capture / "truth.json").read_text())["channels"][0]
        text = (capture / "capture.toml").read_text()
        (capture / "unstated.toml").write_text(re.sub("(?m)^prnu_relative.*", "prnu_relative = 0.0", text))
        for manifest in ("capture", "unstated"):
            out = capture / manifest
            measure = ["measure", capture / f"{manifest}.toml", "-o", out, "--no-confirm"]
            subprocess.run([beamspot, *measure], check=True, capture_output=True)
            found = json.loads((out / "fit.json").read_text())["channels"][0]
            pull = [(found[name]["value"] - truth[name]) / found[name]["u"] for name in NAMES]
            pulls.setdefault(manifest, []).append(pull)
            chi2.setdefault(manifest, []).append(found["reduced_chi2"])
    for manifest, stated in (("capture", "stated"), ("unstated", "taken as 0")):
        of = np.array(pulls[manifest])
        rms, most = np.sqrt((of**2).mean(axis=0)), np.abs(of).max(axis=0)
        print(
            f"{stated}: rms pull of sigma_s' {rms[0]:.2f}, of sigma_a {rms[1]:.2f}; at most {most[0]:.2f} and {most[1]:.2f}; "
            f"reduced chi2 {np.mean(chi2[manifest]):.2f}"
        )


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(*sys.argv[1:])
