"""Compares the response of Debevec's memorial church with OpenCV's, once, from a folder that is not
part of the repository:

    BEAMSPOT_RESPONSE=target/release/examples/response python tests/python/memorial.py FOLDER

The folder holds memorial00NN.png and shutter_times.txt, one exposure a line, longest first.

Where the two differ the pixels decide: of one that has a low code in one exposure and one from 80 to 215 in a longer, the curve
tells a ratio of exposures, and the shutter another. What is printed is the median of ln of the one over the other, for pixels
that neither has seen. On these scans it is below 0.2 from code 25 on and up to 2.8 before, for any curve: the film's fog and the
scanner's black hold whatever is darker at codes about 20, where no curve can tell one light from another. u has to hold that: last comes
the share of those pairs that our curve with 1.96 u of both codes holds.
"""

import sys
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from response import beamspot, opencv_spread, sample


def pulls(curve, u, codes, times, low):
    """ln(ratio by `curve`/ratio by the shutter) for pixels with a code in `low`, and its u."""
    found, known = [np.empty(0)], [np.empty(0)]
    for i, short in enumerate(np.log(times)):
        for j, long in enumerate(np.log(times)):
            if 1.5 < long - short < 3:
                pairs = (codes[:, i] >= low[0]) & (codes[:, i] < low[1]) & (codes[:, j] >= 80) & (codes[:, j] <= 215)
                found.append(curve[codes[pairs, j]] - curve[codes[pairs, i]] - (long - short))
                known.append(np.hypot(u[codes[pairs, j]], u[codes[pairs, i]]))
    return np.concatenate(found), np.concatenate(known)


def main(folder):
    files = sorted(Path(folder).glob("memorial*.png"))
    times = [float(Fraction(t)) for t in (Path(folder) / "shutter_times.txt").read_text().split()]
    if not files or len(files) != len(times):
        sys.exit(f"{folder}: found {len(files)} pictures and {len(times)} exposure times")
    images = [cv2.imread(str(file)) for file in files]
    spread = opencv_spread(images, times)
    codes = sample(images, 3000, 1)
    unseen = sample(images, 20000, 7)
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
        for low in ((15, 20), (20, 25), (25, 30), (30, 40), (40, 60)):
            off, known = pulls(curve, u, unseen[:, :, channel], times, low)
            off_theirs, _ = pulls(np.median(spread[:, channel], axis=0), u, unseen[:, :, channel], times, low)
            if len(off) == 0:
                continue
            print(
                f"   codes {low[0]} to {low[1]}: {len(off)} pairs, ours {np.median(off):+.3f}, OpenCV's median "
                f"{np.median(off_theirs):+.3f}; u {np.median(known):.3f} holds {100 * np.mean(np.abs(off) < 1.96 * known):.1f} %"
            )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
