"""Absorption and scattering of translucent materials from photographs of a beam spot.

The same functions that the command `beamspot` calls, on NumPy arrays: `measure` a capture, `batch`
many, or go step by step with `merge`, `radial_profile` and `fit`; `fit_many` for spectral cubes,
with labels (xarray) or without; `simulate` photons; `dipole` and its siblings; `materials` for the
table that ships. `beamspot.distributed` does the long ones on many machines. Lengths are mm,
coefficients mm^-1, R_d(r) mm^-2; "u" is a standard uncertainty.
"""

from ._beamspot import (
    Batch,
    Estimate,
    Fit,
    FitMany,
    Material,
    Measurement,
    Profile,
    Radiance,
    Simulation,
    __version__,
    batch,
    better_dipole,
    dipole,
    directional,
    fit,
    kienle_patterson,
    materials,
    measure,
    merge,
    monte_carlo,
    multipole,
    photon_beam_diffusion,
    radial_profile,
    read_medium,
    simulate,
    total_reflectance,
)
from ._cubes import fit_many

__all__ = [
    "Batch",
    "Estimate",
    "Fit",
    "FitMany",
    "Material",
    "Measurement",
    "Profile",
    "Radiance",
    "Simulation",
    "__version__",
    "batch",
    "better_dipole",
    "dipole",
    "directional",
    "fit",
    "fit_many",
    "kienle_patterson",
    "materials",
    "measure",
    "merge",
    "monte_carlo",
    "multipole",
    "photon_beam_diffusion",
    "radial_profile",
    "read_medium",
    "simulate",
    "total_reflectance",
]
