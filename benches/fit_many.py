"""`fit_many` from Python beside the library's own, on the same profiles in the same run, on one thread.

    cargo build --release -p beamspot-fit --example fit_many && pip install .
    python benches/fit_many.py target/release/examples/fit_many

Prints the CPU time of a profile either way, the ratio of the fastest runs, whether all numbers are the
same, and the CPU time of `import beamspot` beside that of `import numpy` alone: times of the processor,
which others on the machine disturb least. Needs 16 bytes of disk and memory for each radius of each
profile.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import beamspot


def profiles(count, radii):
    """Profiles of as many dipoles with noise of 0.5 %, and their totals."""
    rng = np.random.default_rng(1)
    media = zip(10 ** rng.uniform(-3, -1, 256), rng.uniform(0.5, 3.0, 256))
    clean, totals = [], []
    for sigma_a, sigma_s_prime in media:
        medium = {"sigma_a": sigma_a, "sigma_s_prime": sigma_s_prime, "eta": 1.4}
        clean.append(beamspot.dipole(radii, **medium))
        totals.append(beamspot.total_reflectance(**medium))
    clean, totals = np.resize(clean, (count, len(radii))), np.resize(totals, count)
    u = 5e-3 * clean
    return clean + u * rng.standard_normal(clean.shape), u, totals, np.full(count, 2e-3)


def cpu(*call):
    """Seconds of the processor that a program takes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def imports(code):
    """Seconds of an interpreter that does this: the least of eleven."""
    return min(cpu(sys.executable, "-c", code) for _ in range(11))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("library", type=Path)
    parser.add_argument("--profiles", type=int, default=100_000)
    parser.add_argument("--radii", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    radii = np.geomspace(1.0, 20.0, arguments.radii)
    values, u, totals, u_totals = profiles(arguments.profiles, radii)
    options = {"eta": 1.4, "u_scale": 0.01, "range_mm": (radii[0], radii[-1])}
    # The library fits light per power that enters.
    options |= {"entry_loss": False, "discrepancy": False, "threads": 1}
    with tempfile.TemporaryDirectory() as folder:
        given, answer = os.path.join(folder, "in"), os.path.join(folder, "out")
        with open(given, "wb") as file:
            np.array([len(values), len(radii), 1.4, 0.01]).tofile(file)
            radii.tofile(file)
            np.hstack([values, u, totals[:, None], u_totals[:, None]]).tofile(file)
        library, python = [], []
        for _ in range(arguments.rounds):
            # What three fits cost above one: reading and writing drop out.
            once, more = (cpu(arguments.library, given, answer, "joint", n) for n in "13")
            library.append((more - once) / 2)
            start = time.process_time()
            found = beamspot.fit_many(radii, values, u, total=totals, u_total=u_totals, **options)
            python.append(time.process_time() - start)
        numbers = np.fromfile(answer).reshape(-1, 5)
    names = ["sigma_a_per_mm", "u_sigma_a_per_mm", "sigma_s_prime_per_mm", "u_sigma_s_prime_per_mm", "scale"]
    same = all(np.array_equal(numbers[:, i], getattr(found, name), equal_nan=True) for i, name in enumerate(names))
    for who, times in [("library", library), ("Python", python)]:
        print(f"{who:8} {min(times) / len(values) * 1e6:.2f} us a profile of {len(radii)} radii")
    print(f"Python at {100 * min(library) / min(python):.1f} % of the library's speed; the same numbers: {same}")
    bare, with_numpy, ours = (imports(code) for code in ("pass", "import numpy", "import beamspot"))
    print(f"interpreter {1e3 * bare:.0f} ms, with numpy {1e3 * with_numpy:.0f} ms, with beamspot {1e3 * ours:.0f} ms:")
    print(f"import beamspot costs {1e3 * (ours - bare):.0f} ms, {1e3 * (ours - with_numpy):.0f} ms more than numpy alone")


if __name__ == "__main__":
    main()
