# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # Closed forms against counted photons
#
# The dipole and its successors are approximations of the transport of light. How good they are depends on
# two things: how far from the beam one looks, measured in transport mean free paths 1/σt′, and how much the
# medium absorbs. This notebook lays them over photons that were counted one by one, and over the transport
# equation, which says without noise what the photons say.

# %%
import tempfile
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import beamspot

folder = Path(tempfile.mkdtemp())
eta = 1.4
entry = 1 - ((eta - 1) / (eta + 1)) ** 2
media = {"bright, α′ = 0.998": 0.998, "like skin, α′ = 0.95": 0.95, "dark, α′ = 0.7": 0.7}
models = {
    "dipole": (beamspot.dipole, "tab:red"),
    "better dipole": (beamspot.better_dipole, "tab:blue"),
    "Kienle-Patterson": (beamspot.kienle_patterson, "tab:purple"),
    "photon beam diffusion": (lambda r, **medium: beamspot.photon_beam_diffusion(r, g=0.0, **medium), "tab:orange"),
}


def coefficients(albedo):
    """A medium with σt′ = 1 mm⁻¹, so that a millimetre is a transport mean free path."""
    return {"sigma_s_prime": albedo, "sigma_a": 1 - albedo, "eta": eta}


# %% [markdown]
# ## Photons
# A pencil beam along the normal, 200,000 photons for each medium. `simulate` counts per photon that arrives,
# the specular part left out; the closed forms are per photon that *enters*. Division by 1 − R_specular makes
# the one the other.

# %%
radius_mm = np.geomspace(0.05, 12, 200)
counted = {}
for name, albedo in media.items():
    layer = {"sigma_a_per_mm": 1 - albedo, "sigma_s_per_mm": albedo, "g": 0.0, "eta": eta}
    run = beamspot.simulate(
        {"layer": [layer], "beam": {"kind": "pencil"}, "tally": {"r_max_mm": 12.0, "r_bins": 60}},
        photons=2e5, seed=3,
    )
    counted[name] = run.radius_mm, run.reflectance_per_mm2 / entry, run.u_reflectance_per_mm2 / entry

figure, columns = plt.subplots(
    2, 3, figsize=(11, 7), sharex=True, sharey="row", height_ratios=[3, 2], layout="constrained"
)
worst = {}
for (name, albedo), (top, bottom) in zip(media.items(), columns.T):
    medium = coefficients(albedo)
    transport = beamspot.monte_carlo(radius_mm, g=0.0, **medium)
    r, seen, u = counted[name]
    true = beamspot.monte_carlo(r, g=0.0, **medium)
    # Over the two innermost rings R_d falls manyfold; far out a few heavy photons are all there is.
    clear = (r > 0.4) & (u < 0.1 * true)
    top.errorbar(r[clear], seen[clear], u[clear], fmt=".", ms=4, color="0.45", label="photons", zorder=3)
    top.loglog(radius_mm, transport, color="black", lw=1.2, label="transport equation")
    bottom.errorbar(
        r[clear], 100 * (seen / true - 1)[clear], 100 * (u / true)[clear], fmt=".", ms=4, color="0.45"
    )
    for label, (model, color) in models.items():
        values = model(radius_mm, **medium)
        top.loglog(radius_mm, values, color=color, lw=1, label=label)
        deviation = 100 * (values / transport - 1)
        bottom.semilogx(radius_mm, deviation, color=color, lw=1)
        worst[label, albedo] = np.abs(deviation[(radius_mm > 1) & (radius_mm < 8)]).max()
    bottom.axhline(0, color="black", lw=1.2)
    top.set_title(name)
    bottom.set_xlabel("distance from the beam (1/σt′)")
    bottom.set_xticks([0.1, 1, 10], ["0.1", "1", "10"])
columns[0, 0].set_ylabel("$R_d$ (σt′$^2$)")
columns[0, 0].set_ylim(1e-8, 20)
columns[1, 0].set_ylabel("over transport − 1 (%)")
columns[1, 0].set_ylim(-60, 60)
columns[0, 2].legend(fontsize=8)
figure.savefig(folder / "models.png", dpi=120)

# %% [markdown]
# The photons lie on the transport equation in every medium. Of the closed forms none does. Within a mean free
# path or two of the beam, light has scattered too few times to have forgotten where it came from, and most are off
# by tens of percent. Farther out a bright medium lets them come within ten percent; in a dark one the dipole never
# gets there. Photon beam diffusion, which adds the light that scattered once, follows transport's shape best.

# %%
print("largest error between 1 and 8 mean free paths (%)")
print(f"{'':24}" + "".join(f"{f'α′ = {albedo}':>12}" for albedo in media.values()))
for label in models:
    print(f"{label:24}" + "".join(f"{worst[label, albedo]:12.0f}" for albedo in media.values()))

# %% [markdown]
# ## What that does to a measurement
# A profile as transport makes it, with a permille of noise, fitted by each model. If a model's error is not
# thought of, its coefficients are off by many times the uncertainty that noise alone gives (open marks). With
# `discrepancy=True`, the default, the fit carries along how far the model may be off: the bars grow until
# they tell the truth (filled marks).

# %%
data_mm = np.geomspace(3, 15, 60)
medium = coefficients(0.98)
rng = np.random.default_rng(4)
profile = beamspot.monte_carlo(data_mm, g=0.0, **medium)
u = 1e-3 * profile
profile = profile + u * rng.standard_normal(len(u))
names = ["dipole", "better-dipole", "kienle-patterson", "photon-beam-diffusion", "monte-carlo"]

figure, panels = plt.subplots(1, 2, figsize=(10, 3.8), sharey=True, layout="constrained")
pulls = {}
for row, name in enumerate(names):
    for discrepancy, style in ((False, {"mfc": "white"}), (True, {})):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = beamspot.fit(
                data_mm, profile, u, eta=eta, model=name, constraint="none", entry_loss=False,
                g=0.0 if name in ("photon-beam-diffusion", "monte-carlo") else None, discrepancy=discrepancy,
            )
        for axes, estimate, true in (
            (panels[0], found.sigma_s_prime_per_mm, medium["sigma_s_prime"]),
            (panels[1], found.sigma_a_per_mm, medium["sigma_a"]),
        ):
            color = "black" if name == "monte-carlo" else "tab:red"
            axes.errorbar(
                100 * (estimate.value / true - 1), row + (0.12 if discrepancy else -0.12),
                xerr=100 * 1.96 * estimate.u / true, fmt="o", ms=5, color=color, capsize=3, **style,
            )
            pulls[name, discrepancy] = max(
                abs(estimate.value - true) / estimate.u, pulls.get((name, discrepancy), 0)
            )
for axes, what in zip(panels, ("σs′", "σa")):
    axes.axvline(0, color="black", lw=0.8)
    axes.set_xlabel(f"error of {what} (%), with 95 % interval")
panels[0].set_yticks(range(len(names)), names)
panels[0].invert_yaxis()
panels[1].plot([], [], "o", color="tab:red", mfc="white", label="model taken as true")
panels[1].plot([], [], "o", color="tab:red", label="its error carried along")
figure.legend(*panels[1].get_legend_handles_labels(), loc="outside upper center", ncols=2)
figure.savefig(folder / "fits.png", dpi=120)
assert pulls["dipole", False] > 5 and pulls["monte-carlo", True] < 3

# %% [markdown]
# Transport itself (`model="monte-carlo"`) has nothing to carry along. It is as fast as the closed forms, since a
# table holds it, so that it is the model to take on a real material.
