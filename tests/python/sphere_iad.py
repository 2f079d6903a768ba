"""`beamspot sphere` beside PyPI iadpython, on the same numbers: failures, errors, time.

    pip install iadpython scipy numpy
    python tests/python/sphere_iad.py BEAMSPOT [SAMPLES]

Random slabs (0.02 < R, T > 0.001, g known), their R and T by adding-doubling (`beamspot brdf`), inverted by both.
iadpython runs with 16 quadrature points, where it is good to 1e-4; with more it goes wrong. That both are asked the
same is shown by its R and T of the true slab beside ours.
"""

import csv
import json
import math
import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import iadpython

FAILED = 0.01


def shares(beamspot, folder, k, medium):
    """R and T of one slab."""
    path = folder / f"{k}.toml"
    path.write_text(medium)
    call = [beamspot, "brdf", path, "-o", folder / f"brdf{k}", "--angle", "0", "--photons", "1", "--json"]
    answer = json.loads(subprocess.run(call, check=True, capture_output=True).stdout)
    return answer["angles"][0]["reflectance"], answer["angles"][0]["transmittance"]


def slab(sigma_a, sigma_s, g, eta, slide, thickness):
    layer = "[[layer]]\nsigma_a_per_mm = {}\nsigma_s_per_mm = {}\ng = {}\neta = {}\nthickness_mm = {}\n"
    glass = layer.format(0.0, 0.0, 0.0, slide, 1.0) if slide else ""
    return glass + layer.format(sigma_a, sigma_s, g, eta, thickness) + glass


def samples(beamspot, folder, count):
    draw = random.Random(5).random
    found = []
    tried = 0
    while len(found) < count:
        tried += 1
        truth = {
            "sigma_a": 10 ** (-3 + 3.5 * draw()),
            "sigma_s": 0.3 + 20 * draw(),
            "g": 0.95 * draw(),
            "eta": 1 + 0.5 * draw(),
            "slide": 1.5 if draw() < 0.5 else None,
            "d": 0.2 + 2 * draw(),
        }
        medium = slab(*(truth[k] for k in ("sigma_a", "sigma_s", "g", "eta", "slide", "d")))
        r, t = shares(beamspot, folder, tried, medium)
        if r > 0.02 and t > 0.001:
            found.append(truth | {"r": r, "t": t})
    return found


def ours(beamspot, folder, media):
    table = folder / "samples.csv"
    with table.open("w", newline="") as out:
        rows = csv.writer(out)
        rows.writerow(["sample", "thickness_mm", "eta", "eta_slide", "reflectance", "transmittance", "g"])
        for k, m in enumerate(media):
            rows.writerow([k, m["d"], m["eta"], m["slide"] or "", m["r"], m["t"], m["g"]])
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    call = [beamspot, "sphere", table, "-o", folder / "sphere", "--json"]
    answer = json.loads(subprocess.run(call, capture_output=True).stdout)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    pairs = []
    for sample in answer["samples"]:
        found = sample["found"]
        pairs.append(found and (found["sigma_a_per_mm"]["value"], found["sigma_s_per_mm"]["value"]))
    return pairs, seconds


def their_sample(m, **known):
    slide = m["slide"] or 1.0
    return iadpython.Sample(n=m["eta"], n_above=slide, n_below=slide, d=m["d"], g=m["g"], quad_pts=16, **known)


def forward_difference(media):
    """The largest difference in R or T between both programs, for the true slabs."""
    worst = 0.0
    for m in media:
        sigma_t = m["sigma_a"] + m["sigma_s"]
        r, t, *_ = their_sample(m, a=m["sigma_s"] / sigma_t, b=sigma_t * m["d"]).rt()
        worst = max(worst, abs(r - m["r"]), abs(t - m["t"]))
    return worst


def theirs(media):
    pairs = []
    before = time.process_time()
    for m in media:
        sample = their_sample(m)
        try:
            experiment = iadpython.Experiment(r=m["r"], t=m["t"], sample=sample, default_g=m["g"])
            a, b, _ = experiment.invert_rt()
            pairs.append(((1 - a) * b / m["d"], a * b / m["d"]))
        except Exception as error:  # whatever a peer throws is a failure of the peer
            print(f"iadpython: {error}")
            pairs.append(None)
    return pairs, time.process_time() - before


def main():
    beamspot = sys.argv[1]
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 200
    with tempfile.TemporaryDirectory() as folder:
        media = samples(beamspot, Path(folder), count)
        results = {"beamspot": ours(beamspot, Path(folder), media), "iadpython": theirs(media)}
    print(f"R and T of the true slabs differ by at most {forward_difference(media):.1e}")
    print(f"{count} slabs; an error above {FAILED:.0%} in either coefficient counts as a failure")
    print("| | failures | within 1e-4 | median error | CPU ms each |")
    print("|---|---|---|---|---|")
    for name, (pairs, seconds) in results.items():
        errors = sorted(
            math.inf if pair is None else max(abs(pair[0] / m["sigma_a"] - 1), abs(pair[1] / m["sigma_s"] - 1))
            for pair, m in zip(pairs, media)
        )
        errors = [math.inf if math.isnan(e) else e for e in errors]
        failures = sum(e > FAILED for e in errors)
        close = sum(e < 1e-4 for e in errors)
        print(f"| {name} | {failures} | {close} | {errors[len(errors) // 2]:.1e} | {1e3 * seconds / count:.0f} |")


if __name__ == "__main__":
    main()
