//! The undeveloped picture of a TIFF or DNG: one sample a photosite.
//!
//! Where it stands and what colours it has is read here; its pixels are decoded as those of any
//! gray TIFF, through [`Patched`], which shows the decoder a file of that one picture.

use super::{Oddity, tiff::CFA};
use crate::metadata::tags::{Directory, File};
use physics::{Frame, Mosaic, Samples};
use std::io::{self, Cursor, Read, Seek, SeekFrom};

const NEW_SUBFILE_TYPE: u16 = 254;
const COMPRESSION: u16 = 259;
const PHOTOMETRIC: u16 = 262;
const MAKE: u16 = 271;
const ORIENTATION: u16 = 274;
const SUB_DIRECTORIES: u16 = 330;
const CFA_REPEAT: u16 = 33421;
const CFA_PATTERN: u16 = 33422;
const DNG_VERSION: u16 = 50706;
const CFA_PLANE_COLOUR: u16 = 50710;
const CFA_LAYOUT: u16 = 50711;
const LINEARIZATION: u16 = 50712;
const WHITE_LEVEL: u16 = 50717;
const ACTIVE_AREA: u16 = 50829;

/// Photometric interpretation of a sensor without colours, or of one that was demosaiced.
const LINEAR_RAW: u64 = 34892;
const BLACK_IS_ZERO: u16 = 1;

/// More directories than any camera writes.
const MOST: usize = 64;

/// Largest list of small numbers that is looked at: a pattern.
const LONGEST: u64 = 64;

/// An undeveloped picture.
pub(super) struct Undeveloped {
    /// What its samples are of; one colour for a sensor without a filter array.
    pub(super) mosaic: Option<Mosaic>,
    /// Top, left, bottom and right of the part that light falls on, px.
    active: Option<[usize; 4]>,
    pub(super) white_level_dn: Option<f64>,
    patches: Vec<(u64, Vec<u8>)>,
}

