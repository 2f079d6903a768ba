"""`render --method monte-carlo` beside Mitsuba 3's volpath: variance at equal CPU time.

A marble cube (green, as Jensen's Figure 8) under an even lamp, 64 x 64 pixels. Both follow the
full transport through a smooth boundary without a limit on bounces; the means have to agree.

    python benches/transport_peers.py target/release/beamspot

Needs PyPI's mitsuba (its llvm variants need Debian's libllvm19) and numpy.
"""

import sys
import tempfile
import time
from pathlib import Path

import mitsuba as mi
import numpy as np
from rendered import rendered

SIZE = 64
SIGMA_A, SIGMA_S, ETA = 0.0041, 2.62, 1.5
FROM, TO, FIELD = [0, -170, 75], [0, 0, -1], 18.5
# Corner and sides of the lamp, which shines on the side of u x v.
CORNER, U, V = [-20, -20, 60], [0, 40, 0], [40, 0, 0]

SCENE = f"""
channels = ["G"]

[camera]
kind = "pinhole"
from_mm = {FROM}
to_mm = {TO}
field_deg = {FIELD}
width_px = {SIZE}
height_px = {SIZE}

[[object]]
name = "cube"
shape = "block"
min_mm = [-20, -20, -20]
max_mm = [20, 20, 20]
medium = {{ sigma_a_per_mm = {SIGMA_A}, sigma_s_per_mm = {SIGMA_S} }}
eta = {ETA}

[[light]]
kind = "area"
corner_mm = {CORNER}
u_mm = {U}
v_mm = {V}
"""


def of_beamspot(binary, rounds):
    """Mean, variance of the mean, and CPU seconds."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "cube.toml")
        scene.write_text(SCENE)
        planes, seconds = rendered(binary, scene, "--rounds", rounds)
    return planes["G"], planes["G.variance"], seconds


def of_mitsuba(variant, roulette, samples, repeats):
    """Mean, variance of the mean, and CPU seconds, without those of the first (compiling) run."""
    mi.set_variant(variant)
    t = mi.ScalarTransform4f()
    # Its rectangle is [-1, 1] x [-1, 1] and shines along +z: turned over, it shines down.
    lamp = t.translate([0, 0, CORNER[2]]).rotate([1, 0, 0], 180).scale([20, 20, 1])
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": roulette},
            "sensor": {
                "type": "perspective",
                "fov": FIELD,
                "fov_axis": "y",
                "to_world": t.look_at(origin=FROM, target=TO, up=[0, 0, 1]),
                "film": {
                    "type": "hdrfilm",
                    "width": SIZE,
                    "height": SIZE,
                    "rfilter": {"type": "box"},
                    "pixel_format": "luminance",
                },
                "sampler": {"type": "independent"},
            },
            "cube": {
                "type": "cube",
                "to_world": t.scale([20, 20, 20]),
                "bsdf": {"type": "dielectric", "int_ior": ETA, "ext_ior": 1.0},
                "interior": {
                    "type": "homogeneous",
                    "albedo": SIGMA_S / (SIGMA_S + SIGMA_A),
                    "sigma_t": SIGMA_S + SIGMA_A,
                    "phase": {"type": "isotropic"},
                },
            },
            "lamp": {
                "type": "rectangle",
                "to_world": lamp,
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
            },
        }
    )
    np.array(mi.render(scene, spp=1, seed=10_000))
    start = time.process_time()
    runs = [
        np.array(mi.render(scene, spp=samples, seed=seed), dtype=float)[..., 0]
        for seed in range(repeats)
    ]
    seconds = time.process_time() - start
    return np.mean(runs, axis=0), np.var(runs, axis=0, ddof=1) / repeats, seconds


def main():
    mi.set_variant("scalar_rgb")
    ours, of_ours, seconds = of_beamspot(sys.argv[1], 40)
    cost = seconds * of_ours.mean()
    print(f"beamspot: mean {ours.mean():.6f} +- {(of_ours.sum() ** 0.5) / ours.size:.6f}, {seconds:.1f} CPU s")
    for variant in ("llvm_ad_rgb", "scalar_rgb"):
        for roulette in (5, 100_000):
            try:
                theirs, of_theirs, spent = of_mitsuba(variant, roulette, 32, 8)
            except Exception as error:
                print(f"{variant}: left out ({error})")
                break
            ratio = spent * of_theirs.mean() / cost
            print(
                f"mitsuba {mi.__version__} {variant}, roulette from depth {roulette}: mean {theirs.mean():.6f} +- "
                f"{(of_theirs.sum() ** 0.5) / theirs.size:.6f}, {spent:.1f} CPU s; variance at equal CPU time "
                f"{ratio:.0f} times beamspot's"
            )


if __name__ == "__main__":
    main()
