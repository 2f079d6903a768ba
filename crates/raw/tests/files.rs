//! Files of cameras and of an independent writer, whole, cut short and damaged.

#![cfg(feature = "rawler")]
#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

use cap::Cap;
use physics::Samples;
use std::alloc::System;
use std::fs;
use std::path::Path;

/// The camera database of the decoders takes some of it. An allocation beyond this ends the test.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, 400 << 20);

fn read(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/frames/raw");
    fs::read(folder.join(name)).unwrap()
}

/// What `fixtures/frames/make.py` compressed: (257 x + 1009 y) mod 2^14, over 4, plus 100, in tiles
/// of 22 x 16 photosites.
#[test]
fn lossless_counts_are_where_they_were_put() {
    let bytes = read("lossless.dng");
    let raw = raw::decode(&bytes).unwrap();
    assert_eq!((raw.frame.width, raw.frame.height), (88, 64));
    assert_eq!(raw.mosaic.unwrap().to_string(), "GRBG");
    assert_eq!(raw.white_level_dn, 16383.0);
    let Samples::U16(samples) = &raw.frame.samples else {
        panic!("counts are whole numbers");
    };
    for (i, found) in samples.iter().enumerate() {
        let (x, y) = (i % 88 % 22, i / 88 % 16);
        let expected = (257 * x + 1009 * y) % (1 << 14) / 4 + 100;
        assert_eq!(usize::from(*found), expected, "{i}");
    }
}

#[test]
fn a_file_cut_at_any_tenth_is_an_error() {
    for name in ["lossless.dng", "canon-r6.cr3", "fujifilm_x_t1_01.raf.meta"] {
        let bytes = read(name);
        for tenth in 0..10 {
            let cut = &bytes[..bytes.len() * tenth / 10];
            assert!(raw::decode(cut).is_err(), "{name}: {tenth} tenths");
        }
    }
}
