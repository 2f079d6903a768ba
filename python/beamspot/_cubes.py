"""`fit_many` of labelled arrays: xarray in, xarray out. xarray is imported where one comes in."""

import functools
import inspect

import numpy as np

from . import _beamspot

# Name, unit and long name of each quantity of a Dataset.
_QUANTITIES = {
    "sigma_a_per_mm": ("mm-1", "absorption coefficient"),
    "u_sigma_a_per_mm": ("mm-1", "standard uncertainty of sigma_a_per_mm"),
    "sigma_a_low_per_mm": ("mm-1", "lower end of the 95 % interval of sigma_a_per_mm"),
    "sigma_a_high_per_mm": ("mm-1", "upper end of the 95 % interval of sigma_a_per_mm"),
    "sigma_s_prime_per_mm": ("mm-1", "reduced scattering coefficient"),
    "u_sigma_s_prime_per_mm": ("mm-1", "standard uncertainty of sigma_s_prime_per_mm"),
    "sigma_s_prime_low_per_mm": ("mm-1", "lower end of the 95 % interval of sigma_s_prime_per_mm"),
    "sigma_s_prime_high_per_mm": ("mm-1", "upper end of the 95 % interval of sigma_s_prime_per_mm"),
    "correlation": ("1", "correlation of the errors of both coefficients"),
    "scale": ("1", "factor that the shared scale was found to be off by"),
    "reduced_chi2": ("1", "chi-squared per degree of freedom"),
    "share_outside": ("1", "share of the light that leaves beyond the last radius"),
}
# Texts of any length that cost little where they are empty, and that Zarr takes chunk by chunk; NumPy 1 has none.
_TEXT = np.dtypes.StringDType() if hasattr(np.dtypes, "StringDType") else np.dtype(object)
_TERMINATIONS = {None: -1, "converged": 0, "at_bound": 1, "out_of_evaluations": 2}
# Spellings of the units that coordinates and values must be in, where they say one.
_MM = ("mm", "millimeter", "millimeters", "millimetre", "millimetres")
_PER_MM2 = ("mm-2", "mm^-2", "mm**-2", "1/mm2", "1/mm^2", "1/mm**2", "mm⁻²", "1 / millimeter ** 2")


class Options(dict):
    """Keyword arguments on their way to another process: they say which version wrote them."""

    def __reduce__(self):
        return _opened, (_beamspot.__version__, dict(self))


def _opened(version, options):
    if version != _beamspot.__version__:
        raise RuntimeError(
            f"these options were pickled by beamspot {version}, and this process has "
            f"{_beamspot.__version__}: install the same version on both sides"
        )
    return Options(options)


@functools.wraps(_beamspot.fit_many)
def fit_many(radius_mm, reflectance_per_mm2, u=None, **options):
    # What has labels is xarray's; to ask it for its type would mean to import it.
    if hasattr(reflectance_per_mm2, "dims") and hasattr(reflectance_per_mm2, "coords"):
        return _fit_labelled(radius_mm, reflectance_per_mm2, u, **options)
    return _beamspot.fit_many(radius_mm, reflectance_per_mm2, u, **options)


def _in_unit(name, array, expected):
    unit = getattr(array, "attrs", {}).get("units")
    if unit is not None and str(unit) not in expected:
        raise ValueError(
            f"{name}: expected numbers in {expected[0]}, got units = {unit!r}: convert them first"
        )


def _radius_dimension(radius_mm, cube):
    """Along which dimension the radii lie."""
    found = getattr(radius_mm, "dims", ("radius_mm",))
    if len(found) != 1 or found[0] not in cube.dims:
        raise ValueError(
            f"radius_mm: expected a coordinate along one of the dimensions {cube.dims} of "
            f"reflectance_per_mm2, or one of these called 'radius_mm', got {found}"
        )
    return found[0]


