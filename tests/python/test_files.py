"""Frames written by other programs merge to the picture that beamspot's own files give.

A synthetic capture is read by tifffile, written anew in every format that a laboratory has, with
its exposure times in the manifest, the metadata or the names, and merged. BEAMSPOT_BIN names the
binary.
"""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import OpenEXR
import pytest
import rawpy
import tifffile
from astropy.io import fits
from PIL import Image, ImageCms
from PIL.TiffImagePlugin import IFDRational, ImageFileDirectory_v2

CAMERA = """\
width = 96
height = 96
mm_per_pixel = {mm_per_pixel}
beam_fwhm_mm = 1.2
channels = "{channels}"
exposures_s = [0.001, 0.02, 0.5]
"""
EXPOSURE_TIME = 33434
PATTERN = "GRBG"
EXIF = 0x8769
MICRO_MANAGER = 51123


def run(*arguments):
    """Exit code, standard output and standard error of the binary."""
    binary = os.environ.get("BEAMSPOT_BIN")
    assert binary, "set BEAMSPOT_BIN to the path of the beamspot binary"
    command = [binary, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8")
    assert "panicked" not in done.stderr, done.stderr
    return done


def merged(folder):
    """The layers of the merged map by name, and the notes."""
    output = folder / "radiance.exr"
    done = run("hdr", folder / "capture.toml", "-o", output, "--json", "--force")
    assert done.returncode == 0, done.stderr
    channels = OpenEXR.File(str(output), separate_channels=True).channels()
    layers = {name: np.array(channel.pixels) for name, channel in channels.items()}
    return layers, json.loads(done.stdout)["notes"]


def refused(folder, *words):
    done = run("hdr", folder / "capture.toml", "-o", folder / "radiance.exr")
    assert done.returncode == 3, (done.returncode, done.stderr)
    for word in words:
        assert word in done.stderr, f"no `{word}` in: {done.stderr}"


class Capture:
    """A synthetic capture: its manifest, and frames by name with their exposure times."""

    def __init__(self, folder, channels, mm_per_pixel=0.4):
        camera = folder / "camera.toml"
        camera.write_text(CAMERA.format(channels=channels, mm_per_pixel=mm_per_pixel))
        self.folder = folder / "capture"
        done = run("synth", "--material", "marble", "--camera", camera, "-o", self.folder)
        assert done.returncode == 0, done.stderr
        self.manifest = (self.folder / "capture.toml").read_text()
        entry = r'file = "(.*?)\.tif", exposure_s = ([^ ]+) '
        self.times = {name: float(s) for name, s in re.findall(entry, self.manifest)}
        assert len(self.times) == 12
        self.frames = {name: tifffile.imread(self.folder / f"{name}.tif") for name in self.times}
        self.layers, _ = merged(self.folder)

    def rewritten(self, folder, write, manifest=None):
        """The same capture with its files written by `write(path without end, frame, time)`."""
        ends = set()
        for name, frame in self.frames.items():
            path = folder / name
            path.parent.mkdir(exist_ok=True)
            ends.add(write(path, frame, self.times[name]))
        (end,) = ends
        manifest = manifest or self.manifest.replace('.tif"', f'.{end}"')
        (folder / "capture.toml").write_text(manifest)
        return folder

    def same(self, folder):
        """Merges `folder` and compares; returns the notes."""
        layers, notes = merged(folder)
        assert layers.keys() == self.layers.keys()
        for name, expected in self.layers.items():
            # The same sums in the same order: equal to the last bit.
            np.testing.assert_array_equal(layers[name], expected, err_msg=name)
        return notes

    def patterns(self, end):
        """The manifest with patterns in place of lists."""
        text = self.manifest
        for folder in ("sample", "reference"):
            for key, prefix in (("frames", folder), ("dark", "dark")):
                entry = rf'{key} = \[\n(  {{ file = "{folder}/{prefix}_.*\n)+\]'
                text, count = re.subn(entry, f'{key} = "{folder}/{prefix}_*.{end}"', text)
                assert count == 1, (folder, key)
        assert "exposure_s" not in text
        return text


@pytest.fixture(scope="module")
def mono(tmp_path_factory):
    return Capture(tmp_path_factory.mktemp("mono"), "mono")


@pytest.fixture(scope="module")
def rgb(tmp_path_factory):
    return Capture(tmp_path_factory.mktemp("rgb"), "rgb")


@pytest.fixture(scope="module")
def bayer(tmp_path_factory):
    # A spot of several photosites of each colour.
    return Capture(tmp_path_factory.mktemp("bayer"), f'rgb"\nmosaic = "{PATTERN}', 0.2)


def tiff(**options):
    def write(path, frame, _):
        data = frame
        if options.get("planarconfig") == "separate":
            data = np.moveaxis(frame, 2, 0)
        photometric = "rgb" if frame.ndim == 3 else "minisblack"
        tifffile.imwrite(f"{path}.tif", data, photometric=photometric, metadata=None, **options)
        return "tif"

    return write


def by_imageio(end):
    def write(path, frame, _):
        imageio.imwrite(f"{path}.{end}", frame)
        return end

    return write


def by_hand_ppm(path, frame, _):
    height, width, _ = frame.shape
    header = f"P6\n{width} {height} 65535\n".encode()
    Path(f"{path}.ppm").write_bytes(header + frame.astype(">u2").tobytes())
    return "ppm"


def fits_file(data=lambda frame: frame, **cards):
    def write(path, frame, time):
        file = fits.PrimaryHDU(data(frame))
        for name, (value, comment) in cards.items():
            file.header[name] = (value(time), comment)
        file.writeto(f"{path}.fits")
        return "fits"

    return write


def exr(compression):
    def write(path, frame, _):
        header = {"compression": compression, "type": OpenEXR.scanlineimage}
        data = frame.astype(np.float32)
        channels = {"Y": data} if frame.ndim == 2 else {"RGB": data}
        OpenEXR.File(header, channels).write(f"{path}.exr")
        return "exr"

    return write


WHOLE = {
    "tiff": tiff(),
    "tiff-lzw": tiff(compression="lzw"),
    "tiff-lzw-predictor": tiff(compression="lzw", predictor=2),
    "tiff-deflate-tiles": tiff(compression="deflate", tile=(32, 48)),
    "bigtiff-big-endian": tiff(bigtiff=True, byteorder=">"),
    "tiff-packbits-strips": tiff(compression="packbits", rowsperstrip=7),
}


@pytest.mark.parametrize("name", WHOLE)
def test_whole_numbers_come_through(mono, rgb, name, tmp_path):
    for capture in (mono, rgb):
        folder = tmp_path / str(capture is mono)
        folder.mkdir()
        capture.same(capture.rewritten(folder, WHOLE[name]))


def test_planes_pixmaps_png_and_fits_come_through(mono, rgb, tmp_path):
    planar = tiff(planarconfig="separate", compression="deflate")
    cases = [
        (rgb, planar),
        (rgb, by_hand_ppm),
        (mono, by_imageio("png")),
        (mono, by_imageio("pgm")),
        (mono, fits_file()),
        (mono, fits_file(lambda frame: frame.astype(np.int32))),
    ]
    for i, (capture, write) in enumerate(cases):
        folder = tmp_path / str(i)
        folder.mkdir()
        # 32 bits are another depth, and the same counts.
        capture.same(capture.rewritten(folder, write))


def test_floating_point_comes_through(mono, rgb, tmp_path):
    def float_tiff(path, frame, time):
        return tiff(compression="deflate", predictor=3)(path, frame.astype(np.float32), time)

    cases = [
        (mono, float_tiff),
        (mono, fits_file(lambda frame: frame.astype(np.float32))),
        (mono, exr(OpenEXR.ZIP_COMPRESSION)),
        (rgb, exr(OpenEXR.PIZ_COMPRESSION)),
    ]
    for i, (capture, write) in enumerate(cases):
        folder = tmp_path / str(i)
        folder.mkdir()
        # They show that they are whole counts, and their rounding is in the variance.
        capture.same(capture.rewritten(folder, write))


def test_half_precision_has_its_rounding_in_the_variance(mono, tmp_path):
    def half(path, frame, _):
        header = {"type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"Y": frame.astype(np.float16)}).write(f"{path}.exr")
        return "exr"

    assert max(frame.max() for frame in mono.frames.values()) < 65504
    layers, notes = merged(mono.rewritten(tmp_path, half))
    assert any("round counts beyond 2048 to 11 bits" in note for note in notes)
    for name, expected in mono.layers.items():
        if name.endswith("variance"):
            finite = np.isfinite(expected) & np.isfinite(layers[name])
            ratio = layers[name][finite] / expected[finite]
            assert ratio.min() > 0.99 and ratio.max() > 1.001, (ratio.min(), ratio.max())


def test_eight_bits_want_a_word(mono, tmp_path):
    def write(path, frame, _):
        imageio.imwrite(f"{path}.png", (frame >> 8).astype(np.uint8))
        return "png"

    folder = mono.rewritten(tmp_path, write)
    refused(folder, ".png", "8 bits", 'response = "linear"')
    manifest = (folder / "capture.toml").read_text()
    linear = 'white_level_dn = 250.0\nresponse = "linear"'
    manifest = re.sub(r"white_level_dn = .*", linear, manifest)
    manifest = re.sub(r"(black_level_dn) = .*", r"\1 = 0.0", manifest)
    manifest = re.sub(r"(gain_e_per_dn) = .*", r"\1 = 128.0", manifest)
    (folder / "capture.toml").write_text(manifest)
    # They are read now. What is left to say is that cutting counts off at 8 bits, as this test
    # did, dims the dim frames: their exposures do not fit together any more.
    refused(folder, "times the light of the first", "exposure_s")


def test_colour_profiles_that_bend_are_refused(mono, tmp_path):
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for end in ("png", "tif"):
        folder = tmp_path / end
        folder.mkdir()

        def write(path, frame, _, end=end):
            Image.fromarray(frame).save(f"{path}.{end}", icc_profile=profile)
            return end

        refused(mono.rewritten(folder, write), f".{end}", "transfer curve", "ICC")


# Exposure times that the manifest leaves to the files.


def exif_tiff(path, frame, time):
    """In IFD0, as a RAW-like TIFF has it."""
    tag = (EXPOSURE_TIME, 5, 1, (round(time * 1000), 1000), True)
    tifffile.imwrite(f"{path}.tif", frame, photometric="minisblack", metadata=None, extratags=[tag])
    return "tif"


def exif_of(time):
    exif = Image.Exif()
    exif[EXIF] = {EXPOSURE_TIME: IFDRational(round(time * 1000), 1000)}
    return exif


def exif_png(path, frame, time):
    Image.fromarray(frame).save(f"{path}.png", exif=exif_of(time))
    return "png"


def exif_ifd_tiff(path, frame, time):
    tags = ImageFileDirectory_v2()
    tags[EXIF] = {EXPOSURE_TIME: IFDRational(round(time * 1000), 1000)}
    Image.fromarray(frame).save(f"{path}.tif", tiffinfo=tags)
    return "tif"


def ome_tiff(path, frame, time):
    plane = {"ExposureTime": [1000 * time], "ExposureTimeUnit": ["ms"]}
    tifffile.imwrite(f"{path}.tif", frame, ome=True, metadata={"axes": "YX", "Plane": plane})
    return "tif"


def micro_manager_tiff(path, frame, time):
    text = json.dumps({"Exposure-ms": 1000 * time, "Camera": "x"})
    tag = (MICRO_MANAGER, "s", 0, text, True)
    tifffile.imwrite(f"{path}.tif", frame, photometric="minisblack", metadata=None, extratags=[tag])
    return "tif"


def named_pgm(path, frame, time):
    imageio.imwrite(f"{path}_{1000 * time:g}ms.pgm", frame)
    return "pgm"


def exr_time(path, frame, time):
    header = {"type": OpenEXR.scanlineimage, "expTime": float(time)}
    OpenEXR.File(header, {"Y": frame.astype(np.float32)}).write(f"{path}.exr")
    return "exr"


TIMED = {
    "exif-ifd0": (exif_tiff, "EXIF"),
    "exif-ifd": (exif_ifd_tiff, "EXIF"),
    "exif-png": (exif_png, "EXIF"),
    "fits-seconds": (fits_file(EXPTIME=(lambda s: s, "[s] exposure")), "FITS header"),
    "fits-minutes": (fits_file(EXPOSURE=(lambda s: s / 60, "Exposure time minutes")), "FITS header"),
    "fits-ms": (fits_file(EXPTIME=(lambda s: 1000 * s, "exposure in ms")), "FITS header"),
    "exr": (exr_time, "OpenEXR header"),
    "ome": (ome_tiff, "OME-XML"),
    "micro-manager": (micro_manager_tiff, "Micro-Manager metadata"),
    "name": (named_pgm, "file name"),
}


@pytest.mark.parametrize("name", TIMED)
def test_exposure_times_are_found(mono, name, tmp_path):
    write, source = TIMED[name]
    mono.rewritten(tmp_path, write)
    end = next((tmp_path / "sample").iterdir()).suffix[1:]
    (tmp_path / "capture.toml").write_text(mono.patterns(end))
    layers, notes = merged(tmp_path)
    for layer, expected in mono.layers.items():
        np.testing.assert_allclose(layers[layer], expected, rtol=2e-6, err_msg=layer)
    assert f"sample.frames: 3 exposure times from the {source}" in notes, notes


def test_fits_without_a_unit_asks_for_it(mono, tmp_path):
    mono.rewritten(tmp_path, fits_file(EXPTIME=(lambda s: 1000 * s, "shutter open")))
    manifest = mono.patterns("fits")
    (tmp_path / "capture.toml").write_text(manifest)
    refused(tmp_path, "_01.fits", "EXPTIME = 1 and no unit", "fits_exposure_unit")
    stated = manifest.replace("[camera]\n", '[camera]\nfits_exposure_unit = "ms"\n')
    (tmp_path / "capture.toml").write_text(stated)
    mono.same(tmp_path)


def test_no_time_at_all_is_named(mono, tmp_path):
    mono.rewritten(tmp_path, by_imageio("pgm"))
    (tmp_path / "capture.toml").write_text(mono.patterns("pgm"))
    refused(tmp_path, "sample_01.pgm", "exposure time")
    (tmp_path / "capture.toml").write_text(mono.patterns("bmp"))
    refused(tmp_path, "sample.frames", "*.bmp", "no file matches")


# What does not fit together.


def test_metadata_that_contradict_the_manifest_are_named(mono, tmp_path):
    folder = mono.rewritten(tmp_path, exif_tiff)
    assert not [note for note in mono.same(folder) if "the manifest says" in note]
    exif_tiff(folder / "sample/sample_03", mono.frames["sample/sample_03"], 0.25)
    notes = [note for note in mono.same(folder) if "the manifest says" in note]
    assert len(notes) == 1, notes
    for word in ("sample_03.tif", "0.5 s", "0.25 s", "EXIF"):
        assert word in notes[0]
    # A third of a stop is what cameras round by.
    exif_tiff(folder / "sample/sample_03", mono.frames["sample/sample_03"], 0.55)
    assert not [note for note in mono.same(folder) if "the manifest says" in note]


def test_mixtures_and_copies_are_named(mono, tmp_path):
    folder = mono.rewritten(tmp_path, tiff())
    frame = folder / "sample/sample_02.tif"
    kept = frame.read_bytes()
    tifffile.imwrite(frame, mono.frames["sample/sample_02"].astype(np.float32), metadata=None)
    refused(folder, "capture.toml", "sample/sample_02.tif", "floating-point", "16-bit")
    shutil.copy(folder / "sample/sample_01.tif", frame)
    refused(folder, "capture.toml", "sample/sample_02.tif", "very bytes of sample/sample_01.tif")
    frame.write_bytes(kept)
    for name, camera in (("sample/sample_01", "A"), ("sample/sample_03", "B")):
        tags = [(271, "s", 0, "Maker", True), (272, "s", 0, camera, True)]
        tifffile.imwrite(folder / f"{name}.tif", mono.frames[name], metadata=None, extratags=tags)
    refused(folder, "capture.toml", "sample_03.tif", "`Maker B`", "`Maker A`")
    for name, iso in (("sample/sample_01", 100), ("sample/sample_03", 200)):
        tags = [(34855, 3, 1, iso, True)]
        tifffile.imwrite(folder / f"{name}.tif", mono.frames[name], metadata=None, extratags=tags)
    refused(folder, "capture.toml", "sample_03.tif", "ISO 200", "ISO 100", "one gain")


def test_twelve_bits_in_sixteen_are_recognised(mono, tmp_path):
    def high(path, frame, time):
        return tiff()(path, frame & 0xFFF0, time)

    _, notes = merged(mono.rewritten(tmp_path, high))
    assert any("multiple of 16: 12-bit" in note for note in notes), notes


# Mosaics of a colour filter array.


def mosaic_tags(time, pattern=PATTERN):
    """The tags that TIFF/EP and DNG share."""
    colours = bytes("RGB".index(colour) for colour in pattern)
    return [
        (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, colours, True),
        (EXPOSURE_TIME, 5, 1, (round(time * 1000), 1000), True),
    ]


def dng(border=(0, 0), pattern=PATTERN, **options):
    """A DNG, with a border of photosites that see no light; rawpy reads it to the same counts."""

    def write(path, frame, time):
        top, left = border
        data = np.pad(frame, ((top, 1), (left, 2)), constant_values=3)
        height, width = frame.shape
        matrix = (1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1)
        tags = [
            *mosaic_tags(time, pattern),
            (50706, 1, 4, bytes([1, 4, 0, 0]), True),
            (50708, 2, 0, "Maker Model", True),
            (50717, 4, 1, 60000, True),
            (50721, 10, 9, matrix, True),
            (50829, 4, 4, (top, left, top + height, left + width), True),
        ]
        tifffile.imwrite(
            f"{path}.dng", data, photometric="cfa", metadata=None, extratags=tags, **options
        )
        if not options:
            with rawpy.imread(f"{path}.dng") as raw:
                # What it calls visible begins at even photosites.
                active = np.s_[top : top + height, left : left + width]
                np.testing.assert_array_equal(raw.raw_image[active], frame)
                colours = raw.raw_colors[active][:2, :2].ravel()
                assert "".join("RGBG"[colour] for colour in colours) == pattern
        return "dng"

    return write


def cfa_tiff(path, frame, time):
    tifffile.imwrite(
        f"{path}.tif", frame, photometric="cfa", metadata=None, extratags=mosaic_tags(time)
    )
    return "tif"


MOSAICS = {
    "dng": dng(),
    "dng-border": dng(border=(3, 5)),
    "dng-deflate": dng(compression="deflate"),
    "dng-big-endian": dng(byteorder=">"),
    "tiff": cfa_tiff,
    "fits": fits_file(BAYERPAT=(lambda _: PATTERN, "")),
    "fits-offset": fits_file(BAYERPAT=(lambda _: "RGGB", ""), XBAYROFF=(lambda _: 1, "")),
}


@pytest.mark.parametrize("name", MOSAICS)
def test_a_mosaic_says_its_pattern_itself(bayer, name, tmp_path):
    folder = bayer.rewritten(tmp_path, MOSAICS[name])
    manifest = (folder / "capture.toml").read_text()
    stated = f'mosaic = "{PATTERN}"\n'
    assert stated in manifest
    (folder / "capture.toml").write_text(manifest.replace(stated, ""))
    notes = bayer.same(folder)
    assert any(note.startswith(f"sample: mosaic {PATTERN}") for note in notes), notes


def test_a_mosaic_is_one_plane(bayer):
    assert sorted(bayer.layers) == ["mosaic", "mosaic.variance"]


def test_exposure_times_of_a_dng(bayer, tmp_path):
    bayer.rewritten(tmp_path, dng())
    (tmp_path / "capture.toml").write_text(bayer.patterns("dng"))
    assert "sample.frames: 3 exposure times from the EXIF" in bayer.same(tmp_path)


def test_patterns_that_contradict_are_named(bayer, tmp_path):
    folder = bayer.rewritten(tmp_path, dng())
    dng(pattern="RGGB")(folder / "sample/sample_02", bayer.frames["sample/sample_02"], 0.02)
    refused(folder, "sample_02.dng", "the mosaic RGGB", f'camera.mosaic = "{PATTERN}"')
    manifest = (folder / "capture.toml").read_text()
    (folder / "capture.toml").write_text(manifest.replace(f'mosaic = "{PATTERN}"\n', ""))
    refused(folder, "sample/sample_02.dng", "mosaic RGGB", f"mosaic {PATTERN}", "one camera")


def test_a_compressed_dng_is_answered_with_how_to_get_it(bayer, tmp_path):
    folder = bayer.rewritten(tmp_path, dng())
    path = folder / "sample/sample_02.dng"
    lossless = Path(__file__).parents[2] / "fixtures/frames/raw/lossless.dng"
    shutil.copy(lossless, path)
    refused(folder, "sample_02.dng", "camera RAW (DNG)", "--features raw", "uncompressed DNG")


# A folder without a manifest.


def test_init_writes_what_it_can_and_names_the_rest(mono, tmp_path):
    mono.rewritten(tmp_path, exif_png)
    manifest = tmp_path / "capture.toml"
    manifest.unlink()
    done = run("init", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    unknown = "\n".join(document["unknown"])
    for field in ("eta", "mm_per_pixel", "fwhm_mm", "gain_e_per_dn", "reflectance"):
        assert field in unknown, unknown
    assert any("EXIF" in line for line in document["found"]), document["found"]
    refused(tmp_path, "capture.toml", "`eta`", "`geometry.mm_per_pixel`", '"?"')
    again = run("init", tmp_path)
    assert again.returncode == 3 and "exists" in again.stderr

    def stated(key, section):
        text = mono.manifest.split(f"[{section}]")[1] if section else mono.manifest
        return re.search(rf"^{key} = (.*)$", text, re.M).group(1)

    text = manifest.read_text()
    for section, key in (
        ("", "eta"),
        ("geometry", "mm_per_pixel"),
        ("beam", "fwhm_mm"),
        ("camera", "gain_e_per_dn"),
        ("camera", "read_noise_e"),
        ("camera", "black_level_dn"),
        ("camera", "white_level_dn"),
        ("camera", "prnu_relative"),
        ("reference", "reflectance"),
        ("reference", "sigma_s_prime_per_mm"),
        ("reference", "sigma_a_per_mm"),
        # What they may be off decides what is stray light.
        ("reference", "u_sigma_s_prime_relative"),
        ("reference", "u_sigma_a_per_mm"),
        ("reference", "eta"),
    ):
        line = f"{key} = {stated(key, section)}"
        text, found = re.subn(rf"^(# )?{key} = .*$", line, text, count=1, flags=re.M)
        if not found or (section, key) == ("reference", "eta"):
            text = text.replace(f"[{section}]", f"[{section}]\n{line}")
    # The substitution of the reference's index hit the sample's, which comes first.
    text = re.sub(r"^eta = .*$", f"eta = {stated('eta', '')}", text, count=1, flags=re.M)
    manifest.write_text(text)
    mono.same(tmp_path)
