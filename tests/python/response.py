"""What test_response.py and memorial.py share: OpenCV's curves and beamspot's, on one scale."""

import os
import subprocess

import cv2
import numpy as np

MIDDLE = 128


def sample(images, count, seed):
    """Codes of `count` pixels at every exposure, as (pixels, exposures, channels), spread evenly
    over the brightness of the middle exposure and away from edges."""
    stack = np.stack(images, axis=2)
    height, width, exposures, channels = stack.shape
    smooth = np.ones((height, width), bool)
    for image in images:
        gray = image.astype(np.int16).max(axis=2)
        for axis in (0, 1):
            step = np.abs(np.diff(gray, axis=axis, prepend=gray.take([0], axis=axis)))
            smooth &= step <= np.maximum(3, gray // 16)
    light = np.where((stack > 0) & (stack < 255), stack, 0).astype(float).sum(axis=(2, 3))
    rng = np.random.default_rng(seed)
    candidates = np.flatnonzero(smooth.ravel() & (light.ravel() > 0))
    # Even in rank of brightness: the sum over exposures grows with the light.
    order = candidates[np.argsort(stack.astype(int).sum(axis=(2, 3)).ravel()[candidates], kind="stable")]
    picked = [rng.choice(chunk) for chunk in np.array_split(order, count) if len(chunk)]
    return stack.reshape(-1, exposures, channels)[picked]


def beamspot(codes, times):
    """Inverse response ln E of one channel and its u, by the example of crates/pipeline."""
    lines = [",".join(repr(float(t)) for t in times)]
    lines += [",".join(map(str, row)) for row in codes]
    run = subprocess.run(
        [os.environ["BEAMSPOT_RESPONSE"]],
        input="\n".join(lines),
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    table = np.loadtxt(run.stdout.splitlines()[1:], delimiter=",")
    return table[:, 1], table[:, 2]


def opencv(images, times, samples, lambda_=10.0, random=False, seed=0):
    """The same by OpenCV's CalibrateDebevec, one row for each channel."""
    cv2.setRNGSeed(seed)
    calibrate = cv2.createCalibrateDebevec(samples, lambda_, random)
    found = calibrate.process(images, np.asarray(times, np.float32))
    curves = np.log(np.maximum(found.reshape(256, -1).T.astype(float), 1e-30))
    return curves - curves[:, [MIDDLE]]


def opencv_spread(images, times):
    """Curves for all of OpenCV's own ways to choose samples: on a grid and at random."""
    choices = [(count, False, 0) for count in (50, 70, 100, 150)]
    choices += [(count, True, seed) for count in (70, 150) for seed in range(1, 5)]
    return np.stack([opencv(images, times, n, random=r, seed=s) for n, r, s in choices])
