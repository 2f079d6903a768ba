"""Cubes with labels: xarray in, xarray out, in chunks or not, with the numbers of plain arrays."""

import subprocess
import sys

import numpy as np
import pytest

import beamspot
from conftest import refused

xarray = pytest.importorskip("xarray")

RADII = np.geomspace(0.5, 20.0, 40)
WAVELENGTHS = np.array([450.0, 550.0, 650.0])
LINES = 7
SIGMA_A = np.array([0.02, 0.01, 0.004])
ETA = np.array([1.40, 1.39, 1.38])
PLAIN = {"constraint": "none", "discrepancy": False}


@pytest.fixture(scope="module")
def cube():
    """(wavelength, line, radius), stored with the radii first, as a spectrograph may have it."""
    rng = np.random.default_rng(1)
    values = np.empty((len(WAVELENGTHS), LINES, len(RADII)))
    for k, (sigma_a, eta) in enumerate(zip(SIGMA_A, ETA)):
        clean = beamspot.dipole(RADII, sigma_s_prime=1.5, sigma_a=sigma_a, eta=eta)
        values[k] = clean * (1 + 1e-3 * rng.standard_normal((LINES, len(RADII))))
    values[1, 2, 5] = np.nan
    cube = xarray.DataArray(
        values,
        dims=("wavelength_nm", "line", "radius_mm"),
        coords={
            "radius_mm": ("radius_mm", RADII, {"units": "mm"}),
            "wavelength_nm": ("wavelength_nm", WAVELENGTHS, {"units": "nm"}),
            "position_mm": ("line", np.arange(LINES) * 0.1),
        },
        attrs={"units": "mm-2"},
    )
    return cube.transpose("radius_mm", "wavelength_nm", "line")


@pytest.fixture(scope="module")
def u(cube):
    return 1e-3 * np.abs(cube).mean(["line", "wavelength_nm"]).rename("u")


def test_a_cube_comes_back_with_its_labels_and_the_numbers_of_plain_arrays(cube, u):
    found = beamspot.fit_many(cube.radius_mm, cube, u, eta=1.4, **PLAIN)
    rows = cube.transpose("wavelength_nm", "line", "radius_mm").values.reshape(-1, len(RADII))
    plain = beamspot.fit_many(RADII, rows, u.values, eta=1.4, **PLAIN)
    assert found.sigma_a_per_mm.dims == ("wavelength_nm", "line")
    for name in ("sigma_a_per_mm", "u_sigma_s_prime_per_mm", "share_outside"):
        assert np.array_equal(found[name].values.ravel(), getattr(plain, name), equal_nan=True)
        assert found[name].attrs["units"] == ("1" if name == "share_outside" else "mm-1")
    assert found.wavelength_nm.attrs == {"units": "nm"} and "radius_mm" not in found.coords
    assert np.array_equal(found.position_mm, cube.position_mm)
    # The profile with a hole in it says why it has no numbers, and stops no other.
    bad = found.isel(wavelength_nm=1, line=2)
    assert np.isnan(bad.sigma_a_per_mm) and bad.termination == -1 and "NaN" in str(bad.error.item())
    assert (found.termination == 0).sum() == found.termination.size - 1
    assert found.attrs["eta"] == 1.4 and beamspot.__version__ in found.attrs["source"]
    assert found.to_dict()["attrs"]["constraint"] == "none"


def test_index_and_total_may_differ_by_wavelength(cube, u):
    eta = xarray.DataArray(ETA, dims="wavelength_nm")
    total = [beamspot.total_reflectance(sigma_s_prime=1.5, sigma_a=a, eta=e) for a, e in zip(SIGMA_A, ETA)]
    total = xarray.DataArray(total, coords={"wavelength_nm": cube.wavelength_nm})
    options = {"u_scale": 1e-3, "entry_loss": False, "discrepancy": False}
    found = beamspot.fit_many(RADII, cube, u, eta=eta, total=total, u_total=1e-4, **options)
    pull = (found.sigma_a_per_mm - xarray.DataArray(SIGMA_A, dims="wavelength_nm")) / found.u_sigma_a_per_mm
    assert abs(pull.mean()) < 1 and 0.5 < pull.std() < 2
    for k, e in enumerate(ETA):
        row = cube.isel(wavelength_nm=k, line=0)
        plain = {"total": float(total[k]), "u_total": 1e-4, "eta": e, **options}
        one = beamspot.fit(RADII, row, u, **plain)
        assert found.sigma_a_per_mm[k, 0] == one.sigma_a_per_mm.value
    assert "eta" not in found.attrs


def test_chunks_are_fitted_when_asked_for_and_change_nothing(cube, u):
    pytest.importorskip("dask")
    whole = beamspot.fit_many(RADII, cube, u, eta=1.4, **PLAIN)
    chunked = cube.chunk({"line": 3, "wavelength_nm": 2, "radius_mm": 11})
    lazy = beamspot.fit_many(chunked.radius_mm, chunked, u.chunk(), eta=1.4, **PLAIN)
    assert lazy.sigma_a_per_mm.chunks == ((2, 1), (3, 3, 1))
    # Texts that a Zarr file takes as they come, which it does not of objects.
    assert lazy.error.dtype == whole.error.dtype == np.dtypes.StringDType()
    assert lazy.compute(scheduler="synchronous").identical(whole)


def test_what_does_not_belong_together_is_named(cube, u):
    fit = lambda radii, cube, u=u, **more: beamspot.fit_many(radii, cube, u, **{"eta": 1.4, **PLAIN, **more})
    in_cm = cube.assign_coords(radius_mm=("radius_mm", RADII / 10, {"units": "cm"}))
    with refused("radius_mm: expected numbers in mm, got units = 'cm'"):
        fit(in_cm.radius_mm, in_cm)
    with refused("reflectance_per_mm2: expected numbers in mm-2, got units = 'cm-2'"):
        fit(RADII, cube.assign_attrs(units="cm-2"))
    with refused("radius_mm: expected a coordinate along one of the dimensions", "got .'r',."):
        fit(xarray.DataArray(RADII, dims="r"), cube)
    with refused("one of these called 'radius_mm'"):
        fit(RADII, cube.rename(radius_mm="r"))
    with refused("radius_mm: expected as many numbers", r"\(40\), got \(39,\)"):
        fit(RADII[1:], cube)
    with refused("u: expected an array of shape", r"got \(3,\)"):
        fit(RADII, cube, u.values[:3])
    with refused("u: has dimensions .'depth'."):
        fit(RADII, cube, u.expand_dims(depth=2))
    with refused("wavelength_nm"):
        other = xarray.DataArray(ETA, coords={"wavelength_nm": WAVELENGTHS + 1})
        fit(RADII, cube, eta=other)
    with pytest.raises(TypeError, match="modell"):
        fit(RADII, cube.chunk(), modell="dipole")
    with pytest.raises(TypeError, match="eta"):
        beamspot.fit_many(RADII, cube, u)


def test_the_import_brings_neither_xarray_nor_dask():
    code = "import sys, beamspot; print([m for m in ('xarray', 'pandas', 'dask', 'distributed') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
