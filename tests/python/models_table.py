"""What each closed form makes of photons that others counted: the tables of docs/models.md.

`python models_table.py BEAMSPOT` (scipy, mpmath; a minute). The models' own R_d comes from
fixtures/models.py, which integrates them apart from the Rust code; the fits are beamspot's.
"""

import csv
import json
import subprocess
import sys
import tempfile
from math import inf, pi
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "fixtures"))
import models  # noqa: E402

# name in fixtures/monte-carlo, eta, sigma_a, sigma_s', g, thickness, total reflectance and its u.
RUNS = [
    ("marble_g", 1.5, 0.0041, 2.62, 0.0, None, 0.767481, 0.000120),
    ("marble_g_g09", 1.5, 0.0041, 2.62, 0.9, None, 0.768084, 0.000293),
    ("skin1_r", 1.3, 0.032, 0.74, 0.0, None, 0.431996, 0.000065),
    ("skin1_r_matched", 1.0, 0.032, 0.74, 0.0, None, 0.565636, 0.000115),
    ("slab_1mm", 1.43, 0.021, 1.37, 0.8, 1.0, 0.370733, 0.000080),
]
BANDS = [(0.1, 0.5), (0.5, 1), (1, 2), (2, 5), (5, 10), (10, 20)]


def rings(name):
    """Rings with an error below 10 %: inner, outer, exitance per incident power, its u."""
    path = ROOT / f"fixtures/monte-carlo/{name}.reflectance_r.csv"
    for row in csv.reader(path.read_text().splitlines()[1:]):
        try:
            inner, outer, value, u = (float(cell) for cell in row[:4])
        except ValueError:
            continue
        if 0 < u < 0.1 * value:
            yield inner, outer, value, u


def at(model, run, r):
    """R_d of a model per power that enters."""
    _, eta, a, s, g, thickness, *_ = run
    if model == "dipole":
        # The multipole of a slab without end.
        two_c1, _ = models.moments(eta)
        big_a = (1 + two_c1) / (1 - two_c1)
        t = a + s
        k = (3 * a * t) ** 0.5
        total = 0.0
        for z in (1 / t, (1 + 4 * big_a / 3) / t):
            d = models.hypot(r, z)
            total += z * (1 + k * d) * models.exp(-k * d) / d**3
        return s / t * total / (4 * pi)
    if model == "multipole":
        return models.slab(eta, eta, thickness, a, s, r, 0)
    if model == "photon-beam-diffusion":
        return models.beam_multiple(eta, a, s, r) + models.beam_single(eta, g, a, s, r)
    if model == "directional":
        return float(models.directional(eta, 0.0, a, s, r, 0.0))
    of = {"better-dipole": models.better_dipole, "kienle-patterson": models.kienle_patterson}
    return of[model](eta, a, s, r)


def deviations():
    """Mean of model/photons - 1 by radius in transport lengths, for the true medium."""
    heads = " | ".join(f"{low}-{high}" for low, high in BANDS)
    print(f"| medium | model | {heads} |\n|---|---|{'---|' * len(BANDS)}")
    for run in RUNS:
        name, eta, a, s, _, thickness, *_ = run
        entering = 1 - models.fresnel(eta, 1.0)
        names = ["dipole", "better-dipole", "kienle-patterson", "photon-beam-diffusion", "directional"]
        for model in [*names, *(["multipole"] if thickness else [])]:
            cells = []
            for low, high in BANDS:
                inside = [r for r in rings(name) if low <= r[0] * (a + s) and r[1] * (a + s) <= high]
                # A dozen rings of a band are enough.
                inside = inside[:: max(1, len(inside) // 12)]
                pairs = []
                for inner, outer, value, u in inside:
                    r = 2 / 3 * (outer**3 - inner**3) / (outer**2 - inner**2)
                    pairs.append((at(model, run, r) * entering / value - 1, (value / u) ** 2))
                weight = sum(w for _, w in pairs)
                cells.append(f"{100 * sum(d * w for d, w in pairs) / weight:+.1f} %" if pairs else "")
            print(f"| {name} | {model} | {' | '.join(cells)} |")


def biases(beamspot):
    """Errors of sigma_a and sigma_s' of every model under each constraint."""
    constraints = ("exact", "joint", "none")
    print("| medium | model | " + " | ".join(f"{c}: σa, σs′" for c in constraints) + " | χ²/dof, joint |")
    print("|---|---|---|---|---|---|")
    for name, eta, a, s, g, thickness, total, u in RUNS:
        found = {}
        with tempfile.TemporaryDirectory() as folder:
            profile = Path(folder) / "profile.csv"
            lines = ["channel,radius_min_mm,radius_max_mm,radius_mm,reflectance_per_mm2,u_reflectance_per_mm2,pixels"]
            for inner, outer, value, u_value in rings(name):
                mean = 2 / 3 * (outer**3 - inner**3) / (outer**2 - inner**2)
                lines.append(f"Y,{inner},{outer},{mean},{value},{u_value},")
            profile.write_text("\n".join(lines) + "\n")
            for constraint in constraints:
                call = [beamspot, "fit", profile, "--eta", eta, "--model", "all", "--g", g, "--json"]
                # The model's own error, named: what `--discrepancy true` would lean away from.
                call += ["--discrepancy", "false"]
                call += ["--constraint", constraint, "--total", f"Y={total}+-{u}"]
                call += ["--thickness", thickness] if thickness else []
                done = subprocess.run([str(c) for c in call], check=True, capture_output=True, text=True)
                for model in json.loads(done.stdout)["models"]:
                    found.setdefault(model["model"], {})[constraint] = model["channels"]
        for model, by in found.items():
            cells = []
            for constraint in constraints:
                if by.get(constraint):
                    channel = by[constraint][0]
                    errors = [
                        100 * (channel[key]["value"] / true - 1)
                        for key, true in (("sigma_a_per_mm", a), ("sigma_s_prime_per_mm", s))
                    ]
                    cells.append(", ".join(f"{e:+.1f} %" for e in errors))
                else:
                    cells.append("–")
            chi2 = by["joint"][0]["reduced_chi2"] if by.get("joint") else inf
            print(f"| {name} | {model} | {' | '.join(cells)} | {chi2:.3g} |")


if __name__ == "__main__":
    deviations()
    print()
    biases(sys.argv[1])
