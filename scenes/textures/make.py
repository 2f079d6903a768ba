"""The textures of ../textured.toml (CC0): python make.py writes them beside itself."""

import math
import struct
import zlib
from pathlib import Path


def hashed(x, y, z):
    """An even number of [0, 1) for a corner of the lattice."""
    n = (x * 0x8DA6B343 ^ y * 0xD8163841 ^ z * 0xCB1AB31F) & 0xFFFFFFFF
    for shift, factor in ((16, 0x45D9F3B), (16, 0x45D9F3B), (16, 1)):
        n = ((n ^ n >> shift) * factor) & 0xFFFFFFFF
    return n / 2**32


def noise(x, y, z):
    """Smooth between the corners of the lattice."""
    base = [math.floor(c) for c in (x, y, z)]
    part = [c - b for c, b in zip((x, y, z), base)]
    part = [t * t * (3 - 2 * t) for t in part]
    value = 0.0
    for corner in range(8):
        bits = [corner >> k & 1 for k in range(3)]
        weight = math.prod(t if b else 1 - t for t, b in zip(part, bits))
        value += weight * hashed(*(c + b for c, b in zip(base, bits)))
    return value


def turbulence(x, y, z):
    """Noise of four sizes about 0."""
    return sum((noise(x * 2**k, y * 2**k, z * 2**k) - 0.5) / 2**k for k in range(4))


def png(name, width, height, channels, at, srgb):
    rows = b""
    for row in range(height):
        rows += b"\0"
        for column in range(width):
            rows += bytes(round(255 * min(max(x, 0), 1)) for x in at(column, row))

    def chunk(kind, data):
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    header = struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 0, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    if srgb:
        data += chunk(b"sRGB", b"\0")
    data += chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
    (Path(__file__).parent / name).write_bytes(data)


def vein(column, row, width=256, height=128):
    """Absorption of a marbled ball, by longitude and latitude; seamless, since it is cut from a solid."""
    longitude = 2 * math.pi * (column + 0.5) / width
    latitude = math.pi * (0.5 - (row + 0.5) / height)
    x, y = (math.cos(latitude) * f(longitude) for f in (math.cos, math.sin))
    z = math.sin(latitude)
    wave = math.sin(4 * (x + 0.6 * z) + 5 * turbulence(x + 5, y + 5, z + 5))
    return [math.exp(-4 * abs(wave)) + 0.004]


def tile(column, row, size=64):
    """A board of cream and brick, as one sees it."""
    light = (column * 2 // size + row * 2 // size) % 2 == 0
    grain = 0.06 * (hashed(column, row, 7) - 0.5)
    return [c + grain for c in ((0.93, 0.88, 0.76) if light else (0.60, 0.27, 0.20))]


png("veins.png", 256, 128, 1, vein, False)
png("tiles.png", 64, 64, 3, tile, True)
