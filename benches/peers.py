"""beamspot beside its peers, in one run on one machine: seconds of wall clock and processor, and peak memory.

    python -m venv target/peers && target/peers/bin/pip install -r benches/requirements.txt
    cargo build --release -p beamspot-cli && cargo build --release -p beamspot-formats --example decode
    target/peers/bin/python benches/peers.py FOLDER            # FOLDER takes 8 GB; a second run finds the frames there

A capture of 24 MP, 13 exposures and as many darks of sample and of white, 52 files, is made by `beamspot synth`, uncompressed,
and written again as deflate TIFF and as PNG. Every job runs in a process of its own and reads all 52 files; peers read
them by cv2.imread, subtract the darks, merge both stacks and save the result. OpenCV's MergeDebevec takes 8 bits only, so that
it throws away what it is measured for. Profiles are timed in memory, the peers' second call, with their tables ready.
"""

import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
EXPOSURES = [0.001 * 4000 ** (k / 12) for k in range(13)]


def stacks(folder):
    """(frames, darks, exposures) of sample and of white, from the manifest."""
    import tomllib

    manifest = tomllib.loads((folder / "capture.toml").read_text())
    for subject in ("sample", "reference"):
        frames = sorted(manifest[subject]["frames"], key=lambda f: f["exposure_s"])
        darks = {d["exposure_s"]: folder / d["file"] for d in manifest[subject]["dark"]}
        yield (
            [folder / f["file"] for f in frames],
            [darks[f["exposure_s"]] for f in frames],
            [f["exposure_s"] for f in frames],
        )


def read(path):
    import cv2

    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


def peer_opencv(folder):
    import cv2
    import numpy as np

    for name, (frames, darks, seconds) in zip("ab", stacks(folder)):
        images = []
        for frame, dark in zip(frames, darks):
            net = cv2.subtract(read(frame), read(dark))
            images.append(cv2.convertScaleAbs(net, alpha=1 / 256))
        radiance = cv2.createMergeDebevec().process(images, np.array(seconds, np.float32))
        np.save(folder / f"opencv-{name}.npy", radiance)


def peer_numpy(folder):
    """The plain sum that any of us would write: exposure time as weight, no variance, no hot pixels."""
    import numpy as np

    for name, (frames, darks, seconds) in zip("ab", stacks(folder)):
        total = time_ = None
        for frame, dark, t in zip(frames, darks, seconds):
            counts, level = read(frame), read(dark)
            good = counts < 60000
            net = np.where(good, counts.astype(np.float32) - level, np.float32(0))
            used = good * np.float32(t)
            total, time_ = (net, used) if total is None else (total + net, time_ + used)
        np.save(folder / f"numpy-{name}.npy", total / time_)


def peer_colour_hdri(folder):
    import colour_hdri
    import numpy as np

    for name, (frames, darks, seconds) in zip("ab", stacks(folder)):
        images = []
        for frame, dark, t in zip(frames, darks, seconds):
            net = (read(frame).astype(np.float32) - read(dark)) / np.float32(65535)
            data = np.clip(net, 0, 1)[..., np.newaxis]
            metadata = colour_hdri.Metadata(f_number=np.float64(8), exposure_time=np.float64(t), iso=np.float64(100))
            images.append(colour_hdri.Image(str(frame), data, metadata))
        stack = colour_hdri.ImageStack()
        stack.extend(images)
        np.save(folder / f"colour-{name}.npy", colour_hdri.image_stack_to_HDRI(stack))


def glow(width, height):
    import numpy as np

    y, x = np.mgrid[:height, :width].astype(np.float32)
    square = (x - width / 2 - 3.3) ** 2 + (y - height / 2 + 2.1) ** 2
    value = 1e6 / (900 + square) ** np.float32(1.4)
    return value, np.float32(1e-7) * value**2


def second(call):
    call()
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - cpu


def peer_profiles(_, width=6000, height=4000):
    """pyFAI and photutils on a picture in memory."""
    import numpy as np

    value, variance = glow(width, height)
    out = {}
    try:
        from pyFAI.integrator.azimuthal import AzimuthalIntegrator
    except ImportError:
        from pyFAI.azimuthalIntegrator import AzimuthalIntegrator
    pixel = 1e-5
    poni = {"poni1": (height / 2 - 2.1) * pixel, "poni2": (width / 2 + 3.3) * pixel}
    integrator = AzimuthalIntegrator(dist=1.0, pixel1=pixel, pixel2=pixel, **poni)
    integrator.detector.shape = value.shape
    keys = {"variance": variance, "unit": "r_mm", "correctSolidAngle": False}
    for name, method in (("histogram", ("no", "histogram", "cython")), ("CSR", ("no", "csr", "cython"))):
        out[f"pyFAI {name}"] = second(lambda: integrator.integrate1d_ng(value, 400, method=method, **keys))
    out["pyFAI sigma_clip"] = second(
        lambda: integrator.sigma_clip_ng(
            value, 400, method=("no", "csr", "cython"), thresh=5, max_iter=2, error_model="variance", **keys
        )
    )
    from photutils.profiles import RadialProfile

    edges = np.linspace(0, height / 2, 51)
    wall, cpu = time.perf_counter(), time.process_time()
    RadialProfile(value, (width / 2 + 3.3, height / 2 - 2.1), edges, error=np.sqrt(variance), method="center").profile
    out["photutils, 50 bins"] = time.perf_counter() - wall, time.process_time() - cpu
    print(json.dumps(out))


