"""Figure 9 of Jensen et al. (2001): how much cheaper `bssrdf` is than `monte-carlo` at equal noise.

Variance times CPU time, both on one thread: of a pixel, on the mean, for each component and for all;
and of the mean over 32 x 32 pixels, as it scatters between pictures of other seeds, since pixels of
`bssrdf` share the points where light enters. What the model itself gets wrong is no noise and is not
in it: `beamspot validate` shows it.

    python benches/equal_noise.py target/release/beamspot

Needs PyPI's mitsuba (to read EXR) and numpy.
"""

import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
from rendered import rendered

SCENE = Path(__file__).parent.parent / "scenes" / "jensen9.toml"
ROUNDS = {"bssrdf": 4, "monte-carlo": 12}
SEEDS = range(1, 7)
BLOCK = 32


def picture(binary, method, seed):
    """Planes by name, and CPU seconds."""
    options = ["--components", "--seed", seed, "--method", method, "--rounds", ROUNDS[method]]
    return rendered(binary, SCENE, *options)


def blocks(plane):
    height, width = (side // BLOCK * BLOCK for side in plane.shape)
    return plane[:height, :width].reshape(height // BLOCK, BLOCK, -1, BLOCK).mean((1, 3))


def costs(binary, method):
    """Mean, and variance times CPU seconds of a pixel and of a block, of each component."""
    pictures, seconds = zip(*(picture(binary, method, seed) for seed in SEEDS))
    seconds = np.mean(seconds)
    names = [name for name in pictures[0] if f"{name}.variance" in pictures[0]]

    def of(name):
        pixel = np.mean([data[f"{name}.variance"] for data in pictures])
        block = np.var([blocks(data[name]) for data in pictures], axis=0, ddof=1).mean()
        return np.mean([data[name] for data in pictures]), pixel * seconds, block * seconds

    return {name: of(name) for name in names}, seconds


def main():
    mi.set_variant("scalar_rgb")
    found = {}
    for method in ROUNDS:
        found[method], seconds = costs(sys.argv[1], method)
        print(f"{method}: {ROUNDS[method]} rounds, {seconds:.1f} CPU s a picture")
        for name, (mean, pixel, block) in found[method].items():
            print(f"  {name}: mean {mean:.6f}, variance times CPU s {pixel:.3g} of a pixel, {block:.3g} of a block")
    cheap, full = (np.array([cost[1:] for cost in found[method].values()]) for method in ROUNDS)
    for name, (pixel, block) in zip(found["bssrdf"], full / cheap):
        print(f"{name}: {pixel:.0f} times cheaper by pixels, {block:.0f} by blocks")
    pixel, block = full.sum(0) / cheap.sum(0)
    print(f"all: bssrdf is {pixel:.0f} times cheaper than monte-carlo at equal noise of a pixel, {block:.0f} at that of a block")


if __name__ == "__main__":
    main()
