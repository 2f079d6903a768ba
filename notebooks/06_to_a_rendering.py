# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # From a photograph to a rendering
#
# The whole way: photographs of a beam on skin, its coefficients, a material for Mitsuba 3, and a picture. Besides the
# module it takes the command `beamspot` (on the path, or named by the variable `BEAMSPOT_BIN`) and `pip install
# mitsuba`.

# %%
import os
import subprocess
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import mitsuba
import numpy as np

import beamspot

BEAMSPOT = os.environ.get("BEAMSPOT_BIN", "beamspot")
folder = Path(tempfile.mkdtemp())

# %% [markdown]
# ## Photographs
# A synthetic camera stands in for a real one: 128 × 128 pixels, two sets of exposures with darks and a white
# reference, as 16-bit TIFF files. `capture.toml` says what they are. If you have a capture of your own, leave this cell
# out, and put its path into the next one.

# %%
(folder / "camera.toml").write_text("width = 128\nheight = 128\nmm_per_pixel = 0.2\nbeam_fwhm_mm = 0.5\n")
subprocess.run(
    [BEAMSPOT, "synth", "--material", "skin1", "--camera", "camera.toml", "--seed", "6", "-o", "capture"],
    cwd=folder, check=True, capture_output=True,
)

# %% [markdown]
# ## Coefficients
# `measure` does the whole job, and `write` leaves the tables and a report behind, as the command does.

# %%
measurement = beamspot.measure(folder / "capture/capture.toml", confirm=False)
measurement.write(folder / "result")
table = beamspot.materials("skin1")
print(f"{'':8}{'σs′ (mm⁻¹)':>22}{'true':>8}{'σa (mm⁻¹)':>24}{'true':>8}")
for fit, true in zip(measurement.fits, table):
    s, a = fit.sigma_s_prime_per_mm, fit.sigma_a_per_mm
    print(
        f"{fit.channel:8}{s.value:14.4f} ± {s.u:.4f}{true.sigma_s_prime_per_mm:8.2f}"
        f"{a.value:16.5f} ± {a.u:.5f}{true.sigma_a_per_mm:8.3f}"
    )
    assert abs(s.value / true.sigma_s_prime_per_mm - 1) < 0.05
    assert abs(a.value / true.sigma_a_per_mm - 1) < 0.05

# %% [markdown]
# ## A material for Mitsuba
# A renderer wants to know how long a unit of its scene is; nothing guesses it. Here it is a centimetre. The file
# says at its head what its numbers are.

# %%
subprocess.run(
    [BEAMSPOT, "table", "convert", "result/materials.csv", "--to", "mitsuba", "--scene-unit-mm", "10", "-o", "skin.xml"],
    cwd=folder, check=True, capture_output=True,
)
material = (folder / "skin.xml").read_text(encoding="utf-8")
print("\n".join(line[:110] for line in material.splitlines()[:14]), "\n…")

# %% [markdown]
# ## Two pictures
# Balls of 3 mm and of 60 mm under the same lamp, a soft box at the upper left. The small one lets light through and
# glows from within; the large one is a solid with a dark side. No colour of a surface can do that, which is why
# σa and σs′ are worth measuring. A hundred paths for each pixel leave the noise that is seen here; `samples=2000` draws them
# smooth.

# %%
mitsuba.set_variant("scalar_rgb")


def picture(diameter_mm, samples=110, pixels=56):
    """A ball of that size and a lamp at the upper left; every length grows with it."""
    radius = diameter_mm / 20
    scene = mitsuba.load_string(
        f"""<scene version="3.0.0">
            <include filename="{folder / 'skin.xml'}"/>
            <integrator type="volpathmis"><integer name="max_depth" value="400"/></integrator>
            <sensor type="perspective">
                <float name="fov" value="23"/>
                <transform name="to_world">
                    <lookat origin="0, {-6 * radius}, {1.5 * radius}" target="0, 0, 0" up="0, 0, 1"/>
                </transform>
                <sampler type="independent"><integer name="sample_count" value="{samples}"/></sampler>
                <film type="hdrfilm">
                    <integer name="width" value="{pixels}"/><integer name="height" value="{pixels}"/>
                </film>
            </sensor>
            <emitter type="constant"><float name="radiance" value="0.08"/></emitter>
            <shape type="rectangle">
                <transform name="to_world">
                    <scale value="{4 * radius}"/>
                    <lookat origin="{-5 * radius}, {-1 * radius}, {4 * radius}" target="0, 0, 0" up="0, 0, 1"/>
                </transform>
                <emitter type="area"><float name="radiance" value="2"/></emitter>
            </shape>
            <shape type="sphere">
                <float name="radius" value="{radius}"/>
                <ref id="Skin1"/><ref name="interior" id="Skin1_medium"/>
            </shape>
        </scene>"""
    )
    return np.array(mitsuba.render(scene, seed=1), dtype=float)[..., :3]


def developed(radiance, exposure=1.0):
    """Through the curve of sRGB."""
    light = np.clip(exposure * radiance, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


figure, panels = plt.subplots(1, 2, figsize=(9, 4.7), layout="constrained")
for axes, diameter_mm in zip(panels, (3, 60)):
    radiance = picture(diameter_mm)
    axes.imshow(developed(radiance, exposure=1.8), interpolation="bilinear")
    axes.set_title(f"a ball of {diameter_mm} mm")
    axes.axis("off")
figure.savefig(folder / "balls.png", dpi=120)
