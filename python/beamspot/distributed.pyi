from collections.abc import Sequence
from os import PathLike
from typing import Any

from distributed import Client
from numpy.typing import ArrayLike
from xarray import DataArray, Dataset

from . import Batch, Simulation

__all__ = ["batch", "fit_many", "simulate"]

def fit_many(
    radius_mm: DataArray | ArrayLike,
    reflectance_per_mm2: DataArray,
    u: DataArray | ArrayLike | None = None,
    *,
    client: Client | None = None,
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
def simulate(
    medium: str | PathLike[str] | dict[str, Any],
    photons: float = 1e6,
    seed: int = 1,
    *,
    simd: str | None = None,
    client: Client | None = None,
    parts: int | None = None,
    retries: int = 2,
) -> Simulation: ...
def batch(
    captures: str | PathLike[str] | Sequence[str | PathLike[str]],
    folder: str | PathLike[str],
    *,
    client: Client | None = None,
    retries: int = 2,
    resume: bool = False,
    force: bool = False,
    model: str = "dipole",
    constraint: str = "joint",
    g: float | None = None,
    range_mm: tuple[float, float] | None = None,
    confirm: bool = True,
    bootstrap: int = 0,
) -> Batch: ...
