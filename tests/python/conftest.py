"""What several test files share: calls of the command, and a small series of captures."""

import os
import subprocess

import pytest

from batch_kills import CAMERA


def command(*arguments):
    done = subprocess.run(
        [os.environ["BEAMSPOT_BIN"], *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def contents(folder):
    """Every file with its bytes, but for the lock."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != "lock")
    return {p.relative_to(folder): p.read_bytes() for p in files}


@pytest.fixture(scope="session")
def series(tmp_path_factory):
    """Captures `0` to `4`, the last without one of its frames, and what the command makes of them."""
    folder = tmp_path_factory.mktemp("series")
    (folder / "camera.toml").write_text(CAMERA)
    for seed in range(5):
        at = folder / str(seed)
        camera = ["--camera", folder / "camera.toml"]
        command("synth", "--material", "marble", *camera, "--seed", seed, "-o", at)
    (folder / "4/sample/sample_01.tif").unlink()
    call = ["batch", f"{folder}/*/capture.toml", "-o", str(folder / "by-command"), "--no-confirm"]
    done = subprocess.run([os.environ["BEAMSPOT_BIN"], *call], capture_output=True, text=True)
    assert done.returncode == 5, done.stderr
    return folder


def refused(*parts):
    return pytest.raises(ValueError, match=".*".join(parts))