def measured(command, **environment):
    """Wall seconds, processor seconds and peak memory in MB of a command, and what it printed."""
    before = time.perf_counter()
    process = subprocess.Popen(
        [str(c) for c in command], stdout=subprocess.PIPE, text=True, env=os.environ | environment
    )
    out = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        print(f"{command[0]} failed: {command}", file=sys.stderr)
        return None
    return time.perf_counter() - before, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3, out


def row(name, result, base=None):
    if result is None:
        print(f"{name:<34} failed")
        return
    wall, cpu, memory, _ = result
    ratio = "" if base is None else f"{wall / base[0]:8.2f} {cpu / base[1]:8.2f}"
    print(f"{name:<34} {wall:8.2f} {cpu:8.2f} {memory:9.0f}   {ratio}", flush=True)


def make(folder, beamspot, width, height):
    """The capture in three forms."""
    import cv2
    import tifffile

    plain = folder / "plain"
    if not plain.exists():
        camera = folder / "camera.toml"
        camera.write_text(f'width = {width}\nheight = {height}\nchannels = "mono"\nmm_per_pixel = {0.04 * 1024 / width}\n')
        subprocess.run(
            [beamspot, "synth", "--material", "marble", "--camera", camera, "--seed", "1", "-o", plain], check=True
        )
    for form, ending in (("deflate", ".tif"), ("png", ".png")):
        target = folder / form
        if (target / "capture.toml").exists():
            continue
        for path in sorted(plain.rglob("*.tif")):
            to = (target / path.relative_to(plain)).with_suffix(ending)
            to.parent.mkdir(parents=True, exist_ok=True)
            counts = tifffile.imread(path)
            if form == "png":
                cv2.imwrite(str(to), counts, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            else:
                tifffile.imwrite(to, counts, compression="deflate", rowsperstrip=64)
        text = (plain / "capture.toml").read_text()
        (target / "capture.toml").write_text(text.replace(".tif", ending))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--size", type=int, nargs=2, default=(6000, 4000), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--without", nargs="*", default=[], help="peers to leave out: opencv, numpy, colour_hdri, profiles")
    parser.add_argument("--job", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    folder = arguments.folder
    if arguments.job:
        return globals()[f"peer_{arguments.job}"](folder)
    folder.mkdir(parents=True, exist_ok=True)
    release = ROOT / "target/release"
    beamspot = release / "beamspot"
    make(folder, beamspot, *arguments.size)

    print(f"{'':<34}   wall s    CPU s   peak MB      of the first: wall, CPU")
    for form in ("plain", "deflate", "png"):
        capture = folder / form
        files = [f for frames, darks, _ in stacks(capture) for f in (*frames, *darks)]
        for threads in (1, 2):
            decode = measured([release / "examples/decode", threads, *files])
            row(f"{form}: decode alone, {threads} thread(s)", decode)
            out = capture / "radiance.exr"
            ours = measured([beamspot, "hdr", capture / "capture.toml", "-o", out, "--force", "--threads", threads])
            row(f"{form}: beamspot hdr, {threads} thread(s)", ours, decode)
        if form == "plain":
            hdr = ours
    for peer in ("opencv", "numpy", "colour_hdri"):
        if peer not in arguments.without:
            result = measured([sys.executable, __file__, folder / "plain", "--job", peer])
            row(f"plain: {peer}", result, hdr)
    radiance = folder / "plain/radiance.exr"
    command = [beamspot, "profile", radiance, "-o", folder / "profile/profile.csv", "--force"]
    row("beamspot profile, 2 threads", measured(command))
    capture = folder / "plain/capture.toml"
    row("beamspot measure", measured([beamspot, "measure", capture, "-o", folder / "measured", "--force", "--no-confirm"]))
    if "profiles" not in arguments.without:
        bench = measured(["cargo", "bench", "-q", "-p", "beamspot-profile"], RAYON_NUM_THREADS="1")
        print(f"\nbeamspot profile in memory\n{bench[3] if bench else 'failed'}")
        peers = measured([sys.executable, __file__, folder, "--job", "profiles"])
        for name, (wall, cpu) in json.loads(peers[3]).items() if peers else ():
            print(f"{name:<34} {1e3 * wall:7.1f} ms wall {1e3 * cpu:7.1f} ms CPU {24 / wall:6.0f} MP/s")


if __name__ == "__main__":
    main()
