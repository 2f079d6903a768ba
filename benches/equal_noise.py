"""Figure 9 of Jensen et al. (2001): how much cheaper `bssrdf` is than `monte-carlo` at equal noise.

Mean variance of a pixel times CPU time, of each component and of all, both on one thread. What the
model itself gets wrong is no noise and is not in it: `beamspot validate` shows it.

    python benches/equal_noise.py target/release/beamspot

Needs PyPI's mitsuba (to read EXR) and numpy.
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np

SCENE = Path(__file__).parent.parent / "scenes" / "jensen9.toml"
ROUNDS = {"bssrdf": 8, "monte-carlo": 24}


def costs(binary, method):
    """Mean and variance times CPU seconds of each component."""
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder, "bust.exr")
        command = [binary, "render", SCENE, "-o", picture, "--components", "--threads", "1"]
        command += ["--method", method, "--rounds", str(ROUNDS[method])]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run(command, check=True, capture_output=True)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        bitmap = mi.Bitmap(str(picture))
        names = [bitmap.struct_()[k].name for k in range(bitmap.channel_count())]
        data = dict(zip(names, np.moveaxis(np.array(bitmap, dtype=float), 2, 0)))
    means = {name: data[name].mean() for name in names if f"{name}.variance" in data}
    return {name: (mean, data[f"{name}.variance"].mean() * seconds) for name, mean in means.items()}, seconds


def main():
    mi.set_variant("scalar_rgb")
    found = {}
    for method in ROUNDS:
        found[method], seconds = costs(sys.argv[1], method)
        print(f"{method}: {ROUNDS[method]} rounds, {seconds:.1f} CPU s")
        for name, (mean, cost) in found[method].items():
            print(f"  {name}: mean {mean:.6f}, variance times CPU s {cost:.3g}")
    cheap, full = ([cost for _, cost in found[method].values()] for method in ROUNDS)
    for name, a, b in zip(found["bssrdf"], cheap, full):
        print(f"{name}: {b / a:.0f} times cheaper")
    print(f"all: bssrdf is {sum(full) / sum(cheap):.0f} times cheaper than monte-carlo at equal noise")


if __name__ == "__main__":
    main()
