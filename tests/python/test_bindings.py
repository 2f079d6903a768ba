"""The Python module: the same numbers as the command line, NumPy in and out, errors with its sentences.

`cargo xtask python` builds and installs the module before these run.
"""

import ast
import inspect
import json
import pickle
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

import beamspot
from conftest import command, contents, refused

MARBLE = {"sigma_s_prime": 2.62, "sigma_a": 0.0041, "eta": 1.5}
RADII = np.geomspace(0.5, 20.0, 200)
# What enters of a beam along the normal at eta = 1.5.
ENTRY = 0.96


def dipole_by_hand(r, sigma_s_prime, sigma_a, a):
    """Jensen et al. (2001), eq. 4 as it was meant, with A = `a`."""
    t = sigma_a + sigma_s_prime
    tr = np.sqrt(3 * sigma_a * t)
    real, mirror = 1 / t, (1 + 4 / 3 * a) / t

    def source(z):
        d = np.hypot(r, z)
        return z * (1 + tr * d) * np.exp(-tr * d) / d**3

    return sigma_s_prime / t / (4 * np.pi) * (source(real) + source(mirror))


def test_the_dipole_is_equation_4():
    # A = (1 + F_dr)/(1 - F_dr), F_dr the average of Fresnel's reflectance from inside.
    mu = (np.arange(200_000) + 0.5) / 200_000
    sine = np.minimum(1.5 * np.sqrt(1 - mu**2), 1)
    out = np.sqrt(1 - sine**2)
    across = (1.5 * mu - out) / (1.5 * mu + out)
    along = (mu - 1.5 * out) / (mu + 1.5 * out)
    f_dr = np.mean(2 * mu * np.where(sine < 1, (across**2 + along**2) / 2, 1))
    found = beamspot.dipole(RADII, **MARBLE)
    assert found.dtype == np.float64 and found.shape == RADII.shape
    by_hand = dipole_by_hand(RADII, 2.62, 0.0041, (1 + f_dr) / (1 - f_dr))
    assert np.allclose(found, by_hand, rtol=1e-4)


@pytest.mark.parametrize("array", [RADII.tolist(), RADII.astype(np.float32), RADII[::-1][::-1]])
def test_any_array_of_numbers_will_do(array):
    assert np.allclose(beamspot.dipole(array, **MARBLE), beamspot.dipole(RADII, **MARBLE), rtol=1e-5)


def test_every_model_integrates_to_its_total():
    extra = {
        "dipole": {},
        "better-dipole": {},
        "kienle-patterson": {},
        "photon-beam-diffusion": {"g": 0.0},
        "monte-carlo": {"g": 0.0},
    }
    r = np.concatenate([[0.0], np.geomspace(1e-4, 300.0, 4000)])
    for name, more in extra.items():
        function = getattr(beamspot, name.replace("-", "_"))
        values = function(r[1:], **MARBLE, **more)
        integral = np.trapezoid(np.concatenate([[0.0], 2 * np.pi * r[1:] * values]), r)
        total = beamspot.total_reflectance(**MARBLE, model=name, **more)
        # Photon beam diffusion does not keep all of its energy; its own total is that of its curve.
        assert abs(integral / total - 1) < 0.01, (name, integral, total)
    slab = beamspot.total_reflectance(**MARBLE, model="multipole", thickness_mm=1.0)
    assert slab < beamspot.total_reflectance(**MARBLE)


def profile(seed, noise=1e-3):
    values = ENTRY * beamspot.dipole(RADII, **MARBLE)
    u = noise * values
    return values + u * np.random.default_rng(seed).standard_normal(len(RADII)), u


