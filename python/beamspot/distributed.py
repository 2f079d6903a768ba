"""The long work of beamspot on many machines, by Dask's scheduler (`pip install beamspot[distributed]`).

`fit_many` over the chunks of a cube, `simulate` over blocks of photons, `batch` over captures. Each
gives what the function of that name in `beamspot` gives, byte for byte, however many workers there
are and whichever of them dies: a task depends on what it was told and on nothing else, so that Dask
may do it again elsewhere. One task takes one thread of a worker; retries of tasks, lost workers and
the dashboard are Dask's own.

`client`: a `distributed.Client`; the current one where left out. Every worker, and the scheduler,
needs the same version of beamspot, which is looked at first; RuntimeError names those that have not.
"""

import functools
import inspect
import os

import distributed

import beamspot

from . import _beamspot
from ._cubes import Options

__all__ = ["batch", "fit_many", "simulate"]

# Tasks for each thread: enough that none waits long for the last, few enough to cost nothing.
_TASKS = 8


def _checked(client):
    """A client whose scheduler and workers have this version of beamspot."""
    if client is None:
        try:
            client = distributed.default_client()
        except ValueError:
            raise ValueError(
                "client: there is none; make one with distributed.Client(), which starts workers on "
                "this machine, or with the address of a scheduler"
            ) from None
    found = client.get_versions(packages=["beamspot"])
    places = {"the scheduler": found["scheduler"], **found["workers"]}
    wanted = found["client"]["packages"]["beamspot"]
    wrong = []
    for place, said in places.items():
        has = (said or {}).get("packages", {}).get("beamspot")
        if has != wanted:
            wrong.append(f"{place} has {has or 'none'}")
    if wrong:
        raise RuntimeError(_needed("; ".join(wrong)))
    return client


def _needed(found):
    return (
        f"beamspot {beamspot.__version__} is needed on the scheduler and on every worker: {found}; "
        "install it there and start them again"
    )


def _results(client, futures):
    """Results as they come; whatever happens, nothing is left running."""
    try:
        for batch in distributed.as_completed(futures, with_results=True).batches():
            yield from batch
    except ModuleNotFoundError as error:
        # A worker that came after the check.
        if (error.name or "").partition(".")[0] == "beamspot":
            raise RuntimeError(_needed(f"a worker has none ({error})")) from error
        raise
    finally:
        client.cancel(futures)


def fit_many(radius_mm, reflectance_per_mm2, u=None, *, client=None, **options):
    """Fits a cube of profiles, chunk by chunk, when the answer is asked for.

    `reflectance_per_mm2`: an `xarray.DataArray` with a dimension of radii and any others, in chunks
    or not; everything else as for `beamspot.fit_many`. Gives an `xarray.Dataset` in chunks: nothing
    is done before `.compute()`, `.persist()` or `.to_zarr(...)`, which are Dask's and take its
    keywords (`retries=3`). The memory of a worker is that of one chunk and its answer for each of
    its threads, so that a cube may be larger than the memory of all.
    """
    cube = reflectance_per_mm2
    if not hasattr(cube, "dims") or not hasattr(cube, "chunk"):
        raise ValueError(
            f"reflectance_per_mm2: expected an xarray.DataArray, got {type(cube).__name__}; "
            "beamspot.fit_many takes arrays without labels"
        )
    _checked(client)
    if cube.chunks is None:
        dimension = getattr(radius_mm, "dims", ("radius_mm",))[0]
        cube = cube.chunk({d: -1 if d == dimension else "auto" for d in cube.dims})
    return beamspot.fit_many(radius_mm, cube, u, **options)


def _photons(part, medium, photons, seed, options):
    return beamspot.simulate(medium, photons, seed, part=part, threads=1, **options)


def simulate(medium, photons=1e6, seed=1, *, simd=None, client=None, parts=None, retries=2):
    """Follows photons through layers on all workers, with the bytes of `beamspot.simulate`.

    `medium`, `photons`, `seed`: as there. `simd`: the instruction path, which is part of the answer;
    the fastest of this machine where left out, and a worker without it says so. `parts`: how many
    tasks, which the answer does not depend on; eight for each thread where left out. `retries`: how
    often a task that failed is tried again.
    """
    client = _checked(client)
    options = Options(simd=simd or _beamspot.fastest_simd())
    if parts is None:
        parts = _TASKS * max(1, sum(client.nthreads().values()))
    elif parts < 1:
        raise ValueError(f"parts: expected a number of at least 1, got {parts}")
    # What is wrong with it is said here; and workers need not see the file.
    medium = beamspot.read_medium(medium)
    work = functools.partial(_photons, medium=medium, photons=photons, seed=seed, options=options)
    futures = client.map(
        work, [(k, parts) for k in range(parts)], key="beamspot-simulate", pure=False, retries=retries
    )
    found = None
    for future, part in _results(client, futures):
        found = part if found is None else found + part
        future.release()
    return found


def _measured(capture, folder, options):
    return _beamspot.measure_one(*capture, folder, options)


def batch(captures, folder, *, client=None, retries=2, **options):
    """Measures many captures on all workers, and leaves the files of `beamspot.batch`.

    `captures`, `folder` and the other keywords: as there. Captures and `folder` are on a disk that
    all machines see under the same name. A capture that fails is a row of status.csv and stops no
    other; a worker that dies costs its capture's time and nothing else. `retries`: how often a task
    is tried again that failed for another reason than its capture.
    """
    chosen = inspect.signature(beamspot.batch).bind(captures, folder, **options)
    chosen.apply_defaults()
    chosen = Options(chosen.arguments)
    captures, folder = chosen.pop("captures"), os.path.abspath(chosen.pop("folder"))
    client = _checked(client)
    opened = _beamspot.open_batch(captures, folder, chosen)
    work = functools.partial(_measured, folder=folder, options=chosen)
    futures = client.map(
        work, opened.captures, key="beamspot-measure", pure=False, retries=retries
    )
    reports = {future.key: report for future, report in _results(client, futures)}
    return opened.finish([reports[future.key] for future in futures])