/// What a file holds in place of a developed picture.
pub(super) enum Found {
    /// A picture that can be read.
    Picture(Undeveloped),
    /// One that a camera's own decoder is needed for, by the name of its format.
    Foreign(&'static str),
    /// One that cannot be used.
    Odd(Oddity),
}

/// The undeveloped picture of the file, if it has one.
pub(super) fn find(bytes: &[u8]) -> Option<Found> {
    let file = File::open(bytes)?;
    let main = file.directory(file.first);
    let mut directories = vec![file.first];
    let mut at = file.first;
    while let Some(next) = file.next(at).filter(|next| !directories.contains(next)) {
        if directories.len() >= MOST {
            break;
        }
        directories.push(next);
        at = next;
    }
    for index in 0..directories.len() {
        let directory = file.directory(directories[index]);
        let below = directory.get(SUB_DIRECTORIES);
        let below = below.and_then(|tag| file.list(tag, LONGEST));
        for at in below.into_iter().flatten().take(MOST) {
            if !directories.contains(&at) {
                directories.push(at);
            }
        }
    }
    let raw: Vec<u64> = directories
        .into_iter()
        .filter(|at| {
            let directory = file.directory(*at);
            let of = |tag| directory.get(tag).and_then(|tag| file.whole(tag));
            let photometric = of(PHOTOMETRIC).unwrap_or(0);
            of(NEW_SUBFILE_TYPE).unwrap_or(0) == 0
                && (photometric == u64::from(CFA) || photometric == LINEAR_RAW)
        })
        .collect();
    match raw.as_slice() {
        [] => None,
        [at] => Some(picture(&file, &main, *at)),
        _ => Some(Found::Odd(Oddity::ManyImages)),
    }
}

fn picture(file: &File<'_>, main: &Directory<'_>, at: u64) -> Found {
    let directory = file.directory(at);
    let get = |tag| directory.get(tag);
    let whole = |tag| get(tag).and_then(|tag| file.whole(tag));
    let list = |tag| get(tag).and_then(|tag| file.list(tag, LONGEST));
    let is_dng = main.get(DNG_VERSION).is_some();
    let make = file.text(main.get(MAKE)).unwrap_or_default().to_uppercase();
    let brand = [("NIKON", "NEF"), ("SONY", "ARW"), ("PENTAX", "PEF")];
    let brand = brand.iter().find(|(maker, _)| make.starts_with(maker));
    let format = match (is_dng, brand) {
        (true, _) => "DNG",
        (false, Some((_, format))) => format,
        (false, None) => "TIFF",
    };
    // Makers pack their own files in ways of their own.
    let own = !is_dng && brand.is_some();
    let packed = !matches!(whole(COMPRESSION).unwrap_or(1), 1 | 5 | 8 | 32946 | 32773);
    if own || packed || get(LINEARIZATION).is_some() {
        return Found::Foreign(format);
    }
    let mosaic = if whole(PHOTOMETRIC) == Some(CFA.into()) {
        let side = list(CFA_REPEAT).unwrap_or_default();
        let pattern = get(CFA_PATTERN).and_then(|tag| file.list(tag, LONGEST));
        let planes = list(CFA_PLANE_COLOUR).unwrap_or(vec![0, 1, 2]);
        let square = matches!(side[..], [a, b] if a == b);
        let regular = square && planes == [0, 1, 2] && whole(CFA_LAYOUT).unwrap_or(1) == 1;
        let colours: Option<Vec<u8>> = pattern
            .unwrap_or_default()
            .into_iter()
            .map(|colour| u8::try_from(colour).ok())
            .collect();
        let mosaic = colours.and_then(|c| Mosaic::from_colours(&c).ok());
        match mosaic.filter(|m| regular && side[0] == m.side() as u64) {
            Some(mosaic) => Some(mosaic),
            None => return Found::Odd(Oddity::Pattern),
        }
    } else {
        None
    };
    let active = list(ACTIVE_AREA).and_then(|area| {
        let area: Vec<usize> = area
            .iter()
            .filter_map(|n| usize::try_from(*n).ok())
            .collect();
        <[usize; 4]>::try_from(area).ok()
    });
    Found::Picture(Undeveloped {
        mosaic,
        active,
        white_level_dn: list(WHITE_LEVEL).and_then(|l| l.first().map(|dn| *dn as f64)),
        patches: patches(file, &directory, at),
    })
}

/// What makes the decoder see the picture of the directory at `at`, and that one alone, in gray
/// and as the sensor lies.
fn patches(file: &File<'_>, directory: &Directory<'_>, at: u64) -> Vec<(u64, Vec<u8>)> {
    let mut patches = vec![(file.first_at(), file.pointer(at))];
    if let Some(next) = file.next_at(at) {
        patches.push((next, file.pointer(0)));
    }
    for (number, value) in [(PHOTOMETRIC, BLACK_IS_ZERO), (ORIENTATION, 1)] {
        if let Some(tag) = directory.get(number) {
            patches.push((file.place(tag.field), file.short(value)));
        }
    }
    patches
}

impl Undeveloped {
    /// The file as the decoder is to see it.
    pub(super) fn patched<'a>(&self, bytes: &'a [u8]) -> Patched<'a> {
        Patched {
            file: Cursor::new(bytes),
            patches: self.patches.clone(),
        }
    }

    /// The part of the frame that light falls on; a pattern begins with its first photosite.
    pub(super) fn active(&self, frame: Frame) -> Result<Frame, Oddity> {
        let Some([top, left, bottom, right]) = self.active else {
            return Ok(frame);
        };
        if top >= bottom || left >= right || bottom > frame.height || right > frame.width {
            return Err(Oddity::ActiveArea);
        }
        if [top, left, bottom, right] == [0, 0, frame.height, frame.width] {
            return Ok(frame);
        }
        fn cut<T: Copy>(all: &[T], width: usize, rows: [usize; 2], columns: [usize; 2]) -> Vec<T> {
            let [left, right] = columns;
            all.chunks_exact(width)
                .take(rows[1])
                .skip(rows[0])
                .flat_map(|row| row[left..right].iter().copied())
                .collect()
        }
        let (rows, columns) = ([top, bottom], [left, right]);
        let samples = match &frame.samples {
            Samples::U16(all) => cut(all, frame.width, rows, columns).into(),
            Samples::F32(all) => Samples::F32(cut(all, frame.width, rows, columns)),
        };
        Ok(Frame {
            width: right - left,
            height: bottom - top,
            channels: 1,
            samples,
        })
    }
}

/// A file some of whose bytes read as others.
pub(super) struct Patched<'a> {
    file: Cursor<&'a [u8]>,
    patches: Vec<(u64, Vec<u8>)>,
}

impl<'a> Patched<'a> {
    /// The file as it is.
    pub(super) fn plain(bytes: &'a [u8]) -> Self {
        Self {
            file: Cursor::new(bytes),
            patches: vec![],
        }
    }
}

impl Read for Patched<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let start = self.file.position();
        let length = self.file.read(into)?;
        for (at, patch) in &self.patches {
            for (place, byte) in (*at..).zip(patch) {
                if let Some(offset) = place.checked_sub(start)
                    && let Some(into) = into[..length].get_mut(offset as usize)
                {
                    *into = *byte;
                }
            }
        }
        Ok(length)
    }
}

impl Seek for Patched<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