def test_fit_finds_what_made_the_profile():
    values, u = profile(1)
    total = ENTRY * beamspot.total_reflectance(**MARBLE)
    found = beamspot.fit(
        RADII, values, u, eta=1.5, total=total, u_total=1e-4, u_scale=1e-3, discrepancy=False
    )
    for estimate, truth in [(found.sigma_a_per_mm, 0.0041), (found.sigma_s_prime_per_mm, 2.62)]:
        assert abs(estimate.value - truth) < 4 * estimate.u
        assert estimate.ci95[0] < estimate.value < estimate.ci95[1]
        assert float(estimate) == estimate.value
    assert found.termination == "converged"
    document = found.to_dict()
    assert document["channels"][0]["sigma_a_per_mm"]["value"] == found.sigma_a_per_mm.value
    assert document["channels"][0]["budget"]
    assert len(found.radius_mm) == len(found.model_per_mm2)


def test_a_g_that_nobody_knows_is_fitted_along():
    medium = {"sigma_s_prime": 1.2, "sigma_a": 0.03, "eta": 1.4}
    values = beamspot.monte_carlo(RADII, **medium, g=0.8)
    found = beamspot.fit(
        RADII, values, 3e-3 * values, eta=1.4, model="monte-carlo", constraint="none", entry_loss=False
    )
    g, u = found.g
    assert abs(g - 0.8) < 3 * u and 0 < u < 0.5
    assert abs(found.sigma_a_per_mm.value - 0.03) < 3 * found.sigma_a_per_mm.u


def test_the_command_line_finds_the_same(tmp_path):
    values, u = profile(2)
    path = tmp_path / "profile.csv"
    header = "channel,radius_min_mm,radius_max_mm,radius_mm,reflectance_per_mm2,u_reflectance_per_mm2,pixels"
    rows = [f"Y,,,{r!r},{v!r},{e!r}," for r, v, e in zip(RADII.tolist(), values.tolist(), u.tolist())]
    path.write_text("\n".join([header, *rows]) + "\n")
    options = ["--eta", 1.5, "--total", "Y=0.7592+-0.0001", "--u-scale", 0.001, "--beam-fwhm", 0]
    channel = json.loads(command("fit", path, *options, "--json"))["channels"][0]
    found = beamspot.fit(RADII, values, u, eta=1.5, total=0.7592, u_total=1e-4, u_scale=1e-3)
    for name in ("sigma_a_per_mm", "sigma_s_prime_per_mm"):
        assert getattr(found, name).value == channel[name]["value"]
        assert getattr(found, name).u == channel[name]["u"]


@pytest.mark.parametrize("discrepancy", [False, True])
def test_fit_many_is_fit_of_each_on_any_number_of_threads(discrepancy):
    rows = np.array([profile(seed)[0] for seed in range(20)])
    u = profile(0)[1]
    totals = np.full(20, ENTRY * beamspot.total_reflectance(**MARBLE))
    options = {"eta": 1.5, "u_scale": 1e-3, "discrepancy": discrepancy}
    many = beamspot.fit_many(RADII, rows, u, total=totals, u_total=np.full(20, 1e-4), **options)
    other = beamspot.fit_many(
        RADII,
        np.asfortranarray(rows),
        np.tile(u, (20, 1)),
        total=totals,
        u_total=np.full(20, 1e-4),
        threads=1,
        **options,
    )
    assert len(many) == 20 and many.errors == {} and set(many.termination) == {"converged"}
    for k, row in enumerate(rows):
        one = beamspot.fit(RADII, row, u, total=totals[k], u_total=1e-4, **options)
        assert many.sigma_a_per_mm[k] == other.sigma_a_per_mm[k] == one.sigma_a_per_mm.value
        assert many.u_sigma_s_prime_per_mm[k] == one.sigma_s_prime_per_mm.u


def astray(array):
    """The same numbers, each between two that the processor would read at once."""
    array = np.asarray(array)
    found = np.frombuffer(b"0" + array.tobytes(), array.dtype, offset=1).reshape(array.shape)
    assert not found.flags.aligned
    return found


