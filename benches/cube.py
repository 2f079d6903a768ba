"""A spectral line scan, wavelengths x lines of profiles, fitted through Dask by one worker and by two.

    pip install '.[distributed]'
    python benches/cube.py [--lines 100000] [--workers 1 2] [--kill]

Prints, beside `beamspot.fit_many` of some of the chunks in a loop in this process, the time and the
speed-up by 1 and 2 workers of one thread each, the peak memory of a worker, and a hash of the means over
the lines, which must be the same for all. `--kill` kills a worker of the last in the middle. The profiles
are made chunk by chunk where they are fitted (the loop makes them as well), so that the cube takes no
memory as a whole: 512 x 100,000 profiles of 16 radii would be 6.6 GB.
"""

import argparse
import hashlib
import os
import resource
import signal
import threading
import time

import dask.array
import distributed
import numpy as np
import xarray

import beamspot
import beamspot.distributed

# Light per power that enters; the closed form itself is the truth.
OPTIONS = {"eta": 1.4, "u_total": 2e-3, "u_scale": 5e-3, "discrepancy": False, "entry_loss": False}
NOISE = 2e-3


def media(wavelengths):
    """Absorption falls with the wavelength."""
    return [{"sigma_a": 0.2 * 0.99**k, "sigma_s_prime": 1.5, "eta": 1.4} for k in wavelengths]


def clean(radii, wavelengths):
    return np.array([beamspot.dipole(radii, **medium) for medium in media(wavelengths)])


def profiles(radii, wavelengths, lines, first):
    """A chunk, with noise of its own."""
    rng = np.random.default_rng(first)
    noise = rng.standard_normal((wavelengths, lines, len(radii)))
    return clean(radii, range(first[0], first[0] + wavelengths))[:, None] * (1 + NOISE * noise)


def block(radii, block_info=None):
    (start, stop), (first, last), _ = block_info[None]["array-location"]
    return profiles(radii, stop - start, last - first, (start, first))


def peak_mb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wavelengths", type=int, default=512)
    parser.add_argument("--lines", type=int, default=100_000)
    parser.add_argument("--radii", type=int, default=16)
    parser.add_argument("--chunk", type=int, nargs=2, default=(8, 12_500))
    parser.add_argument("--workers", type=int, nargs="+", default=(1, 2))
    parser.add_argument("--kill", action="store_true")
    arguments = parser.parse_args()
    radii = np.geomspace(1.0, 15.0, arguments.radii)
    shape = (arguments.wavelengths, arguments.lines, arguments.radii)
    chunks = (*arguments.chunk, arguments.radii)
    made = dask.array.map_blocks(
        block, radii, chunks=dask.array.core.normalize_chunks(chunks, shape), dtype=float, meta=np.empty((0, 0, 0))
    )
    dims = ("wavelength_nm", "line", "radius_mm")
    cube = xarray.DataArray(made, dims=dims)
    u = xarray.DataArray(NOISE * clean(radii, range(shape[0])), dims=(dims[0], dims[2]))
    total = [beamspot.total_reflectance(**medium) for medium in media(range(shape[0]))]
    total = xarray.DataArray(total, dims=dims[0])
    count = shape[0] * shape[1]

    def means(client):
        fits = beamspot.distributed.fit_many(radii, cube, u, total=total, client=client, **OPTIONS)
        found = fits[["sigma_a_per_mm", "sigma_s_prime_per_mm", "reduced_chi2"]].mean("line")
        return found.assign(fitted=(fits.termination >= 0).sum()).compute()

    def by_workers(workers, kill_after=None):
        local = {"host": "127.0.0.1", "dashboard_address": None, "memory_limit": 0}
        with distributed.LocalCluster(n_workers=workers, threads_per_worker=1, **local) as cluster:
            with distributed.Client(cluster) as client:
                pids = client.run(os.getpid)
                if kill_after is not None:
                    threading.Timer(kill_after, os.kill, (min(pids.values()), signal.SIGKILL)).start()
                start = time.perf_counter()
                found = means(client)
                seconds = time.perf_counter() - start
                peak = max(client.run(peak_mb).values())
        said = hashlib.sha256(b"".join(found[name].values.tobytes() for name in sorted(found))).hexdigest()[:16]
        return seconds, f"peak {peak:.0f} MB a worker, {int(found.fitted)} fitted, means {said}"

    # A part of the cube in this process, from all over the wavelengths: what a profile costs without Dask.
    some = min(16, -(-shape[0] // arguments.chunk[0]))
    start = time.perf_counter()
    for k in range(some):
        first = k * shape[0] // some // arguments.chunk[0] * arguments.chunk[0]
        values = xarray.DataArray(profiles(radii, *arguments.chunk, (first, 0)), dims=dims)
        part = slice(first, first + arguments.chunk[0])
        beamspot.fit_many(radii, values, u[part], total=total[part], threads=1, **OPTIONS)
    alone = (time.perf_counter() - start) / some / np.prod(arguments.chunk)
    print(f"{shape[0]} x {shape[1]} profiles of {shape[2]} radii in {cube.data.npartitions} chunks")
    print(f"loop in one process: {1e6 * alone:.2f} us a profile, made and fitted", flush=True)
    times = {}
    for workers in arguments.workers:
        times[workers], said = by_workers(workers)
        each = 1e6 * times[workers] / count
        print(
            f"{workers} worker{'s' * (workers > 1)}: {times[workers]:.1f} s, {each:.2f} us a profile, "
            f"{times[arguments.workers[0]] / times[workers]:.2f}x the first, "
            f"{1e-6 * each / alone * workers:.3f}x the loop by worker, {said}",
            flush=True,
        )
    if arguments.kill:
        # After half of the time that they took undisturbed.
        seconds, said = by_workers(workers, times[workers] / 2)
        print(f"{workers} workers, one killed: {seconds:.1f} s, {said}")


if __name__ == "__main__":
    main()
