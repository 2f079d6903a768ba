"""A batch of many captures, killed at random moments and gone on with, against one left alone.

    python tests/python/batch_kills.py target/release/beamspot FOLDER [--captures 200] [--kills 10]

Photographs small synthetic captures into FOLDER (kept, and used again), measures them in one go and
once more with kills (SIGKILL), and says whether anything was lost or done twice, and whether the two
folders hold the same bytes. `crates/cli/tests/batch.rs` has the same with six captures.
"""

import argparse
import pathlib
import random
import shutil
import subprocess
import sys
import time

CAMERA = """width = 96
height = 96
mm_per_pixel = 0.4
beam_fwhm_mm = 1.0
channels = "mono"
exposures_s = [0.001, 0.03, 1.0]
"""
MATERIALS = ["marble", "skimmilk", "skin1", "skin2", "cream", "apple", "chicken1", "potato"]


def photograph(beamspot, folder, count):
    """Writes the captures that are not there yet, and a list of all."""
    (folder / "camera.toml").write_text(CAMERA)
    names = [f"series/{number:03}" for number in range(count)]
    for seed, name in enumerate(names):
        if (folder / name / "capture.toml").exists():
            continue
        material = MATERIALS[seed % len(MATERIALS)]
        call = [beamspot, "synth", "--material", material, "--camera", "camera.toml"]
        call += ["--seed", str(seed), "-o", name]
        subprocess.run(call, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    (folder / "list.txt").write_text("".join(f"{name}/capture.toml\n" for name in names))


def contents(folder):
    """Every file with its bytes, hidden ones included."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder): path.read_bytes() for path in files}


def finished(folder):
    """When the record of each finished capture was written, and which file it is."""
    records = folder.glob("captures/*/batch.json")
    stats = {path.parent.name: path.stat() for path in records}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("beamspot", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--captures", type=int, default=200)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    beamspot, folder = arguments.beamspot.resolve(), arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    photograph(beamspot, folder, arguments.captures)
    for name in ["whole", "killed"]:
        shutil.rmtree(folder / name, ignore_errors=True)

    def call(name):
        return [beamspot, "batch", "list.txt", "--no-confirm", "--resume", "-o", name]

    start = time.monotonic()
    subprocess.run(call("whole"), cwd=folder, check=True)
    whole_s = time.monotonic() - start
    print(f"left alone: {whole_s:.1f} s")

    # Each kill falls evenly into the time in which the next part of the work is done.
    moments = random.Random(arguments.seed)
    twice = lost = 0
    before = {}
    for kill in range(arguments.kills):
        wait = moments.uniform(0.0, 1.8 * whole_s / arguments.kills)
        process = subprocess.Popen(call("killed"), cwd=folder, stdout=subprocess.DEVNULL)
        time.sleep(wait)
        process.kill()
        late = process.wait() == 0
        now = finished(folder / "killed")
        lost += sum(name not in now for name in before)
        twice += sum(now.get(name, which) != which for name, which in before.items())
        print(
            f"kill {kill + 1} after {wait:.2f} s: {len(now)} finished"
            + (", and it had ended by itself" if late else "")
        )
        before = now
    subprocess.run(call("killed"), cwd=folder, check=True)
    now = finished(folder / "killed")
    twice += sum(now[name] != which for name, which in before.items())
    whole, killed = contents(folder / "whole"), contents(folder / "killed")
    differing = [name for name in whole.keys() | killed.keys() if whole.get(name) != killed.get(name)]
    print(
        f"{len(now)} captures: {lost} lost, {twice} done twice; "
        f"{len(differing)} of {len(whole)} files differ"
    )
    sys.exit(bool(differing or lost or twice or len(now) != arguments.captures))


if __name__ == "__main__":
    main()
