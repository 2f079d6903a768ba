# Without it pdoc, which runs this file, does not know a class within itself.
from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from xarray import DataArray, Dataset

__version__: str

_Array = NDArray[np.float64]
_Picture = NDArray[np.float32]

@final
class Estimate:
    value: float
    u: float
    ci95: tuple[float, float]
    def __float__(self) -> float: ...

@final
class Fit:
    channel: str
    sigma_a_per_mm: Estimate
    sigma_s_prime_per_mm: Estimate
    g: tuple[float | None, float | None]
    correlation: float
    scale: float
    range_mm: tuple[float, float]
    share_outside: float
    reduced_chi2: float
    termination: str
    upper_limit_per_mm: float | None
    warnings: list[str]
    radius_mm: _Array
    model_per_mm2: _Array
    def to_dict(self) -> dict[str, Any]: ...

@final
class FitMany:
    sigma_a_per_mm: _Array
    u_sigma_a_per_mm: _Array
    sigma_a_low_per_mm: _Array
    sigma_a_high_per_mm: _Array
    sigma_s_prime_per_mm: _Array
    u_sigma_s_prime_per_mm: _Array
    sigma_s_prime_low_per_mm: _Array
    sigma_s_prime_high_per_mm: _Array
    correlation: _Array
    scale: _Array
    reduced_chi2: _Array
    share_outside: _Array
    termination: list[str | None]
    errors: dict[int, str]
    warnings: dict[int, list[str]]
    def __len__(self) -> int: ...

@final
class Material:
    material: str
    channel: str
    wavelength_nm: float | None
    sigma_s_prime_per_mm: float
    u_sigma_s_prime_per_mm: float | None
    sigma_a_per_mm: float
    u_sigma_a_per_mm: float | None
    correlation: float | None
    total_reflectance: float | None
    eta: float
    g: float | None
    model: str
    source: str

@final
class Radiance:
    value: _Picture
    variance: _Picture
    channels: list[str]
    used: list[list[int]]
    hot: list[int]
    saturated_everywhere: list[int]

@final
class Profile:
    channel: str
    radius_mm: _Array
    radius_min_mm: _Array
    radius_max_mm: _Array
    reflectance_per_mm2: _Array
    u_reflectance_per_mm2: _Array
    total_reflectance: float
    u_total_reflectance: float
    total_radius_mm: float | None
    center_px: list[float]
    rejected_pixels: int
    def __len__(self) -> int: ...

@final
class Measurement:
    material: str
    fits: list[Fit]
    profiles: list[Profile]
    materials: list[Material]
    verdicts: list[str]
    warnings: list[str]
    assumptions: list[str]
    def to_dict(self) -> dict[str, Any]: ...
    def write(self, folder: str | PathLike[str], *, force: bool = False) -> None: ...