def test_numbers_may_lie_anywhere():
    # As Dask's messages and memory maps have them.
    rows, u = profile(0)[0][None], profile(0)[1]
    options = {"eta": 1.5, "constraint": "none", "discrepancy": False}
    lying = beamspot.fit_many(astray(RADII), astray(rows), astray(u), **options)
    assert lying.sigma_a_per_mm == beamspot.fit_many(RADII, rows, u, **options).sigma_a_per_mm
    sensor = {"gain_e_per_dn": 2.0, "read_noise_e": 4.0, "black_level_dn": 1.0, "white_level_dn": 60000.0}
    for dtype in (np.uint16, np.float32):
        frame = np.arange(64, dtype=dtype).reshape(8, 8)
        merged = beamspot.merge([frame], [1.0], **sensor)
        for given in (astray(frame), frame.astype(frame.dtype.newbyteorder())):
            assert np.array_equal(beamspot.merge([given], [1.0], **sensor).value, merged.value)


def test_a_profile_that_cannot_be_fitted_stops_no_other():
    rows = np.array([profile(seed)[0] for seed in range(3)])
    rows[1, 7] = np.nan
    many = beamspot.fit_many(RADII, rows, profile(0)[1], eta=1.5, constraint="none")
    assert list(many.errors) == [1] and np.isnan(many.sigma_a_per_mm[1])
    assert np.isfinite(many.sigma_a_per_mm[[0, 2]]).all()


def test_what_is_assumed_is_warned_of():
    values, _ = profile(3)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        beamspot.fit(RADII, values, eta=1.5)
    said = [str(w.message) for w in caught]
    assert len(said) == 2 and "1 %" in said[0] and "no total" in said[1]


def test_bad_input_is_named():
    values, u = profile(4)
    with refused("reflectance_per_mm2", "200", "199"):
        beamspot.fit(RADII, values[:-1], u, eta=1.5)
    with refused("no model is called `dipol`", "dipole"):
        beamspot.fit(RADII, values, u, eta=1.5, model="dipol", constraint="none")
    with refused("monte-carlo needs g"):
        many = values[None]
        beamspot.fit_many(RADII, many, u, eta=1.5, model="monte-carlo", constraint="none")
    with refused('"exact" needs a total'):
        beamspot.fit(RADII, values, u, eta=1.5, constraint="exact")
    with refused("no constraint is called"):
        beamspot.fit(RADII, values, u, eta=1.5, constraint="hard")
    with refused("no material is called `granite`", "Marble"):
        beamspot.materials("granite")
    with refused("at least 0"):
        beamspot.dipole([-1.0], **MARBLE)
    with refused("refractive index"):
        beamspot.dipole([1.0], sigma_s_prime=1.0, sigma_a=0.1, eta=15)
    with refused("capture.toml"):
        beamspot.measure("nowhere/capture.toml")
    with refused("medium", "sigma"):
        beamspot.simulate({"layer": [{"sigma_s": 1.0, "eta": 1.5}]})
    with refused("radius_mm: expected real numbers"):
        beamspot.dipole(["one"], **MARBLE)
    with refused("u:", "shape"):
        beamspot.fit_many(RADII, values[None], np.ones((2, 200)), eta=1.5, constraint="none")
    # What NumPy would quietly drop: a mask, an imaginary part, a dimension.
    masked = np.ma.masked_less(values, np.median(values))
    with refused("reflectance_per_mm2: 100 numbers are masked"):
        beamspot.fit(RADII, masked, u, eta=1.5)
    with refused("reflectance_per_mm2: expected real numbers", "complex128"):
        beamspot.fit(RADII, values + 1j, u, eta=1.5)
    with refused(r"radius_mm: expected an array of shape \(n,\), got \(20, 10\)"):
        beamspot.fit(RADII.reshape(20, 10), values, u, eta=1.5)
    with refused(r"reflectance_per_mm2: expected an array of shape \(n, m\), got \(200,\)"):
        beamspot.fit_many(RADII, values, u, eta=1.5, constraint="none")
    with refused(r"u: expected an array of shape \(n,\), got \(\)"):
        beamspot.fit(RADII, values, 0.01, eta=1.5)
    with refused("u_scale", "-0.1"):
        beamspot.fit(RADII, values, u, eta=1.5, u_scale=-0.1)
    for number in (-1, 65536):
        with refused(f"threads: {number} is not in 0..=65535"):
            beamspot.fit_many(RADII, values[None], u, eta=1.5, constraint="none", threads=number)
    with refused("range_mm: expected the first and the last radius in mm", "got 20 and 1"):
        beamspot.fit(RADII, values, u, eta=1.5, constraint="none", range_mm=(20, 1))


