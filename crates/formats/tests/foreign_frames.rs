//! Frames written by other programs, whole, cut short and damaged, with little memory to spare.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

use cap::Cap;
use formats::metadata::Metadata;
use formats::{Depth, decode_frame};
use physics::Samples;
use std::alloc::System;
use std::fs;
use std::path::{Path, PathBuf};

/// No file here holds more than 10 kB; a size in a header that is believed needs gigabytes. An
/// allocation beyond this ends the test.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, 64 << 20);

const WIDTH: usize = 23;
const HEIGHT: usize = 17;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/frames")
}

fn small() -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = fs::read_dir(folder().join("small"))
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, fs::read(path).unwrap())
        })
        .collect();
    files.sort();
    assert!(files.len() > 30, "{}", files.len());
    files
}

/// What `make.py` writes: (257 x + 1009 y + 4001 c) mod 2^bits, over 8 less 100 in floating point.
#[test]
fn every_sample_is_where_it_was_put() {
    for (name, bytes) in small() {
        let decoded = decode_frame(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        let frame = decoded.frame;
        let channels = if name.starts_with("gray") { 1 } else { 3 };
        assert_eq!((frame.width, frame.height), (WIDTH, HEIGHT), "{name}");
        assert_eq!(frame.channels, channels, "{name}");
        let kind = name.trim_start_matches("gray").trim_start_matches("rgb");
        let (bits, float) = match kind.as_bytes() {
            [b'8', ..] => (8, false),
            [b'1', b'2', ..] => (12, false),
            [b'1', b'4', ..] => (14, false),
            [b'1', b'6', ..] | [b'3', b'2', ..] => (16, false),
            _ => (16, true),
        };
        match decoded.depth {
            Depth::Half | Depth::Float => assert!(float, "{name}"),
            Depth::Bits(found) => {
                let expected = if kind.starts_with("32") { 32 } else { bits };
                assert_eq!(found, expected, "{name}");
            }
        }
        assert_eq!(matches!(frame.samples, Samples::F32(_)), float, "{name}");
        let mosaic = decoded.mosaic.map(|mosaic| mosaic.to_string());
        let expected = name.contains("cfa").then_some("GRBG");
        assert_eq!(mosaic.as_deref(), expected, "{name}");
        let white = name.ends_with(".dng").then_some(60_000.0);
        assert_eq!(decoded.white_level_dn, white, "{name}");
        let samples = frame.samples.to_f32();
        for (i, found) in samples.iter().enumerate() {
            let (x, y, c) = (i / channels % WIDTH, i / channels / WIDTH, i % channels);
            let count = ((257 * x + 1009 * y + 4001 * c) % (1 << bits)) as f32;
            let expected = if float { count / 8.0 - 100.0 } else { count };
            assert_eq!(*found, expected, "{name}: {x}, {y}, {c}");
        }
    }
}

#[test]
fn a_file_cut_at_any_tenth_is_an_error() {
    for (name, bytes) in small() {
        for tenth in 0..10 {
            let cut = &bytes[..bytes.len() * tenth / 10];
            // FITS pads its pixels to a block of 2880 bytes, which may be cut without loss.
            let whole =
                name.ends_with(".fits") && decode_frame(cut).ok() == decode_frame(&bytes).ok();
            assert!(
                whole || decode_frame(cut).is_err(),
                "{name}: {tenth} tenths"
            );
            let _ = Metadata::read(cut);
        }
    }
}

/// 2³¹ and 2³² − 1 in every place of headers and directories, in both byte orders, and of BigTIFF
/// 2⁶³ as well: what comes is a frame of the same size or an error, and no gigabyte is asked for.
#[test]
fn a_size_beyond_the_file_is_not_believed() {
    let mut refused = 0;
    for (name, bytes) in small() {
        let n = bytes.len();
        let places = (0..n.min(700)).chain(n.saturating_sub(400).max(700)..n);
        for at in places.filter(|at| at + 4 <= n) {
            let mut sizes = vec![
                0x8000_0000_u32.to_le_bytes().to_vec(),
                0x8000_0000_u32.to_be_bytes().to_vec(),
                u32::MAX.to_le_bytes().to_vec(),
            ];
            if name.contains("-big") && at + 8 <= n {
                sizes.push((1_u64 << 63).to_le_bytes().to_vec());
                sizes.push((1_u64 << 63).to_be_bytes().to_vec());
            }
            for size in sizes {
                let mut damaged = bytes.clone();
                damaged[at..at + size.len()].copy_from_slice(&size);
                match decode_frame(&damaged) {
                    Ok(decoded) => assert!(
                        decoded.frame.samples.len() <= 8 * damaged.len() * 1100,
                        "{name} at {at}"
                    ),
                    Err(_) => refused += 1,
                }
                let _ = Metadata::read(&damaged);
            }
        }
    }
    assert!(refused > 1000, "{refused}");
}

/// The same in digits, for the formats whose headers are text.
#[test]
fn a_size_of_two_to_the_31_in_words_is_not_believed() {
    for (name, bytes) in small() {
        let (from, to): (&[u8], &[u8]) = if name.ends_with(".fits") {
            (
                b"NAXIS1  =                   23",
                b"NAXIS1  =           2147483648",
            )
        } else if name.ends_with("m") {
            (b"23 17", b"2147483648 2147483648")
        } else {
            continue;
        };
        let at = bytes.windows(from.len()).position(|w| w == from);
        let at = at.unwrap_or_else(|| panic!("{name}"));
        let damaged = [&bytes[..at], to, &bytes[at + from.len()..]].concat();
        let error = decode_frame(&damaged).unwrap_err().to_string();
        assert!(error.contains("cut short"), "{name}: {error}");
    }
}

/// Dimensions, checked against other readers: the sums are those of numpy on the same files.
#[test]
fn real_files_are_read_or_refused_with_their_reason() {
    let read = |name: &str| decode_frame(&fs::read(folder().join(name)).unwrap());
    for (name, size, bits, sum, saturated) in [
        ("M51.fits", (512, 512), 16, 28_394_234.0, 65535),
        ("M6707HH.fits", (1059, 1059), 16, 4_473_129_377.0, 65535),
        ("t-210mm.pgm", (800, 800), 8, 4_504_377.0, 255),
        ("TEM00_140mm.pgm", (1280, 960), 16, 3_169_876_873.0, 65535),
    ] {
        let decoded = read(name).unwrap();
        let frame = &decoded.frame;
        assert_eq!((frame.width, frame.height), size, "{name}");
        assert_eq!(decoded.depth, Depth::Bits(bits), "{name}");
        let samples = frame.samples.to_f32();
        let found: f64 = samples.iter().map(|s| f64::from(*s)).sum();
        assert_eq!(found, sum, "{name}");
        assert!(samples.iter().all(|s| *s <= saturated as f32), "{name}");
    }
    // What the makers of cameras keep to themselves.
    let error = decode_frame(&fs::read(folder().join("raw/lossless.dng")).unwrap());
    let error = error.unwrap_err().to_string();
    for words in ["camera RAW (DNG)", "`--features raw`", "uncompressed DNG"] {
        assert!(error.contains(words), "{error}");
    }
    for (name, format) in [
        ("canon-r6.cr3", "CR3"),
        ("fujifilm_x_t1_01.raf.meta", "RAF"),
    ] {
        let error = read(&format!("raw/{name}")).unwrap_err().to_string();
        assert!(error.contains(&format!("camera RAW ({format})")), "{error}");
    }
    // A photograph of 8 bits in packbits.
    let error = read("tif.tif").unwrap().linear(false).unwrap_err();
    assert!(
        error.to_string().contains("response = \"linear\""),
        "{error}"
    );
    // Its maker left the checksums out.
    let error = read("exif.png").unwrap_err();
    assert!(error.to_string().contains("CRC"), "{error}");
}

#[test]
fn every_fixture_says_the_same_however_much_is_read() {
    let mut stated = 0;
    for entry in fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if !path.is_file() {
            continue;
        }
        let bytes = fs::read(&path).unwrap();
        // Whatever is cut off counts as absent, either way.
        for tenth in 0..=10 {
            let part = &bytes[..bytes.len() * tenth / 10];
            let found = Metadata::of_file(&mut std::io::Cursor::new(part)).unwrap();
            assert_eq!(found, Metadata::read(part), "{} {tenth}", path.display());
            if tenth == 10 {
                stated += found.exposures.len();
            }
        }
    }
    assert!(stated > 3, "{stated}");
}
