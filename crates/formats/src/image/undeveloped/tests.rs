//! Odd DNGs: each is read right, or refused with its reason.

use super::super::{ImageError, Oddity, decode_frame};
use super::*;

/// Values of a tag.
#[derive(Clone)]
enum Value {
    Bytes(Vec<u8>),
    Short(Vec<u16>),
    Long(Vec<u32>),
    Ratio(Vec<[u32; 2]>),
    Undefined(Vec<u8>),
    Float(Vec<f32>),
}

/// A directory with its pixels and those below it.
#[derive(Clone, Default)]
struct Picture {
    tags: Vec<(u16, Value)>,
    pixels: Vec<u8>,
    below: Vec<Picture>,
}

impl Picture {
    /// The same with the tag `number` as `value`.
    fn with(mut self, number: u16, value: Value) -> Self {
        self.tags.retain(|tag| tag.0 != number);
        self.tags.push((number, value));
        self
    }

    fn without(mut self, number: u16) -> Self {
        self.tags.retain(|tag| tag.0 != number);
        self
    }
}

const WIDTH: usize = 8;
const HEIGHT: usize = 6;

fn two(big: bool, value: u16) -> [u8; 2] {
    if big {
        value.to_be_bytes()
    } else {
        value.to_le_bytes()
    }
}

fn four(big: bool, value: u32) -> [u8; 4] {
    if big {
        value.to_be_bytes()
    } else {
        value.to_le_bytes()
    }
}

/// Writes `picture` at the end of `out` and says where its directory stands.
fn write(out: &mut Vec<u8>, big: bool, picture: &Picture) -> u32 {
    let below: Vec<u32> = picture.below.iter().map(|p| write(out, big, p)).collect();
    let at = out.len() as u32;
    out.extend(&picture.pixels);
    let mut tags = picture.tags.clone();
    let tiled = tags.iter().any(|tag| tag.0 == 322);
    let [offsets, counts] = if tiled { [324, 325] } else { [273, 279] };
    tags.push((offsets, Value::Long(vec![at])));
    tags.push((counts, Value::Long(vec![picture.pixels.len() as u32])));
    if !below.is_empty() {
        tags.push((SUB_DIRECTORIES, Value::Long(below)));
    }
    tags.sort_by_key(|tag| tag.0);
    let mut directory = two(big, tags.len() as u16).to_vec();
    for (number, value) in tags {
        let (kind, count, mut bytes): (u16, usize, Vec<u8>) = match value {
            Value::Bytes(all) => (1, all.len(), all),
            Value::Undefined(all) => (7, all.len(), all),
            Value::Short(all) => (
                3,
                all.len(),
                all.iter().flat_map(|v| two(big, *v)).collect(),
            ),
            Value::Long(all) => (
                4,
                all.len(),
                all.iter().flat_map(|v| four(big, *v)).collect(),
            ),
            Value::Ratio(all) => (
                5,
                all.len(),
                all.iter().flatten().flat_map(|v| four(big, *v)).collect(),
            ),
            Value::Float(all) => (
                11,
                all.len(),
                all.iter().flat_map(|v| four(big, v.to_bits())).collect(),
            ),
        };
        directory.extend(two(big, number));
        directory.extend(two(big, kind));
        directory.extend(four(big, count as u32));
        if bytes.len() <= 4 {
            bytes.resize(4, 0);
            directory.extend(bytes);
        } else {
            directory.extend(four(big, out.len() as u32));
            out.extend(bytes);
        }
    }
    directory.extend([0; 4]);
    let at = out.len() as u32;
    out.extend(directory);
    at
}

/// A file of `picture`.
fn file(big: bool, picture: &Picture) -> Vec<u8> {
    let mut out = if big {
        b"MM\0\x2a\0\0\0\0".to_vec()
    } else {
        b"II\x2a\0\0\0\0\0".to_vec()
    };
    let first = write(&mut out, big, picture);
    out[4..8].copy_from_slice(&four(big, first));
    out
}

/// The count of the photosite at `i`.
fn count(i: usize) -> u16 {
    (100 + 3 * i) as u16
}