def test_a_profile_in_another_unit_is_told():
    values, u = profile(4)
    total = ENTRY * beamspot.total_reflectance(**MARBLE)
    known = {"eta": 1.5, "total": total, "u_total": 1e-3, "u_scale": 5e-3}
    for change in [(RADII / 10, values, u), (RADII, values / 10, u / 10)]:
        assert any("looks like a unit" in w for w in beamspot.fit(*change, **known).warnings)
    assert not beamspot.fit(RADII, values, u, **known).warnings
    with refused("in another unit"):
        beamspot.fit(RADII, 100 * values, 100 * u, **known)


@pytest.mark.parametrize("discrepancy", [False, True])
def test_many_profiles_are_warned_of_as_one_is(discrepancy):
    values, u = profile(4)
    total = ENTRY * beamspot.total_reflectance(**MARBLE)
    known = {"eta": 1.5, "u_scale": 5e-3, "discrepancy": discrepancy}
    rows = np.array([values, values / 10, values * np.exp(-0.3 * RADII)])
    us = np.array([u, u / 10, u * np.exp(-0.3 * RADII)])
    totals = {"total": np.full(3, total), "u_total": np.full(3, 1e-3)}
    with pytest.warns(UserWarning, match="profile 1: .* looks like a unit"):
        many = beamspot.fit_many(RADII, rows, us, **known, **totals)
    for i, (row, u_row) in enumerate(zip(rows, us)):
        one = beamspot.fit(RADII, row, u_row, total=total, u_total=1e-3, **known)
        assert many.warnings.get(i, []) == one.warnings
    assert 0 not in many.warnings


