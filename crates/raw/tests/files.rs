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

/// The entry of the tag `number` in the first directory of a little-endian file.
fn entry(bytes: &[u8], number: u16) -> usize {
    let at = |from: usize| usize::from(u16::from_le_bytes([bytes[from], bytes[from + 1]]));
    let first = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let entries = (0..at(first)).map(|k| first + 2 + 12 * k);
    let mut found = entries.filter(|e| at(*e) == usize::from(number));
    found.next().unwrap()
}

/// Makes the entry at `at` one of `count` values of `kind`, which it holds itself or whose bytes
/// go to the end of the file.
fn set(bytes: &mut Vec<u8>, at: usize, number: u16, kind: u16, values: &[u8], count: u32) {
    let mut field = values.to_vec();
    if values.len() > 4 {
        field = (bytes.len() as u32).to_le_bytes().to_vec();
        bytes.extend(values);
    }
    field.resize(4, 0);
    bytes[at..at + 2].copy_from_slice(&number.to_le_bytes());
    bytes[at + 2..at + 4].copy_from_slice(&kind.to_le_bytes());
    bytes[at + 4..at + 8].copy_from_slice(&count.to_le_bytes());
    bytes[at + 8..at + 12].copy_from_slice(&field);
}

/// The pattern of a DNG begins with the active part, wherever that is.
#[test]
fn patterns_begin_with_the_active_part() {
    let x_trans = "GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG";
    for (pattern, side) in [("BGGR", 2_u16), (x_trans, 6)] {
        let colours: Vec<u8> = pattern
            .bytes()
            .map(|letter| "RGB".bytes().position(|c| c == letter).unwrap() as u8)
            .collect();
        for [top, left] in [[0_u32, 0], [1, 0], [2, 1], [5, 4], [7, 9]] {
            let mut bytes = read("lossless.dng");
            let repeat: Vec<u8> = [side; 2].iter().flat_map(|v| v.to_le_bytes()).collect();
            let at = entry(&bytes, 33421);
            set(&mut bytes, at, 33421, 3, &repeat, 2);
            let at = entry(&bytes, 33422);
            set(&mut bytes, at, 33422, 1, &colours, colours.len() as u32);
            let area: Vec<u8> = [top, left, 60, 80]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect();
            let at = entry(&bytes, 50717);
            set(&mut bytes, at, 50829, 4, &area, 4);
            let raw = raw::decode(&bytes).unwrap();
            assert_eq!(raw.mosaic.unwrap().to_string(), pattern, "{top}, {left}");
            let size = (raw.frame.width, raw.frame.height);
            assert_eq!(size, (80 - left as usize, 60 - top as usize));
            let Samples::U16(samples) = &raw.frame.samples else {
                panic!("counts are whole numbers");
            };
            let expected = (257 * (left as usize % 22) + 1009 * (top as usize % 16)) % (1 << 14);
            assert_eq!(usize::from(samples[0]), expected / 4 + 100);
        }
    }
}

#[test]
fn a_roll_of_several_pictures_is_refused() {
    let mut bytes = read("canon-r6.cr3");
    let places = bytes.windows(4).enumerate().filter(|(_, w)| w == b"stsz");
    let places: Vec<usize> = places.map(|(at, _)| at).collect();
    for at in places {
        // After the version: one size for all samples, and how many they are.
        bytes[at + 8..at + 12].copy_from_slice(&100_u32.to_be_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&3_u32.to_be_bytes());
    }
    let error = raw::decode(&bytes).unwrap_err().to_string();
    assert!(error.contains("holds 3 pictures"), "{error}");
}