fn counts() -> Vec<u16> {
    (0..WIDTH * HEIGHT).map(count).collect()
}

/// A directory with the size and the kind of its samples, without pixels.
fn empty(photometric: u16, bits: u16) -> Picture {
    Picture::default()
        .with(256, Value::Long(vec![WIDTH as u32]))
        .with(257, Value::Long(vec![HEIGHT as u32]))
        .with(258, Value::Short(vec![bits]))
        .with(COMPRESSION, Value::Short(vec![1]))
        .with(PHOTOMETRIC, Value::Short(vec![photometric]))
        .with(SAMPLES_PER_PIXEL, Value::Short(vec![1]))
        .with(278, Value::Long(vec![HEIGHT as u32]))
}

/// The counts of a Bayer sensor without what makes a DNG of it.
fn bayer(big: bool) -> Picture {
    Picture {
        pixels: counts().into_iter().flat_map(|v| two(big, v)).collect(),
        ..empty(CFA, 16)
    }
    .with(CFA_REPEAT, Value::Short(vec![2, 2]))
    .with(CFA_PATTERN, Value::Bytes(vec![1, 0, 2, 1]))
}

fn version(picture: Picture) -> Picture {
    picture.with(DNG_VERSION, Value::Bytes(vec![1, 4, 0, 0]))
}

fn dng() -> Picture {
    version(bayer(false))
}

/// A preview with `below` as the pictures below it.
fn preview(subfile: u32, below: Vec<Picture>) -> Picture {
    let picture = Picture {
        pixels: vec![9; WIDTH * HEIGHT],
        below,
        ..empty(1, 8)
    };
    version(picture).with(NEW_SUBFILE_TYPE, Value::Long(vec![subfile]))
}

/// A list of corrections: the numbers of the opcodes, each with some bytes.
fn opcodes(list: &[(u32, usize)]) -> Value {
    let mut bytes = (list.len() as u32).to_be_bytes().to_vec();
    for (opcode, length) in list {
        for number in [*opcode, 0x0103_0000, 0, *length as u32] {
            bytes.extend(number.to_be_bytes());
        }
        // Whatever they hold, they are no opcodes.
        bytes.extend(vec![7; *length]);
    }
    Value::Undefined(bytes)
}

const X_TRANS: [u8; 36] = [
    1, 2, 1, 1, 0, 1, //
    0, 1, 0, 2, 1, 2, //
    1, 2, 1, 1, 0, 1, //
    1, 0, 1, 1, 2, 1, //
    2, 1, 2, 0, 1, 0, //
    1, 0, 1, 1, 2, 1,
];

/// What the whole of a picture is to be read as.
struct Expected {
    mosaic: Option<&'static str>,
    samples: Vec<u16>,
    white: Option<f64>,
    aspect: f64,
    step: u16,
}

fn as_counted() -> Expected {
    Expected {
        mosaic: Some("GRBG"),
        samples: counts(),
        white: None,
        aspect: 1.0,
        step: 1,
    }
}