def _fit_labelled(radius_mm, cube, u=None, **options):
    import xarray

    dimension = _radius_dimension(radius_mm, cube)
    _in_unit("radius_mm", radius_mm, _MM)
    if dimension in cube.coords:
        _in_unit("radius_mm", cube[dimension], _MM)
    _in_unit("reflectance_per_mm2", cube, _PER_MM2)
    radii = np.asarray(radius_mm)
    if radii.shape != (cube.sizes[dimension],):
        raise ValueError(
            f"radius_mm: expected as many numbers as there are along {dimension!r} "
            f"({cube.sizes[dimension]}), got {radii.shape}"
        )
    # Words that it does not know, before anything is put off.
    inspect.signature(fit_many).bind(radius_mm, cube, u, **options)
    over = [d for d in cube.dims if d != dimension]

    def labelled(name, value, dims):
        """As an array with labels, whose unit is right and whose labels are known."""
        if not hasattr(value, "dims"):
            value = np.asarray(value)
            if value.ndim == 1 and len(dims) > 1 and dims[-1] == dimension:
                dims = [dimension]
            if value.ndim == 0:
                dims = []
            sizes = tuple(cube.sizes[d] for d in dims)
            if value.shape != sizes:
                raise ValueError(f"{name}: expected an array of shape {sizes} over {dims}, got {value.shape}")
            return xarray.DataArray(value, dims=dims)
        if extra := set(value.dims) - set(dims):
            raise ValueError(f"{name}: has dimensions {sorted(map(str, extra))} that reflectance_per_mm2 has not")
        return value

    given, places = {}, {"reflectance_per_mm2": [dimension]}
    arrays = [cube]
    if u is not None:
        u = labelled("u", u, [*over, dimension])
        _in_unit("u", u, _PER_MM2)
        if dimension not in u.dims:
            u = u.expand_dims({dimension: cube.sizes[dimension]}, axis=-1)
        arrays.append(u)
        places["u"] = [dimension]
    for name in ("total", "u_total", "eta", "g"):
        if options.get(name) is None:
            continue
        value = options.pop(name)
        if name in ("eta", "g") and not hasattr(value, "dims"):
            given[name] = value
            continue
        arrays.append(labelled(name, value, over))
        places[name] = []
    chunked = any(a.chunks is not None for a in arrays)
    if chunked:
        # A block needs all of its radii, and shares the machine with others.
        arrays = [a.chunk({dimension: -1}) if dimension in a.dims and a.chunks else a for a in arrays]
        options.setdefault("threads", 1)
    block = functools.partial(
        _fit_block, radii, tuple(places), Options(options | given)
    )
    names = [*_QUANTITIES, "termination", "error"]
    try:
        found = xarray.apply_ufunc(
            block,
            *arrays,
            input_core_dims=list(places.values()),
            output_core_dims=[[]] * len(names),
            join="exact",
            dask="parallelized" if chunked else "forbidden",
            output_dtypes=[np.float64] * len(_QUANTITIES) + [np.int8, _TEXT],
        )
    except ValueError as error:
        if type(error) is ValueError:
            raise
        raise ValueError(f"{', '.join(places)}: {error}") from error
    data = xarray.Dataset(dict(zip(names, found)))
    data = data.transpose(*over)
    for name, (unit, long_name) in _QUANTITIES.items():
        data[name].attrs = {"units": unit, "long_name": long_name}
    data["termination"].attrs = {
        "long_name": "how the search ended",
        "flag_values": np.array([*_TERMINATIONS.values()], dtype=np.int8),
        "flag_meanings": " ".join(str(t or "not_fitted") for t in _TERMINATIONS),
    }
    data["error"].attrs = {"long_name": "why there is no fit, where there is none"}
    for name in data.coords:
        data[name].attrs = dict(cube[name].attrs) if name in cube.coords else data[name].attrs
    plain = {k: v for k, v in (given | options).items() if isinstance(v, (str, int, float)) and k != "threads"}
    data.attrs = {
        "source": f"beamspot {_beamspot.__version__}, fit_many; Jensen et al. (2001), section 3",
        **{k: int(v) if isinstance(v, bool) else v for k, v in plain.items()},
    }
    return data


def _fit_block(radii, places, options, cube, *others):
    """Fits the profiles along the last axis of `cube`; one array for each quantity."""
    shape = cube.shape[:-1]
    rows = np.ascontiguousarray(cube, dtype=np.float64).reshape(-1, cube.shape[-1])
    given = dict(zip(places[1:], others))
    columns = {}
    u = given.pop("u", None)
    if u is not None:
        # One run of points for all of them is looked at as one.
        shared = all(n == 1 for n in u.shape[:-1])
        u = u.reshape(-1) if shared else np.broadcast_to(u, cube.shape).reshape(rows.shape)
    for name, value in given.items():
        columns[name] = np.broadcast_to(value, shape).reshape(-1)
    # What differs from profile to profile, and is one number for a fit of many.
    media = {name: columns.pop(name) for name in ("eta", "g") if name in columns}
    found = [np.full(len(rows), np.nan) for _ in _QUANTITIES]
    termination = np.full(len(rows), _TERMINATIONS[None], dtype=np.int8)
    errors = np.full(len(rows), "", dtype=_TEXT)
    for chosen, medium in _alike(media, len(rows)):
        some = _beamspot.fit_many(
            radii,
            rows[chosen],
            u if u is None or u.ndim == 1 else u[chosen],
            **{name: column[chosen] for name, column in columns.items()},
            **options,
            **medium,
        )
        for column, name in zip(found, _QUANTITIES):
            column[chosen] = getattr(some, name)
        termination[chosen] = [_TERMINATIONS[t] for t in some.termination]
        where = np.arange(len(rows))[chosen]
        for i, error in some.errors.items():
            # Which row it was is said by its place.
            errors[where[i]] = error.removeprefix(f"channel {i}").lstrip(":, ")
    return tuple(a.reshape(shape) for a in (*found, termination, errors))


def _alike(media, count):
    """Which profiles have the same medium, and its numbers."""
    if not media:
        return [(slice(None), {})]
    numbers, which = np.unique(np.stack([*media.values()], axis=1), axis=0, return_inverse=True)
    return [
        (np.flatnonzero(which.reshape(-1) == i), dict(zip(media, map(float, row))))
        for i, row in enumerate(numbers)
    ]
