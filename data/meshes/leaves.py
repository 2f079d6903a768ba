"""Writes leaves.obj: five bent leaves of 0.5 mm, closed, around one stem, in mm with z up."""

from math import cos, pi, radians, sin, sqrt

ALONG, ACROSS, LENGTH, HALF = 26, 8, 60.0, 0.25
# Turn about z, lift of the tip over the horizontal, length, height of the stem.
LEAVES = [(-62, 52, 0.8, 4), (-24, 66, 1.0, 6), (20, 58, 0.95, 5), (58, 70, 0.75, 8), (0, 30, 0.7, -6)]


def middle(leaf, s, t):
    turn, lift, size, height = leaf
    length = LENGTH * size
    width = (16 * sin(pi * s**0.85) ** 0.9 + 0.4) * size
    x, y = t * width, s * length
    z = -0.35 * s * s * length + 0.3 * abs(t) * width + 0.6 * sin(9 * s + 2 * t)
    a, b = radians(lift), radians(turn)
    y, z = y * cos(a) - z * sin(a), y * sin(a) + z * cos(a)
    return cos(b) * x - sin(b) * z * 0.5, y, z + sin(b) * x * 0.5 + height, 14 * sin(b)


def point(leaf, s, t):
    x, y, z, aside = middle(leaf, s, t)
    return x + aside + 28 * sin(radians(leaf[0])) * s, y, z


def normal(leaf, s, t):
    e = 1e-4
    ds = [b - a for a, b in zip(point(leaf, s - e, t), point(leaf, s + e, t))]
    # The fold at the midrib has no one slope.
    dt = [b - a for a, b in zip(point(leaf, s, t - 0.05), point(leaf, s, t + 0.05))]
    n = [dt[(k + 1) % 3] * ds[(k + 2) % 3] - dt[(k + 2) % 3] * ds[(k + 1) % 3] for k in range(3)]
    size = sqrt(sum(x * x for x in n))
    return [x / size for x in n]


lines, faces, first = [], [], 1
for leaf in LEAVES:
    for side in (1, -1):
        for i in range(ALONG + 1):
            for j in range(ACROSS + 1):
                s, t = 0.02 + 0.96 * i / ALONG, 2 * j / ACROSS - 1
                n = normal(leaf, s, t)
                p = [x + side * HALF * y for x, y in zip(point(leaf, s, t), n)]
                lines.append("v %.3f %.3f %.3f" % tuple(p))
                lines.append("vn %.3f %.3f %.3f" % tuple(side * x for x in n))
    row = ACROSS + 1
    under = (ALONG + 1) * row
    at = lambda i, j: first + i * row + j  # noqa: E731
    for i in range(ALONG):
        for j in range(ACROSS):
            a, b, c, d = at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)
            faces += [(a, b, c, d), tuple(under + k for k in (d, c, b, a))]
    rim = [at(0, j) for j in range(ACROSS)] + [at(i, ACROSS) for i in range(ALONG)]
    rim += [at(ALONG, j) for j in range(ACROSS, 0, -1)] + [at(i, 0) for i in range(ALONG, 0, -1)]
    faces += [(b, a, a + under, b + under) for a, b in zip(rim, rim[1:] + rim[:1])]
    first += 2 * under
with open("leaves.obj", "w") as out:
    out.write("\n".join(lines) + "\n")
    out.writelines("f " + " ".join(f"{k}//{k}" for k in face) + "\n" for face in faces)
