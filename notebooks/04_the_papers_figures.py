# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # The papers' figures
#
# Two papers stand behind beamspot: Hanrahan and Krueger, *Reflection from Layered Surfaces due to Subsurface
# Scattering* (1993), and Jensen, Marschner, Levoy and Hanrahan, *A Practical Model for Subsurface Light Transport*
# (2001). `beamspot figures` computes their figures anew, as csv and svg. Here the numbers are drawn by hand. The
# command `beamspot` has to be on the path, or named by the variable `BEAMSPOT_BIN`.

# %%
import csv
import os
import subprocess
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

BEAMSPOT = os.environ.get("BEAMSPOT_BIN", "beamspot")
folder = Path(tempfile.mkdtemp())
# Photons are counted for two of the figures; the command's default of a million draws them smooth.
for paper, photons in (("hk93", "1e5"), ("jensen2001", "2e5")):
    call = [BEAMSPOT, "figures", paper, "--photons", photons, "-o", folder / paper]
    subprocess.run(call, check=True, capture_output=True)


def lines(paper, figure):
    """The lines of a figure: {panel: {name: (x, y)}}."""
    panels = {}
    with open(folder / paper / f"{figure}.csv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            line = panels.setdefault(row["panel"], {}).setdefault(row["line"], [])
            line.append((float(row["x"]), float(row["y"])))
    return {panel: {name: np.array(points).T for name, points in of.items()} for panel, of in panels.items()}


# %% [markdown]
# ## Hanrahan and Krueger, Figures 2 and 3: a surface, and one scattering
# Left, the light that a smooth surface of water reflects, by the angle at which it falls, from above and from
# below; from below everything is reflected beyond 48.6°. Right, where a particle sends the light that meets
# it. The light comes from the left; a positive g is forward.

# %%
figure = plt.figure(figsize=(10, 4), layout="constrained")
axes = figure.add_subplot(1, 2, 1)
for (panel, of), style in zip(lines("hk93", "figure2").items(), ("-", "--")):
    for (name, (x, y)), color in zip(of.items(), ("tab:blue", "tab:orange")):
        axes.plot(x, y, style, color=color, label=f"{panel.split(' (')[0]}: {name.split(',')[0]}")
axes.set_xlabel("angle of incidence (°)")
axes.set_ylabel("share of the light")
axes.legend(fontsize=8)
axes = figure.add_subplot(1, 2, 2)
for (panel, of), color in zip(lines("hk93", "figure3").items(), ("tab:purple", "tab:green")):
    (x, y), = of.values()
    axes.plot(x, y, color=color, label=panel)
axes.plot(0, 0, "k.")
axes.set_aspect("equal")
axes.set_xlabel("forward: Henyey and Greenstein's phase function")
axes.legend()
figure.savefig(folder / "figures_2_and_3.png", dpi=120)

# %% [markdown]
# ## Figure 4: a layer that scatters once
# Light falls on a layer from the upper left. What scattered once leaves above (reflected) and below
# (transmitted); the farther a line is from the middle, the more light goes that way. Columns differ in the
# way the particles scatter, rows in how thick the layer is.

# %%
panels = lines("hk93", "figure4")
figure, grid = plt.subplots(3, 3, figsize=(9, 7.5), layout="constrained")
for (panel, of), axes in zip(panels.items(), grid.flat):
    for (name, (x, y)), color in zip(of.items(), ("tab:blue", "tab:orange")):
        axes.fill(x, y, color=color, alpha=0.25, lw=0)
        axes.plot(x, y, color=color, label=name)
    axes.axhline(0, color="black", lw=0.8)
    axes.set_title(panel, fontsize=10)
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=8)
grid[0, 0].legend(fontsize=8)
figure.savefig(folder / "figure_4.png", dpi=120)

# %% [markdown]
# ## Figures 8 and 9: how often light scatters
# Left: the reflectance of a half-space by its albedo, with light that scattered up to once, twice, … counted. For
# dark materials the first order is nearly all; for white ones no ten orders are enough, which is where
# diffusion comes in. Right: reflected radiance at 45° incidence by the angle of view. Light that scattered once
# follows Seeliger's law; what scattered more often is nearly the same in all directions.

# %%
figure, (first, second, third) = plt.subplots(1, 3, figsize=(11, 4), layout="constrained")
(of,) = lines("hk93", "figure8").values()
for (name, (x, y)), color in zip(of.items(), ("tab:red", "tab:orange", "0.7", "black")):
    # The third to tenth order are one line in the file; each begins at albedo 0 again.
    for k, piece in enumerate(np.split(np.arange(len(x)), np.flatnonzero(np.diff(x) < 0) + 1)):
        first.plot(x[piece], y[piece], color=color, label=None if k else name)
first.set_xlabel("albedo")
first.set_ylabel("reflectance")
first.legend(fontsize=8)
for (panel, of), axes in zip(lines("hk93", "figure9").items(), (second, third)):
    for (name, (x, y)), color in zip(of.items(), ("black", "tab:red", "tab:blue", "0.6")):
        style = {"lw": 1.2} if "law" in name else {"ls": "", "marker": "o", "ms": 4}
        axes.plot(x, y, color=color, label=name, **style)
    axes.set_title(panel)
    axes.set_xlabel("angle of view (°)")
    axes.set_ylim(0, None)
second.set_ylabel("reflected radiance")
second.legend(fontsize=8)
figure.savefig(folder / "figures_8_and_9.png", dpi=120)

# %% [markdown]
# ## Jensen et al., Figure 6: the dipole on marble
# The paper lays the dipole over photographs of a beam on marble and over a Monte Carlo simulation. The photographs were
# never published. The photons can be counted again, and the transport equation says what they scatter about. Within
# a millimetre of the beam the dipole is up to 60 % too high, at 1.5 mm a sixth too low, and a few percent off
# farther out.

# %%
(of,) = lines("jensen2001", "figure6").values()
figure, (top, bottom) = plt.subplots(2, 1, figsize=(7, 6), sharex=True, height_ratios=[3, 1.3], layout="constrained")
x, transport = of["transport equation"]
top.loglog(x, transport, color="black", lw=1.2, label="transport equation")
top.loglog(*of["dipole"], color="tab:red", lw=1.2, label="dipole")
top.loglog(*of["Monte Carlo"], ".", ms=4, color="0.45", label="photons")
top.set_ylabel("$R_d$ (mm$^{-2}$)")
top.legend()
dipole = np.interp(x, *of["dipole"])
bottom.semilogx(x, 100 * (dipole / transport - 1), color="tab:red")
bottom.axhline(0, color="black", lw=1.2)
bottom.set_ylabel("dipole over\ntransport − 1 (%)")
bottom.set_xlabel("distance from the beam (mm)")
bottom.set_xticks([0.1, 0.2, 0.5, 1, 2, 5, 10, 20], ["0.1", "0.2", "0.5", "1", "2", "5", "10", "20"])
figure.align_ylabels()
figure.savefig(folder / "figure_6.png", dpi=120)
far = (x > 2) & (x < 10)
assert np.abs(dipole / transport - 1)[far].max() < 0.2
