# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # A spectral cube
#
# A laboratory that looks at fruit, meat or skin line by line with an imaging spectrograph gets a radial profile for every
# position and every wavelength. This notebook makes such a cube of a sample with a dark patch, fits all of its
# profiles in one call, and turns the absorption into the amount of two pigments.

# %%
import tempfile
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray

import beamspot

folder = Path(tempfile.mkdtemp())
eta = 1.35
wavelength_nm = np.arange(480, 701, 5.0)
position_mm = np.linspace(0, 30, 61)
radius_mm = np.geomspace(0.6, 9, 40)

# %% [markdown]
# ## The sample
# Two invented pigments, each with a band of absorption, over a faint gray. The amount of the first rises in a patch in
# the middle, the second falls from left to right. Scattering falls with wavelength by a power law, as it does in
# tissue, and is the same everywhere.


# %%
def band(center_nm, width_nm):
    return np.exp(-0.5 * ((wavelength_nm - center_nm) / width_nm) ** 2)


pigments = np.stack([band(545, 18) + 0.8 * band(578, 12), band(660, 22)])  # (pigment, wavelength), mm⁻¹ each
gray = 0.01
amounts = np.stack(
    [0.03 + 0.09 * np.exp(-0.5 * ((position_mm - 15) / 4) ** 2), 0.06 * (1 - position_mm / 40)], axis=1
)  # (position, pigment)
sigma_a = gray + amounts @ pigments  # (position, wavelength), mm⁻¹
sigma_s_prime = np.broadcast_to(1.6 * (wavelength_nm / 550) ** -1.2, sigma_a.shape)

entry = 1 - ((eta - 1) / (eta + 1)) ** 2
cube = np.empty((*sigma_a.shape, len(radius_mm)))  # (position, wavelength, radius), mm⁻²
for index in np.ndindex(sigma_a.shape):
    cube[index] = entry * beamspot.dipole(
        radius_mm, sigma_s_prime=sigma_s_prime[index], sigma_a=sigma_a[index], eta=eta
    )
u = 0.01 * cube + 2e-7  # one percent of the light, and the camera's floor
cube = xarray.DataArray(
    cube + u * np.random.default_rng(5).standard_normal(cube.shape),
    coords={
        "position_mm": position_mm,
        "wavelength_nm": ("wavelength_nm", wavelength_nm, {"units": "nm"}),
        "radius_mm": ("radius_mm", radius_mm, {"units": "mm"}),
    },
    attrs={"units": "mm-2"},
)
print(dict(cube.sizes))

# %% [markdown]
# ## One call
# `fit_many` takes the cube with its labels and gives a dataset over the other dimensions, with a unit beside every
# quantity. It works on all processors, and gives the same numbers on any number of them. A profile that cannot be
# fitted does not stop the others; `error` says why. The dipole made this light, so `discrepancy=False` leaves its error
# against transport out.
#
# A cube larger than memory comes in chunks (`xarray.open_zarr("cube.zarr")`) and is fitted by the same line when the
# answer is written; arrays without labels, one profile in a row, do as well.

# %%
start = time.perf_counter()
found = beamspot.fit_many(cube.radius_mm, cube, u, eta=eta, constraint="none", discrepancy=False)
elapsed = time.perf_counter() - start
failed = int((found.error != "").sum())
print(f"{found.error.size} profiles in {elapsed:.2f} s, {1e6 * elapsed / found.error.size:.0f} µs each; {failed} failed")
found

# %% [markdown]
# ## Maps
# The upper row is what the cube was made of, the lower row what was found in it.

# %%
figure, rows = plt.subplots(2, 2, figsize=(10, 6), sharex=True, sharey=True, layout="constrained")
for column, (what, maps) in enumerate(
    {
        "σa (mm$^{-1}$)": (sigma_a, found.sigma_a_per_mm.values),
        "σs′ (mm$^{-1}$)": (sigma_s_prime, found.sigma_s_prime_per_mm.values),
    }.items()
):
    low, high = maps[0].min(), maps[0].max()
    for row, (name, values) in enumerate(zip(("true", "found"), maps)):
        image = rows[row, column].pcolormesh(
            position_mm, wavelength_nm, values.T, vmin=low, vmax=high, cmap=("magma", "viridis")[column]
        )
        rows[row, column].set_title(f"{what.split()[0]}, {name}")
    figure.colorbar(image, ax=rows[:, column], label=what)
for axes in rows[1]:
    axes.set_xlabel("position (mm)")
for axes in rows[:, 0]:
    axes.set_ylabel("wavelength (nm)")
figure.savefig(folder / "maps.png", dpi=120)

pulls = np.stack([
    (found.sigma_a_per_mm - sigma_a) / found.u_sigma_a_per_mm,
    (found.sigma_s_prime_per_mm - sigma_s_prime) / found.u_sigma_s_prime_per_mm,
])
print("(found − true)/u: mean", pulls.mean().round(3), "standard deviation", pulls.std().round(3))
assert failed == 0
assert abs(pulls.mean()) < 0.1 and 0.9 < pulls.std() < 1.1

# %% [markdown]
# ## Spectra, and the pigments in them
# With a standard uncertainty on every number the rest is linear least squares: σa of a position is gray plus the pigments'
# spectra times their amounts.

# %%
spectra = np.column_stack([np.ones_like(wavelength_nm), *pigments])
solved, u_solved = [], []
for values, u_values in zip(found.sigma_a_per_mm.values, found.u_sigma_a_per_mm.values):
    weighted = spectra / u_values[:, None]
    covariance = np.linalg.inv(weighted.T @ weighted)
    solved.append(covariance @ weighted.T @ (values / u_values))
    u_solved.append(np.sqrt(np.diag(covariance)))
solved, u_solved = np.array(solved), np.array(u_solved)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for k, color in zip((5, 30, 55), ("tab:blue", "tab:red", "tab:green")):
    here = found.isel(position_mm=k)
    left.errorbar(
        wavelength_nm, here.sigma_a_per_mm, here.u_sigma_a_per_mm, fmt=".", ms=4, color=color,
        label=f"at {position_mm[k]:.1f} mm",
    )
    left.plot(wavelength_nm, sigma_a[k], color=color, lw=1)
left.set_xlabel("wavelength (nm)")
left.set_ylabel("σa (mm$^{-1}$)")
left.legend()
for k, (name, color) in enumerate((("first pigment", "tab:red"), ("second pigment", "tab:blue"))):
    right.errorbar(position_mm, solved[:, k + 1], u_solved[:, k + 1], fmt=".", ms=4, color=color, label=name)
    right.plot(position_mm, amounts[:, k], color=color, lw=1)
right.set_xlabel("position (mm)")
right.set_ylabel("amount (mm$^{-1}$ at its peak)")
right.set_title("lines: true; points: found ± u")
right.legend()
figure.savefig(folder / "spectra.png", dpi=120)
error = np.abs(solved[:, 1:] - amounts) / u_solved[:, 1:]
assert error.max() < 5, error.max()
