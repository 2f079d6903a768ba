"""A series of captures and a cube of spectra on a Slurm cluster, by dask-jobqueue.

    pip install 'beamspot[distributed]' dask-jobqueue zarr
    python examples/slurm.py

Every job needs this environment and sees this folder; `beamspot.distributed` says so where one does
not. Ctrl-C, or the end of the time of the jobs, costs nothing that was finished: the same call goes on.
"""

import xarray
from dask.distributed import Client
from dask_jobqueue import SLURMCluster

import beamspot.distributed

if __name__ == "__main__":
    cluster = SLURMCluster(cores=16, memory="32GB", walltime="02:00:00")
    cluster.scale(jobs=10)
    with Client(cluster) as client:
        print(client.dashboard_link)
        done = beamspot.distributed.batch("series/*/capture.toml", "results", resume=True, client=client)
        print(*done.summary, sep="\n")

        cube = xarray.open_zarr("cube.zarr")  # reflectance_per_mm2 and u over (wavelength_nm, line, radius_mm)
        cube = cube.chunk(wavelength_nm=1, line=10_000, radius_mm=-1)
        fits = beamspot.distributed.fit_many(
            cube.radius_mm, cube.reflectance_per_mm2, cube.u, eta=1.4, constraint="none", client=client
        )
        fits.to_zarr("fits.zarr", mode="w")
