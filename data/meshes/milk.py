"""Writes milk.obj: a body of milk as a glass would hold it, 60 mm wide, 70 mm high, rounded."""
from math import cos, pi, sin

around, radius, height, edge = 96, 30.0, 70.0, 4.0
# Profile from the middle of the bottom to the middle of the top: radius and height.
profile = [(radius * k / 8, 0.0) for k in range(1, 8) if radius * k / 8 < radius - edge]
profile += [(radius - edge + edge * sin(t), edge - edge * cos(t)) for t in (pi / 16 * k for k in range(9))]
profile += [(radius, edge + (height - 2 * edge) * k / 24) for k in range(1, 24)]
profile += [(radius - edge + edge * cos(t), height - edge + edge * sin(t)) for t in (pi / 16 * k for k in range(9))]
profile += [(radius * k / 8, height) for k in range(7, 0, -1) if radius * k / 8 < radius - edge]

with open("milk.obj", "w") as out:
    out.write("# Written by milk.py beside it. z up, millimetres. CC0.\n")
    out.write("v 0 0 0\n")
    for r, z in profile:
        for k in range(around):
            phi = 2 * pi * k / around
            out.write(f"v {r * cos(phi):.4f} {r * sin(phi):.4f} {z:.4f}\n")
    out.write(f"v 0 0 {height:g}\n")
    top = 2 + around * len(profile)
    at = lambda row, k: 2 + around * row + k % around
    for k in range(around):
        out.write(f"f 1 {at(0, k + 1)} {at(0, k)}\n")
        for row in range(len(profile) - 1):
            a, b, c, d = at(row, k), at(row, k + 1), at(row + 1, k + 1), at(row + 1, k)
            out.write(f"f {a} {b} {c}\nf {a} {c} {d}\n")
        out.write(f"f {top} {at(len(profile) - 1, k)} {at(len(profile) - 1, k + 1)}\n")