@final
class Batch:
    captures: list[str]
    materials: list[Material]
    errors: dict[str, str]
    summary: list[str]
    def to_dict(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...

@final
class Simulation:
    photons: int
    totals: dict[str, Any]
    radius_mm: _Array
    reflectance_per_mm2: _Array
    u_reflectance_per_mm2: _Array
    transmittance_per_mm2: _Array
    u_transmittance_per_mm2: _Array
    tables: dict[str, dict[str, _Array]]
    def __add__(self, other: Simulation, /) -> Simulation: ...

def dipole(radius_mm: ArrayLike, *, sigma_s_prime: float, sigma_a: float, eta: float) -> _Array: ...
def better_dipole(
    radius_mm: ArrayLike, *, sigma_s_prime: float, sigma_a: float, eta: float
) -> _Array: ...
def kienle_patterson(
    radius_mm: ArrayLike, *, sigma_s_prime: float, sigma_a: float, eta: float
) -> _Array: ...
def photon_beam_diffusion(
    radius_mm: ArrayLike, *, sigma_s_prime: float, sigma_a: float, eta: float, g: float
) -> _Array: ...
def multipole(
    radius_mm: ArrayLike, *, sigma_s_prime: float, sigma_a: float, eta: float, thickness_mm: float
) -> _Array: ...
def directional(
    radius_mm: ArrayLike, *, sigma_s_prime: float, sigma_a: float, eta: float, angle_deg: float
) -> _Array: ...
def monte_carlo(
    radius_mm: ArrayLike, *, sigma_s_prime: float, sigma_a: float, eta: float, g: float
) -> _Array: ...
def total_reflectance(
    *,
    sigma_s_prime: float,
    sigma_a: float,
    eta: float,
    model: str = "dipole",
    g: float | None = None,
    thickness_mm: float | None = None,
) -> float: ...
def materials(name: str | None = None) -> list[Material]: ...
def fit(
    radius_mm: ArrayLike,
    reflectance_per_mm2: ArrayLike,
    u: ArrayLike | None = None,
    *,
    eta: float,
    total: float | None = None,
    u_total: float | None = None,
    u_scale: float | None = None,
    model: str = "dipole",
    constraint: str = "joint",
    g: float | None = None,
    range_mm: tuple[float, float] | None = None,
    thickness_mm: float | None = None,
    entry_loss: bool = True,
    discrepancy: bool = True,
) -> Fit: ...
@overload
def fit_many(
    radius_mm: DataArray | ArrayLike,
    reflectance_per_mm2: DataArray,
    u: DataArray | ArrayLike | None = None,
    *,
    eta: DataArray | float,
    total: DataArray | ArrayLike | None = None,
    u_total: DataArray | ArrayLike | None = None,
    u_scale: float | None = None,
    model: str = "dipole",
    constraint: str = "joint",
    g: DataArray | float | None = None,
    range_mm: tuple[float, float] | None = None,
    thickness_mm: float | None = None,
    entry_loss: bool = True,
    discrepancy: bool = True,
    threads: int | None = None,
) -> Dataset: ...
@overload
def fit_many(
    radius_mm: ArrayLike,
    reflectance_per_mm2: ArrayLike,
    u: ArrayLike | None = None,
    *,
    eta: float,
    total: ArrayLike | None = None,
    u_total: ArrayLike | None = None,
    u_scale: float | None = None,
    model: str = "dipole",
    constraint: str = "joint",
    g: float | None = None,
    range_mm: tuple[float, float] | None = None,
    thickness_mm: float | None = None,
    entry_loss: bool = True,
    discrepancy: bool = True,
    threads: int | None = None,
) -> FitMany: ...
def merge(
    frames: Sequence[NDArray[Any]],
    exposure_s: Sequence[float],
    dark: Sequence[NDArray[Any]] | None = None,
    *,
    gain_e_per_dn: float,
    read_noise_e: float,
    black_level_dn: float,
    white_level_dn: float,
    prnu_relative: float = 0.003,
) -> Radiance: ...
def radial_profile(
    image: ArrayLike,
    *,
    variance: ArrayLike,
    mm_per_pixel: float,
    factor_per_mm2: float | None = None,
    center_px: tuple[float, float] | None = None,
    relative_width: float = 0.025,
    min_width_px: float = 1.5,
    clip: float = 5.0,
) -> Profile: ...
def simulate(
    medium: str | PathLike[str] | dict[str, Any],
    photons: float = 1e6,
    seed: int = 1,
    *,
    simd: str | None = None,
    part: tuple[int, int] | None = None,
    threads: int | None = None,
) -> Simulation: ...
def read_medium(medium: str | PathLike[str] | dict[str, Any]) -> dict[str, Any]: ...
def measure(
    path: str | PathLike[str],
    *,
    model: str = "dipole",
    constraint: str = "joint",
    g: float | None = None,
    range_mm: tuple[float, float] | None = None,
    confirm: bool = True,
    bootstrap: int = 0,
    threads: int | None = None,
) -> Measurement: ...
def batch(
    captures: str | PathLike[str] | Sequence[str | PathLike[str]],
    folder: str | PathLike[str],
    *,
    resume: bool = False,
    force: bool = False,
    model: str = "dipole",
    constraint: str = "joint",
    g: float | None = None,
    range_mm: tuple[float, float] | None = None,
    confirm: bool = True,
    bootstrap: int = 0,
) -> Batch: ...