#[test]
fn what_a_developer_would_use_does_not_change_the_counts() {
    let cut = |[top, left, bottom, right]: [usize; 4]| -> Vec<u16> {
        let rows = top..bottom;
        rows.flat_map(|y| (left..right).map(move |x| count(WIDTH * y + x)))
            .collect()
    };
    let area = |area: [u32; 4]| Value::Long(area.to_vec());
    let pattern = |cell: [u8; 4]| dng().with(CFA_PATTERN, Value::Bytes(cell.to_vec()));
    let of = |mosaic| Expected {
        mosaic: Some(mosaic),
        ..as_counted()
    };
    // Beyond the end of a table its last count holds.
    let bent: Vec<u16> = (0..200_u16).map(|v| v + v * v / 64).collect();
    let tile = {
        let mut pixels = vec![];
        for y in 0..16 {
            for x in 0..16 {
                let inside = x < WIDTH && y < HEIGHT;
                let value = if inside { count(WIDTH * y + x) } else { 65_535 };
                pixels.extend(value.to_le_bytes());
            }
        }
        Picture { pixels, ..dng() }
            .with(322, Value::Long(vec![16]))
            .with(323, Value::Long(vec![16]))
            .without(278)
    };
    let cases = [
        ("as it is", dng(), as_counted()),
        ("tiles", tile, as_counted()),
        ("BGGR", pattern([2, 1, 1, 0]), of("BGGR")),
        ("GBRG", pattern([1, 2, 0, 1]), of("GBRG")),
        (
            "ActiveArea, with which the pattern begins",
            dng().with(ACTIVE_AREA, area([1, 3, 5, 8])),
            Expected {
                samples: cut([1, 3, 5, 8]),
                ..as_counted()
            },
        ),
        (
            "X-Trans in an ActiveArea that is no whole cell away",
            dng()
                .with(CFA_REPEAT, Value::Short(vec![6, 6]))
                .with(CFA_PATTERN, Value::Bytes(X_TRANS.to_vec()))
                .with(ACTIVE_AREA, area([0, 1, 6, 7])),
            Expected {
                samples: cut([0, 1, 6, 7]),
                ..of("GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG")
            },
        ),
        (
            "BlackLevel, by place, row and column",
            dng()
                .with(50713, Value::Short(vec![2, 2]))
                .with(50714, Value::Short(vec![64, 65, 66, 67]))
                .with(50715, Value::Ratio(vec![[1, 2]; WIDTH]))
                .with(50716, Value::Ratio(vec![[3, 2]; HEIGHT])),
            as_counted(),
        ),
        (
            "WhiteLevel, the least of several",
            dng().with(WHITE_LEVEL, Value::Long(vec![60_000, 50_000])),
            Expected {
                white: Some(50_000.0),
                ..as_counted()
            },
        ),
        (
            "a table that changes nothing",
            dng().with(LINEARIZATION, Value::Short((0..1000).collect())),
            as_counted(),
        ),
        (
            "a table that ends early",
            dng().with(LINEARIZATION, Value::Short(bent.clone())),
            Expected {
                samples: counts()
                    .iter()
                    .map(|v| bent[usize::from(*v).min(199)])
                    .collect(),
                step: bent[199] - bent[198],
                ..as_counted()
            },
        ),
        (
            "turned",
            dng().with(ORIENTATION, Value::Short(vec![6])),
            as_counted(),
        ),
        (
            "bad pixels, a gain by place and the shape of a lens",
            dng()
                .with(OPCODE_LISTS[0], opcodes(&[(4, 8)]))
                .with(OPCODE_LISTS[1], opcodes(&[(9, 40), (9, 21)]))
                .with(51022, opcodes(&[(1, 64), (7, 16)])),
            as_counted(),
        ),
        (
            "BaselineExposure",
            dng().with(50730, Value::Ratio(vec![[3, 2]])),
            as_counted(),
        ),
        (
            "pixels twice as wide as high",
            dng().with(DEFAULT_SCALE, Value::Ratio(vec![[2, 1], [1, 1]])),
            Expected {
                aspect: 2.0,
                ..as_counted()
            },
        ),
        (
            "a preview first, then a small copy of the counts, then they",
            preview(
                1,
                vec![
                    bayer(false).with(NEW_SUBFILE_TYPE, Value::Long(vec![1])),
                    bayer(false).with(NEW_SUBFILE_TYPE, Value::Long(vec![0])),
                ],
            ),
            as_counted(),
        ),
        (
            "a preview that is not called one, beside counts that are not packed",
            preview(0, vec![bayer(false)]),
            as_counted(),
        ),
        (
            "without colours",
            dng().with(PHOTOMETRIC, Value::Short(vec![LINEAR_RAW as u16])),
            Expected {
                mosaic: None,
                ..as_counted()
            },
        ),
    ];
    for (name, picture, expected) in cases {
        let found = decode_frame(&file(false, &picture)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(found.frame.samples, expected.samples.into(), "{name}");
        let mosaic = found.mosaic.map(|mosaic| mosaic.to_string());
        assert_eq!(mosaic.as_deref(), expected.mosaic, "{name}");
        assert_eq!(found.white_level_dn, expected.white, "{name}");
        assert_eq!(found.pixel_aspect, expected.aspect, "{name}");
        assert_eq!(found.step_dn, expected.step, "{name}");
        assert_eq!(found.depth, Depth::Bits(16), "{name}");
    }
    let found = decode_frame(&file(true, &version(bayer(true)))).unwrap();
    assert_eq!(found.frame.samples, counts().into());
}

/// By the letter of DNG, floating point is full at 1.
#[test]
fn floating_point_is_read_in_both_widths() {
    let half = [0x3800_u16, 0x3555].repeat(WIDTH * HEIGHT / 2);
    let single = [0.5_f32, 0.333_251_95].repeat(WIDTH * HEIGHT / 2);
    let halves = half.iter().flat_map(|v| v.to_le_bytes()).collect();
    let singles: Vec<u8> = single.iter().flat_map(|v| v.to_le_bytes()).collect();
    for (bits, depth, pixels) in [(16, Depth::Half, halves), (32, Depth::Float, singles)] {
        let picture = Picture { pixels, ..dng() }
            .with(258, Value::Short(vec![bits]))
            .with(SAMPLE_FORMAT, Value::Short(vec![3]));
        let found = decode_frame(&file(false, &picture)).unwrap();
        assert_eq!(found.depth, depth);
        assert_eq!(found.frame.samples, Samples::F32(single.clone()));
        assert_eq!(found.white_level_dn, Some(1.0));
    }
}

#[test]
fn a_table_makes_counts_of_16_bits_from_8() {
    let table: Vec<u16> = (0..256).map(|v| v * v / 4).collect();
    let stored: Vec<u8> = (0..WIDTH * HEIGHT).map(|i| (5 * i) as u8).collect();
    let picture = Picture {
        pixels: stored.clone(),
        ..dng()
    }
    .with(258, Value::Short(vec![8]))
    .with(LINEARIZATION, Value::Short(table.clone()));
    let found = decode_frame(&file(false, &picture)).unwrap();
    assert_eq!((found.depth, found.step_dn), (Depth::Bits(16), 127));
    let expected: Vec<u16> = stored.iter().map(|v| table[usize::from(*v)]).collect();
    assert_eq!(found.linear(false).unwrap().samples, expected.into());
}

/// The beginning of a JPEG whose frame is of the kind `marker`.
fn jpeg(marker: u8) -> Vec<u8> {
    let tables = [0xff, 0xc4, 0, 4, 1, 2];
    [&[0xff, 0xd8][..], &tables, &[0xff, marker, 0, 3, 8]].concat()
}

#[test]
fn what_would_be_read_wrong_is_refused_with_its_reason() {
    let with = |tag, value| dng().with(tag, value);
    let packed = |compression: u16, pixels: Vec<u8>| {
        Picture { pixels, ..dng() }.with(COMPRESSION, Value::Short(vec![compression]))
    };
    let xl = packed(JPEG_XL as u16, vec![0xff, 0x0a, 0, 0]);
    let float = dng()
        .with(258, Value::Short(vec![24]))
        .with(SAMPLE_FORMAT, Value::Short(vec![3]));
    let cases = [
        (with(CFA_LAYOUT, Value::Short(vec![2])), "whose pattern"),
        (dng().without(CFA_PATTERN), "whose pattern is missing"),
        (
            with(CFA_PATTERN, Value::Bytes(vec![0, 1, 2, 3])),
            "whose pattern",
        ),
        (
            with(CFA_PLANE_COLOUR, Value::Bytes(vec![0, 1, 3])),
            "whose pattern",
        ),
        (
            with(CFA_PATTERN, Value::Bytes(vec![0, 1, 2, 1, 2, 0, 2, 0, 1]))
                .with(CFA_REPEAT, Value::Short(vec![3, 3])),
            "whose pattern",
        ),
        (
            with(ACTIVE_AREA, Value::Long(vec![0, 0, 4])),
            "ActiveArea is no part",
        ),
        (
            with(ACTIVE_AREA, Value::Long(vec![0, 0, 7, 8])),
            "ActiveArea is no part",
        ),
        (
            with(LINEARIZATION, Value::Short(vec![])),
            "LinearizationTable is no list",
        ),
        (
            with(PHOTOMETRIC, Value::Short(vec![LINEAR_RAW as u16]))
                .with(SAMPLES_PER_PIXEL, Value::Short(vec![3])),
            "has 3 samples a pixel: it was demosaiced",
        ),
        (
            packed(LOSSY_JPEG as u16, jpeg(0xc0)),
            "compressed with loss (JPEG)",
        ),
        (
            packed(JPEG as u16, jpeg(0xc0)),
            "compressed with loss (JPEG)",
        ),
        (packed(JPEG as u16, jpeg(LOSSLESS)), "camera RAW (DNG)"),
        (xl.clone(), "with loss (JPEG XL"),
        (
            xl.clone().with(JXL_DISTANCE, Value::Float(vec![1.0])),
            "with loss (JPEG XL",
        ),
        (
            xl.with(JXL_DISTANCE, Value::Float(vec![0.0])),
            "camera RAW (DNG)",
        ),
        (
            with(OPCODE_LISTS[0], opcodes(&[(7, 16)])),
            "to be bent (MapTable)",
        ),
        (
            with(OPCODE_LISTS[1], opcodes(&[(9, 21), (8, 16)])),
            "to be bent (MapPolynomial)",
        ),
        (with(ROW_INTERLEAVE, Value::Long(vec![2])), "interleaved"),
        (with(COLUMN_INTERLEAVE, Value::Long(vec![2])), "interleaved"),
        (with(SUB_TILE_BLOCK, Value::Long(vec![2, 2])), "interleaved"),
        (
            Picture {
                below: vec![bayer(false)],
                ..dng()
            },
            "several images",
        ),
        (preview(1, vec![]), "no picture of the sensor's own counts"),
        (preview(0, vec![]), "no picture of the sensor's own counts"),
        // The decoder of camera RAW would take the preview.
        (
            preview(0, vec![packed(JPEG as u16, jpeg(LOSSLESS))]),
            "several images",
        ),
        (
            preview(1, vec![packed(JPEG as u16, jpeg(LOSSLESS))]),
            "camera RAW (DNG)",
        ),
        (float, "found 24 bits per sample"),
    ];
    for (picture, expected) in cases {
        let found = decode_frame(&file(false, &picture)).unwrap_err();
        let found = found.to_string();
        assert!(found.contains(expected), "{expected}: {found}");
    }
}

#[test]
fn what_is_unpacked_elsewhere_passes_the_table_here() {
    let table: Vec<u16> = (0..4096).map(|v| 2 * v).collect();
    for big in [false, true] {
        let bytes = file(
            big,
            &Picture {
                pixels: jpeg(LOSSLESS),
                ..version(bayer(big))
            }
            .with(COMPRESSION, Value::Short(vec![JPEG as u16]))
            .with(WHITE_LEVEL, Value::Long(vec![8000]))
            .with(LINEARIZATION, Value::Short(table.clone())),
        );
        let packed = PackedDng::find(&bytes).unwrap();
        let hidden = packed.without_table(&bytes).unwrap();
        let again = PackedDng::find(&hidden).unwrap();
        assert!(again.without_table(&hidden).is_none());
        let changed = bytes.iter().zip(&hidden).filter(|(a, b)| a != b).count();
        assert_eq!((hidden.len(), changed), (bytes.len(), 2));
        let frame = Frame {
            width: WIDTH,
            height: HEIGHT,
            channels: 1,
            samples: counts().into(),
        };
        let found = packed.counts(frame.clone(), Depth::Bits(12)).unwrap();
        let doubled: Vec<u16> = counts().iter().map(|v| 2 * v).collect();
        assert_eq!(found.frame.samples, doubled.into());
        assert_eq!((found.depth, found.step_dn), (Depth::Bits(16), 2));
        assert_eq!(found.white_level_dn, Some(8000.0));
        let float = Frame {
            samples: Samples::F32(frame.samples.to_f32()),
            ..frame
        };
        let error = packed.counts(float, Depth::Float).unwrap_err();
        assert!(matches!(error, ImageError::Odd(Oddity::Table)), "{error}");
    }
}