def test_what_is_assumed_of_a_profile_does_not_depend_on_the_others():
    faint = profile(4)[0] * 1e-9
    fit = lambda rows: beamspot.fit_many(RADII, rows, eta=1.5, constraint="none", discrepancy=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert fit([faint]).sigma_a_per_mm[0] == fit([faint, profile(5)[0]]).sigma_a_per_mm[0]


def test_a_model_whose_error_is_unknown_says_so():
    values, u = profile(4)
    found = beamspot.fit(RADII, values, u, eta=1.5, model="multipole", thickness_mm=50.0, constraint="none")
    assert any("u holds the noise and the inputs alone" in w for w in found.warnings)


def test_materials_are_jensens():
    rows = beamspot.materials("marble")
    assert [row.channel for row in rows] == ["R", "G", "B"]
    assert (rows[1].sigma_s_prime_per_mm, rows[1].sigma_a_per_mm, rows[1].eta) == (2.62, 0.0041, 1.5)
    assert len(beamspot.materials()) == 36


def test_merge_and_profile_show_the_glow():
    rng = np.random.default_rng(5)
    y, x = np.mgrid[0:301, 0:301]
    glow = 2e5 * np.exp(-np.hypot(x - 150.25, y - 149.5) / 12.0) + 20.0
    exposures = [0.4, 0.01, 0.1]
    frames = [
        np.clip(rng.poisson(2 * glow * t) / 2 + 100 + rng.normal(0, 2, glow.shape), 0, 60000)
        .round()
        .astype(np.uint16)
        for t in exposures
    ]
    dark = [
        (100 + rng.normal(0, 2, glow.shape)).round().astype(np.uint16) for _ in exposures
    ]
    sensor = {
        "gain_e_per_dn": 2.0,
        "read_noise_e": 4.0,
        "black_level_dn": 100.0,
        "white_level_dn": 60000.0,
        "prnu_relative": 0.0,
    }
    merged = beamspot.merge(frames, exposures, dark, **sensor)
    assert merged.value.shape == glow.shape and merged.value.dtype == np.float32
    pull = (merged.value - glow) / np.sqrt(merged.variance)
    assert abs(pull.mean()) < 0.05 and abs(pull.var() - 1) < 0.05
    found = beamspot.radial_profile(merged.value, variance=merged.variance, mm_per_pixel=0.05)
    assert np.allclose(found.center_px, [150.25, 149.5], atol=0.05)
    truth = 2e5 * np.exp(-found.radius_mm / 0.05 / 12.0) + 20.0
    outside = found.radius_mm > 1.0
    off = found.reflectance_per_mm2[outside] / truth[outside] - 1
    assert np.median(np.abs(off)) < 0.01
    with refused("exposure_s", "3", "got 2"):
        beamspot.merge(frames, exposures[:2], **sensor)
    with refused(r"frames\[0\]: 1 numbers are masked"):
        spoiled = np.ma.masked_array(frames[0], mask=False)
        spoiled[0, 0] = np.ma.masked
        beamspot.merge([spoiled], [1.0], **sensor)
    with refused(r"frames\[0\]", "int64"):
        beamspot.merge([frames[0].astype(np.int64)], [1.0], **sensor)


def test_simulate_agrees_with_the_transport_model():
    medium = {"layer": [{"sigma_a_per_mm": 0.0041, "sigma_s_per_mm": 2.62, "eta": 1.5}]}
    medium["tally"] = {"r_max_mm": 10.0, "r_bins": 20}
    run = beamspot.simulate(medium, 2e5, seed=3)
    again = beamspot.simulate(medium, 2e5, seed=3)
    assert np.array_equal(run.reflectance_per_mm2, again.reflectance_per_mm2)
    total = run.totals["diffuse_reflectance"]
    exact = ENTRY * beamspot.total_reflectance(**MARBLE, model="monte-carlo", g=0.0)
    assert abs(total["value"] - exact) < 4 * total["u"] + 1e-3
    assert len(run.radius_mm) == 20 and run.photons >= 2e5


def test_parts_of_a_run_add_up_to_its_bytes():
    medium = {"layer": [{"sigma_a_per_mm": 0.1, "sigma_s_per_mm": 1.0, "eta": 1.4, "thickness_mm": 2.0}]}
    medium["tally"] = {"r_max_mm": 5.0, "r_bins": 10}
    run = beamspot.simulate(medium, 1e5, seed=3)
    parts = [beamspot.simulate(medium, 1e5, seed=3, part=(k, 3), threads=1) for k in (2, 0, 1)]
    assert sum(part.photons for part in parts) == run.photons
    sent = [pickle.loads(pickle.dumps(part)) for part in parts]
    assert pickle.dumps(sent[0] + sent[1] + sent[2]) == pickle.dumps(run)
    assert (sent[0] + sent[1] + sent[2]).totals == run.totals
    with refused("both results hold block"):
        run + parts[0]
    with refused("different simulations"):
        parts[0] + beamspot.simulate(medium, 1e5, seed=4, part=(0, 3))
    with refused("part 3 of 3"):
        beamspot.simulate(medium, 1e5, part=(3, 3))
    with refused("schema_version 9"):
        beamspot._beamspot.restore_simulation(run.__reduce__()[1][0].replace('n":1', 'n":9', 1))
    # More parts than there are blocks: some have nothing to do.
    few = [beamspot.simulate(medium, 1, part=(k, 3)) for k in range(3)]
    assert sorted(part.photons for part in few)[:2] == [0, 0]
    assert pickle.dumps(few[0] + few[1] + few[2]) == pickle.dumps(beamspot.simulate(medium, 1))


def test_a_medium_is_read_with_nothing_left_out():
    skin = beamspot.read_medium("skin")
    assert len(skin["layer"]) > 1 and skin["eta_above"] == 1.0
    assert beamspot.read_medium(skin) == skin
    with refused("nowhere.toml"):
        beamspot.read_medium("nowhere.toml")


def test_simulate_returns_every_tally():
    medium = {"layer": [{"sigma_a_per_mm": 0.0041, "sigma_s_per_mm": 2.62, "eta": 1.5}]}
    medium["tally"] = {"r_max_mm": 10.0, "r_bins": 4, "angle_bins": 3, "radius_and_angle": True}
    run = beamspot.simulate(medium, 1e4)
    joint = run.tables["reflectance_r_angle"]
    shares = joint["share"].reshape(5, 4)  # with what lies beyond
    assert np.allclose(shares.sum(axis=0), run.tables["reflectance_angle"]["share"], atol=1e-12)
    rings = np.pi * np.diff(np.linspace(0.0, 10.0, 5) ** 2)
    assert np.allclose(shares.sum(axis=1)[:4], run.reflectance_per_mm2 * rings, atol=1e-12)
    assert np.isnan(joint["radius_max_mm"]).sum() == 4
    with refused("radius and angle", "bins of both"):
        beamspot.simulate({**medium, "tally": {"radius_and_angle": True}}, 1e4)


CAMERA = """
width = 300
height = 300
mm_per_pixel = 0.1
"""


def test_measure_is_the_command(tmp_path):
    (tmp_path / "camera.toml").write_text(CAMERA)
    capture = tmp_path / "capture"
    command("synth", "--material", "marble", "--camera", tmp_path / "camera.toml", "-o", capture)
    command("measure", capture / "capture.toml", "-o", tmp_path / "by-command", "--no-confirm")
    measured = beamspot.measure(capture / "capture.toml", confirm=False)
    measured.write(tmp_path / "by-python")
    for file in ("fit.json", "profile.csv", "materials.csv", "report.html", "radiance.exr"):
        a, b = [(tmp_path / folder / file).read_bytes() for folder in ("by-command", "by-python")]
        assert a == b, file
    assert measured.material.lower() == "marble" and len(measured.fits) == len(measured.profiles) == 3
    assert measured.fits[1].sigma_a_per_mm.value == measured.materials[1].sigma_a_per_mm
    with refused("exists"):
        measured.write(tmp_path / "by-python")


def test_a_batch_is_the_command(series, tmp_path):
    with pytest.warns(UserWarning, match="1 of 5 captures were not measured"):
        found = beamspot.batch(f"{series}/*/capture.toml", tmp_path / "out", confirm=False)
    assert contents(tmp_path / "out") == contents(series / "by-command")
    assert found.captures == ["0", "1", "2", "3", "4"] and len(found) == 5
    assert list(found.errors) == ["4"] and "sample_01.tif" in found.errors["4"]
    assert [row.material for row in found.materials] == 4 * [found.materials[0].material]
    assert found.to_dict()["not_measured"] == 1
    assert found.summary[-1] == "5 captures: 4 measured, 1 not"
    some = [series / "0/capture.toml", series / "1/capture.toml"]
    with refused("exists", "--resume", "--force"):
        beamspot.batch(some, tmp_path / "out", confirm=False)
    again = beamspot.batch(some, tmp_path / "out", confirm=False, resume=True)
    assert again.summary == ["2 captures: 2 measured (2 of them before), 0 not"]
    with refused("no model is called `dipol`"):
        beamspot.batch(some, tmp_path / "new", model="dipol")
    fcntl = pytest.importorskip("fcntl")
    with open(tmp_path / "out/.beamspot-batch/lock") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with refused("another batch is writing to this folder"):
            beamspot.batch(some, tmp_path / "out", confirm=False, resume=True)


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to another process")
def test_a_batch_hears_the_key_and_goes_on_later(series, tmp_path):
    code = f"""
import signal, beamspot
signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    beamspot.batch({str(series / "[01]" / "capture.toml")!r}, {str(tmp_path / "out")!r}, bootstrap=500)
except KeyboardInterrupt as error:
    print(error)
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    while not (tmp_path / "out/.beamspot-batch/lock").exists():
        assert child.poll() is None
        time.sleep(0.01)
    child.send_signal(signal.SIGINT)
    said = child.communicate(timeout=60)[0]
    assert "captures are measured" in said and "--resume" in said, said


def stub(name):
    """The functions of a stub file, the last of those that bear one name, and its classes."""
    body = ast.parse((Path(beamspot.__file__).parent / name).read_text()).body
    of = lambda kind: {n.name: n for n in body if isinstance(n, kind)}
    return of(ast.FunctionDef), of(ast.ClassDef)


def said(stub):
    """The parameters of a stub: whether each goes by its name alone, and its default."""
    arguments = stub.args
    defaults = [inspect.Parameter.empty] * (len(arguments.args) - len(arguments.defaults))
    defaults += [ast.literal_eval(d) for d in arguments.defaults]
    found = [(a.arg, False, d) for a, d in zip(arguments.args, defaults)]
    for a, d in zip(arguments.kwonlyargs, arguments.kw_defaults):
        found.append((a.arg, True, inspect.Parameter.empty if d is None else ast.literal_eval(d)))
    return found


def taken(function):
    """The parameters of a function, in the form of `said`."""
    parameters = inspect.signature(function).parameters.values()
    assert all(p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY, p.VAR_KEYWORD) for p in parameters)
    return [(p.name, p.kind == p.KEYWORD_ONLY, p.default) for p in parameters if p.kind != p.VAR_KEYWORD]


def test_the_stubs_say_what_the_module_has():
    functions, classes = stub("__init__.pyi")
    assert {*functions, *classes, "__version__"} == set(beamspot.__all__)
    for name, function in functions.items():
        assert said(function) == taken(getattr(beamspot, name)), name
        assert getattr(beamspot, name).__doc__, name
    for name, members in classes.items():
        names = {n.target.id for n in members.body if isinstance(n, ast.AnnAssign)}
        names |= {n.name for n in members.body if isinstance(n, ast.FunctionDef)}
        real = {m for m in vars(getattr(beamspot, name)) if not m.startswith("_")}
        assert {m for m in names if not m.startswith("_")} == real, name


def test_the_stubs_say_what_goes_to_other_machines():
    """There, what a function hands on to the one of its name here is spelled out."""
    distributed = pytest.importorskip("beamspot.distributed", exc_type=ImportError)
    functions, _ = stub("distributed.pyi")
    assert set(functions) == set(distributed.__all__)
    for name, function in functions.items():
        here, there = getattr(beamspot, name), getattr(distributed, name)
        own = taken(there)
        parameters = inspect.signature(there).parameters.values()
        handed = [p for p in taken(here) if p[0] not in [o[0] for o in own]]
        hands_on = any(p.kind == p.VAR_KEYWORD for p in parameters)
        assert said(function) == own + (handed if hands_on else []), name
        assert there.__doc__, name


def test_the_documentation_is_built_without_a_warning(tmp_path):
    call = ["-W", "error", "-m", "pdoc", "-d", "markdown", "-o", str(tmp_path), "beamspot", "beamspot.distributed"]
    done = subprocess.run([sys.executable, *call], capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    page = (tmp_path / "beamspot.html").read_text(encoding="utf-8")
    assert all(f'id="{name}"' in page for name in beamspot.__all__)
    assert 'id="fit_many"' in (tmp_path / "beamspot/distributed.html").read_text(encoding="utf-8")


def test_the_readmes_example_runs():
    readme = (Path(__file__).parents[2] / "README.md").read_text()
    (example,) = [part.split("```")[0] for part in readme.split("```python\n")[1:]]
    names = {}
    exec(compile(example, "README.md", "exec"), names)
    assert abs(names["found"].sigma_a_per_mm.value / 0.0041 - 1) < 0.2
    assert len(names["many"]) == 1000 and len(names["marble"]) == 3
