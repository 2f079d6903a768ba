"""The response of an 8-bit camera, by beamspot and by OpenCV, against a known one."""

import numpy as np
import pytest
from response import MIDDLE, beamspot, opencv_spread, sample

TIMES = [2.0 ** -k for k in range(9)]


def srgb(x):
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-12) ** (1 / 2.4) - 0.055)


def srgb_inverse(y):
    return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)


CURVES = {
    "srgb": (srgb, srgb_inverse),
    "gamma": (lambda x: x ** (1 / 2.2), lambda y: y**2.2),
}


def photograph(encode, seed):
    """A smooth scene of three decades at every exposure, with 1 % of noise."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:240, 0:320]
    light = np.exp(2.6 * np.sin(x / 41.0) + 2.0 * np.cos(y / 57.0) + 0.6 * np.sin((x + y) / 23.0))
    scene = light[..., None] * np.array([1.0, 1.3, 0.8])
    images = []
    for t in TIMES:
        seen = scene * t * (1 + 0.01 * rng.standard_normal(scene.shape))
        images.append(np.round(255 * encode(np.clip(seen, 0, 1))).astype(np.uint8))
    return images


@pytest.mark.parametrize("name", CURVES)
def test_known_response(name):
    encode, decode = CURVES[name]
    images = photograph(encode, 1)
    spread = opencv_spread(images, TIMES)
    codes = sample(images, 2000, 2)
    z = np.arange(20, 246)
    truth = np.log(decode(z / 255.0) / decode(MIDDLE / 255.0))
    for channel in range(3):
        curve, u = beamspot(codes[:, :, channel], TIMES)
        theirs = spread[:, channel][:, z]
        mine = curve[z]
        off, off_theirs = mine - truth, theirs - truth
        low, high = theirs.min(axis=0), theirs.max(axis=0)
        outside = np.maximum(low - mine, mine - high).max()
        widest = (high - low).max()
        print(
            f"{name} {channel}: beamspot off by {np.abs(off).max():.4f}, rms {off.std():.4f}; "
            f"OpenCV by {np.abs(off_theirs).max(axis=1).min():.4f} to "
            f"{np.abs(off_theirs).max():.4f}; its curves spread by {widest:.4f}; "
            f"beamspot outside of them by at most {outside:.4f}"
        )
        assert np.abs(off).max() < 0.02
        assert (np.abs(off) < 5 * np.maximum(u[z], 1e-3)).all()
        # Within the spread between OpenCV's own choices: where it leaves the band of the curves,
        # it does so by less than the band is wide.
        assert outside < widest
        assert (np.diff(curve) >= 0).all()
