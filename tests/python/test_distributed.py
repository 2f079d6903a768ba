"""beamspot.distributed with a real scheduler and two worker processes, one of them killed in the middle."""

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import beamspot
from conftest import contents, refused

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")
xarray = pytest.importorskip("xarray")
import beamspot.distributed  # noqa: E402

MEDIUM = {
    "layer": [{"sigma_a_per_mm": 0.2, "sigma_s_per_mm": 2.0, "eta": 1.4}],
    "tally": {"r_max_mm": 10.0, "r_bins": 20, "angle_bins": 3},
}


@pytest.fixture(scope="module")
def client():
    local = {"host": "127.0.0.1", "dashboard_address": None, "processes": True}
    # Where the machine is so busy that a worker takes a while to come back, the cluster would give it up.
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "10 minutes"}):
        with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **local) as cluster:
            with distributed.Client(cluster) as client:
                yield client


def at_work(dask_scheduler):
    """Whether some tasks are done, and the workers that are at others."""
    workers = dask_scheduler.workers.values()
    done = any(w.has_what for w in workers)
    return done, [w.address for w in workers if w.processing]


@contextlib.contextmanager
def one_killed(client):
    """Kills a worker once some of what is done meanwhile is done, and the worker is at another part."""
    client.wait_for_workers(2, timeout=120)
    pids = client.run(os.getpid)
    killed, over = [], threading.Event()

    def kill():
        while not over.is_set() and not killed:
            done, busy = client.run_on_scheduler(at_work)
            if done and busy and busy[0] in pids:
                os.kill(pids[busy[0]], signal.SIGKILL)
                killed.append(busy[0])
            time.sleep(0.01)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
    assert killed, "nothing was in the middle of anything"


def test_photons_of_a_killed_worker_are_followed_again(client):
    whole = beamspot.simulate(MEDIUM, 1e6, seed=3)
    with one_killed(client):
        found = beamspot.distributed.simulate(MEDIUM, 1e6, seed=3, client=client, parts=40)
    assert pickle.dumps(found) == pickle.dumps(whole)
    assert found.totals == whole.totals and found.photons == whole.photons


def test_a_cube_is_fitted_to_the_same_bytes(client):
    radii = np.geomspace(0.5, 20.0, 30)
    rng = np.random.default_rng(1)
    clean = beamspot.dipole(radii, sigma_s_prime=1.5, sigma_a=0.01, eta=1.4)
    values = clean * (1 + 1e-3 * rng.standard_normal((4, 400, len(radii))))
    cube = xarray.DataArray(values, dims=("wavelength_nm", "line", "radius_mm"))
    options = {"eta": 1.4, "constraint": "none"}
    u = 1e-3 * clean
    some = cube[:, :4]
    whole = beamspot.fit_many(radii, some, u, threads=1, **options)
    with one_killed(client):
        chunks = some.chunk({"wavelength_nm": 1, "line": 2})
        lazy = beamspot.distributed.fit_many(radii, chunks, u, client=client, **options)
        assert lazy.sigma_a_per_mm.chunks == ((1,) * 4, (2, 2))
        found = lazy.compute()
    assert found.identical(whole)
    # What comes without chunks gets some.
    plain = {"discrepancy": False, **options}
    lazy = beamspot.distributed.fit_many(radii, cube, u, client=client, **plain)
    assert lazy.compute().identical(beamspot.fit_many(radii, cube, u, **plain))


def test_captures_are_measured_to_the_same_files(client, series, tmp_path):
    captures = [series / str(i) / "capture.toml" for i in range(5)]
    with one_killed(client), pytest.warns(UserWarning, match="1 of 5 captures were not measured"):
        found = beamspot.distributed.batch(captures, tmp_path / "out", confirm=False, client=client)
    assert list(found.errors) == ["4"] and len(found.materials) == 4
    assert contents(tmp_path / "out") == contents(series / "by-command")
    with refused("exists", "--resume"):
        beamspot.distributed.batch(captures, tmp_path / "out", confirm=False, client=client)
    with pytest.warns(UserWarning):
        more = beamspot.distributed.batch(
            captures, tmp_path / "out", confirm=False, resume=True, client=client
        )
    assert "(4 of them before)" in more.summary[-1]
    assert contents(tmp_path / "out") == contents(series / "by-command")
    with pytest.raises(TypeError, match="modell"):
        beamspot.distributed.batch(captures, tmp_path / "out", modell="dipole", client=client)


def without_beamspot(folder):
    """A folder with everything that this interpreter can import but beamspot."""
    for path in map(Path, sys.path):
        if path.name == "site-packages":
            for entry in path.iterdir():
                if "beamspot" not in entry.name:
                    (folder / entry.name).symlink_to(entry)
    return {**os.environ, "PYTHONPATH": str(folder), "PYTHONNOUSERSITE": "1"}


WORKER = """
import asyncio, sys, distributed
async def main():
    async with distributed.Worker(sys.argv[1], nthreads=1, dashboard=False) as worker:
        await worker.finished()
asyncio.run(main())
"""


def test_a_worker_without_the_package_is_named(client, tmp_path):
    client.wait_for_workers(2, timeout=120)
    before = set(client.scheduler_info(n_workers=-1)["workers"])
    # The interpreter that the environment of this one stands on has no packages of its own.
    python = sys._base_executable
    call = [python, "-c", WORKER, client.scheduler.address]
    worker = subprocess.Popen(call, env=without_beamspot(tmp_path))
    try:
        client.wait_for_workers(3, timeout=120)
        (address,) = set(client.scheduler_info(n_workers=-1)["workers"]) - before
        with pytest.raises(RuntimeError, match=f"{address} has none; install it there"):
            beamspot.distributed.simulate(MEDIUM, 1e4, client=client)
    finally:
        worker.terminate()
        worker.wait()


def test_options_of_another_version_are_refused(monkeypatch):
    from beamspot import _cubes

    assert pickle.loads(pickle.dumps(_cubes.Options(eta=1.5))) == {"eta": 1.5}
    pickled = pickle.dumps(_cubes.Options(eta=1.5))
    monkeypatch.setattr(_cubes._beamspot, "__version__", "0.0.9")
    with pytest.raises(RuntimeError, match="pickled by beamspot .*, and this process has 0.0.9"):
        pickle.loads(pickled)


def test_wrong_calls_are_refused_before_anything_is_sent(client, tmp_path):
    with refused("xarray.DataArray, got ndarray"):
        beamspot.distributed.fit_many([1.0], np.ones((1, 1)), eta=1.4, client=client)
    with refused("medium", "sigma"):
        beamspot.distributed.simulate({"layer": [{"sigma_s": 1.0, "eta": 1.5}]}, client=client)
    with refused("parts: expected a number of at least 1, got 0"):
        beamspot.distributed.simulate(MEDIUM, parts=0, client=client)
    with refused("no such file"):
        beamspot.distributed.batch("none.toml", tmp_path / "out", client=client)
    assert not (tmp_path / "out").exists()
