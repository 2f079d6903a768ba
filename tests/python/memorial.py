"""Compares the response of Debevec's memorial church with OpenCV's, once, from a folder that is not
part of the repository:

    BEAMSPOT_RESPONSE=target/release/examples/response python tests/python/memorial.py FOLDER

The folder holds memorial00NN.png and shutter_times.txt, one exposure a line, longest first.
"""

import sys
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from response import beamspot, opencv_spread, sample


def main(folder):
    files = sorted(Path(folder).glob("memorial*.png"))
    times = [float(Fraction(t)) for t in (Path(folder) / "shutter_times.txt").read_text().split()]
    if not files or len(files) != len(times):
        sys.exit(f"{folder}: found {len(files)} pictures and {len(times)} exposure times")
    images = [cv2.imread(str(file)) for file in files]
    spread = opencv_spread(images, times)
    codes = sample(images, 3000, 1)
    z = np.arange(20, 236)
    for channel, name in enumerate("BGR"):
        curve, u = beamspot(codes[:, :, channel], times)
        theirs = spread[:, channel][:, z]
        low, high = theirs.min(axis=0), theirs.max(axis=0)
        mine = curve[z]
        inside = np.mean((mine >= low) & (mine <= high))
        off = np.abs(mine - np.median(theirs, axis=0))
        print(
            f"{name}: inside OpenCV's own spread at {100 * inside:.0f} % of codes 20 to 235; "
            f"off its median by at most {off.max():.3f}, at code {z[off.argmax()]}, where it spreads by "
            f"{(high - low)[off.argmax()]:.3f}; mean {off.mean():.3f} of {(high - low).mean():.3f}; "
            f"from code 40 at most {off[20:].max():.3f}; u at most {u[z].max():.3f}; outside by at most "
            f"{np.maximum(0, np.maximum(low - mine, mine - high)).max():.3f}"
        )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
