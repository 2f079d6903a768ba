//! The undeveloped picture of a TIFF or DNG: one sample a photosite.
//!
//! Where it stands and what colours it has is read here; its pixels are decoded as those of any
//! gray TIFF, through [`Patched`], which shows the decoder a file of that one picture.

use super::{Bending, Decoded, Depth, ImageError, Lossy, Oddity, aspect, tiff::CFA};
use crate::metadata::tags::{Directory, File};
use physics::{Frame, Mosaic, Samples};
use std::io::{self, Cursor, Read, Seek, SeekFrom};

const NEW_SUBFILE_TYPE: u16 = 254;
const COMPRESSION: u16 = 259;
const PHOTOMETRIC: u16 = 262;
const MAKE: u16 = 271;
const STRIP_OFFSETS: u16 = 273;
const ORIENTATION: u16 = 274;
const SAMPLES_PER_PIXEL: u16 = 277;
const TILE_OFFSETS: u16 = 324;
const SUB_DIRECTORIES: u16 = 330;
const SAMPLE_FORMAT: u16 = 339;
const CFA_REPEAT: u16 = 33421;
const CFA_PATTERN: u16 = 33422;
const DNG_VERSION: u16 = 50706;
const CFA_PLANE_COLOUR: u16 = 50710;
const CFA_LAYOUT: u16 = 50711;
const LINEARIZATION: u16 = 50712;
const WHITE_LEVEL: u16 = 50717;
const DEFAULT_SCALE: u16 = 50718;
const ACTIVE_AREA: u16 = 50829;
const SUB_TILE_BLOCK: u16 = 50974;
const ROW_INTERLEAVE: u16 = 50975;
/// Corrections for the reader to make, before and after the linearization table.
const OPCODE_LISTS: [u16; 2] = [51008, 51009];
const COLUMN_INTERLEAVE: u16 = 52547;
const JXL_DISTANCE: u16 = 52553;

/// Compressions: JPEG, lossless by the letter of DNG, JPEG with loss, JPEG XL with or without it.
const JPEG: u64 = 7;
const LOSSY_JPEG: u64 = 34892;
const JPEG_XL: u64 = 52546;

/// Corrections that bend counts: MapTable and MapPolynomial. Others (bad pixels, a gain by place,
/// the shape of a lens) change a picture to look at and leave counts in proportion to light.
const BENDING: [(u32, Bending); 2] = [(7, Bending::MapTable), (8, Bending::MapPolynomial)];

/// A number of no tag.
const NOTHING: u16 = 65535;

/// Photometric interpretation of a sensor without colours, or of one that was demosaiced.
const LINEAR_RAW: u64 = 34892;
const BLACK_IS_ZERO: u16 = 1;

/// More directories than any camera writes.
const MOST: usize = 64;

/// Largest list of small numbers that is looked at: a pattern.
const LONGEST: u64 = 64;

/// Largest table that counts of 16 bits ask for.
const LONGEST_TABLE: u64 = 1 << 16;

/// More corrections than any camera lists.
const MOST_OPCODES: u32 = 256;

/// An undeveloped picture.
pub(super) struct Undeveloped {
    /// What its samples are of; one colour for a sensor without a filter array.
    pub(super) mosaic: Option<Mosaic>,
    /// Top, left, bottom and right of the part that light falls on, px.
    active: Option<[usize; 4]>,
    pub(super) white_level_dn: Option<f64>,
    /// Width of a pixel over its height.
    pub(super) pixel_aspect: f64,
    /// Count that each stored number stands for; those beyond it are the last one.
    table: Option<Vec<u16>>,
    patches: Vec<(u64, Vec<u8>)>,
}

/// What a file holds in place of a developed picture.
pub(super) enum Found {
    /// A picture that can be read.
    Picture(Undeveloped),
    /// A DNG that a decoder of camera RAW has to unpack.
    Packed(Undeveloped),
    /// One that a camera's own decoder is needed for, by the name of its format.
    Foreign(&'static str),
    /// One that cannot be used.
    Odd(Oddity),
}

/// Where the directories of a file stand: each of the chain, and behind it those below it.
fn directories(file: &File<'_>) -> Vec<u64> {
    let mut all = vec![];
    let mut at = Some(file.first);
    while let Some(here) = at.filter(|at| !all.contains(at) && all.len() < MOST) {
        all.push(here);
        let below = file.directory(here).get(SUB_DIRECTORIES);
        let below = below.and_then(|tag| file.list(tag, LONGEST));
        for below in below.into_iter().flatten() {
            if !all.contains(&below) && all.len() < MOST {
                all.push(below);
            }
        }
        at = file.next(here);
    }
    all
}

/// The undeveloped picture of the file, if it has one.
pub(super) fn find(bytes: &[u8]) -> Option<Found> {
    let file = File::open(bytes)?;
    let main = file.directory(file.first);
    let whole = |at, tag| {
        let tag = file.directory(at).get(tag);
        tag.and_then(|tag| file.whole(tag))
    };
    let all = directories(&file);
    let raw: Vec<u64> = all
        .iter()
        .copied()
        .filter(|at| {
            let photometric = whole(*at, PHOTOMETRIC).unwrap_or(0);
            whole(*at, NEW_SUBFILE_TYPE).unwrap_or(0) == 0
                && (photometric == u64::from(CFA) || photometric == LINEAR_RAW)
        })
        .collect();
    match raw.as_slice() {
        [] if main.get(DNG_VERSION).is_some() => Some(Found::Odd(Oddity::NoCounts)),
        [] => None,
        [at] => {
            let found = picture(&file, bytes, &main, *at);
            // The decoder of camera RAW takes the first picture that is not called a small copy.
            let first = all
                .iter()
                .find(|at| whole(**at, NEW_SUBFILE_TYPE).unwrap_or(0) & 1 == 0);
            match found {
                Found::Packed(_) if first != Some(at) => Some(Found::Odd(Oddity::ManyImages)),
                found => Some(found),
            }
        }
        _ => Some(Found::Odd(Oddity::ManyImages)),
    }
}

fn picture(file: &File<'_>, bytes: &[u8], main: &Directory<'_>, at: u64) -> Found {
    let directory = file.directory(at);
    let get = |tag| directory.get(tag);
    let whole = |tag| get(tag).and_then(|tag| file.whole(tag));
    let list = |tag| get(tag).and_then(|tag| file.list(tag, LONGEST));
    let is_dng = main.get(DNG_VERSION).is_some();
    let make = file.text(main.get(MAKE)).unwrap_or_default().to_uppercase();
    let brand = [("NIKON", "NEF"), ("SONY", "ARW"), ("PENTAX", "PEF")];
    let brand = brand.iter().find(|(maker, _)| make.starts_with(maker));
    let compression = whole(COMPRESSION).unwrap_or(1);
    let packed = !matches!(compression, 1 | 5 | 8 | 32946 | 32773);
    // Makers pack their own files in ways of their own.
    match (is_dng, brand) {
        (false, Some((_, format))) => return Found::Foreign(format),
        (false, None) if packed || get(LINEARIZATION).is_some() => return Found::Foreign("TIFF"),
        _ => {}
    }
    let odd = |oddity| Found::Odd(oddity);
    if let samples @ 2.. = whole(SAMPLES_PER_PIXEL).unwrap_or(1) {
        return odd(Oddity::Developed(samples.try_into().unwrap_or(u16::MAX)));
    }
    if let Some(lossy) = loss(file, bytes, &directory, compression) {
        return odd(Oddity::LossyRaw(lossy));
    }
    let bends = OPCODE_LISTS.into_iter().filter_map(get);
    if let Some(opcode) = bends.filter_map(|tag| bending(file.raw(tag)?)).next() {
        return odd(Oddity::Opcode(opcode));
    }
    let other = |tag| list(tag).is_some_and(|factors| factors.iter().any(|f| *f != 1));
    let interleaved = other(ROW_INTERLEAVE) || other(COLUMN_INTERLEAVE);
    // The decoder of JPEG XL puts the rows and columns back.
    if other(SUB_TILE_BLOCK) || interleaved && compression != JPEG_XL {
        return odd(Oddity::Interleaved);
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
            None => return odd(Oddity::Pattern),
        }
    } else {
        None
    };
    let active = match get(ACTIVE_AREA) {
        None => None,
        Some(tag) => {
            let area = file.list(tag, LONGEST).unwrap_or_default();
            let area: Vec<usize> = area
                .iter()
                .filter_map(|n| usize::try_from(*n).ok())
                .collect();
            match <[usize; 4]>::try_from(area) {
                Ok(area) => Some(area),
                Err(_) => return odd(Oddity::ActiveArea),
            }
        }
    };
    let table = match get(LINEARIZATION) {
        None => None,
        Some(tag) => {
            let table = file.list(tag, LONGEST_TABLE).unwrap_or_default();
            let table: Vec<u16> = table
                .iter()
                .filter_map(|n| u16::try_from(*n).ok())
                .collect();
            if table.is_empty() {
                return odd(Oddity::Table);
            }
            Some(table)
        }
    };
    let scale = get(DEFAULT_SCALE).and_then(|tag| file.ratios(tag));
    let aspect = scale.map_or(1.0, |[across, down]| aspect(across, down));
    // By the letter of DNG, floating point is full at 1.
    let default = (is_dng && whole(SAMPLE_FORMAT) == Some(3)).then_some(1.0);
    let white = list(WHITE_LEVEL).and_then(|levels| levels.into_iter().min());
    let found = Undeveloped {
        mosaic,
        active,
        white_level_dn: white.map(|dn| dn as f64).or(default),
        pixel_aspect: aspect,
        table,
        patches: if packed {
            let table = get(LINEARIZATION).map(|tag| file.place(tag.field) - file.before_field());
            let hide = |at| (at, file.short(NOTHING));
            table.map(hide).into_iter().collect()
        } else {
            patches(file, &directory, at)
        },
    };
    if packed {
        Found::Packed(found)
    } else {
        Found::Picture(found)
    }
}

/// The coder that changed the counts of a picture, if one did as far as its file tells.
fn loss(
    file: &File<'_>,
    bytes: &[u8],
    directory: &Directory<'_>,
    compression: u64,
) -> Option<Lossy> {
    let of = |tag| directory.get(tag);
    match compression {
        LOSSY_JPEG => Some(Lossy::Jpeg),
        JPEG => {
            let offsets = of(STRIP_OFFSETS).or_else(|| of(TILE_OFFSETS))?;
            let first = usize::try_from(file.whole(offsets)?).ok()?;
            (frame_of_jpeg(bytes.get(first..)?)? != LOSSLESS).then_some(Lossy::Jpeg)
        }
        JPEG_XL => {
            let distance = of(JXL_DISTANCE).and_then(|tag| file.ratio(tag));
            (distance != Some(0.0)).then_some(Lossy::JpegXl)
        }
        _ => None,
    }
}

/// The marker of a JPEG's frame whose counts are predicted and kept.
const LOSSLESS: u8 = 0xc3;

/// The marker that says how the frame of a JPEG is coded.
fn frame_of_jpeg(bytes: &[u8]) -> Option<u8> {
    let mut rest = bytes.strip_prefix(&[0xff, 0xd8])?;
    loop {
        let [0xff, marker, high, low, ..] = *rest else {
            return None;
        };
        // 0xc4, 0xc8 and 0xcc are tables, and no frames.
        if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
            return Some(marker);
        }
        rest = rest.get(2 + usize::from(u16::from_be_bytes([high, low]))..)?;
    }
}

/// The first correction of a list that bends counts. A list is of big-endian numbers, whatever the
/// file is of.
fn bending(list: &[u8]) -> Option<Bending> {
    let number = |at: usize| {
        let bytes = list.get(at..at.checked_add(4)?)?;
        Some(u32::from_be_bytes(bytes.try_into().ok()?))
    };
    let mut at = 4;
    for _ in 0..number(0)?.min(MOST_OPCODES) {
        let opcode = number(at)?;
        if let Some((_, bending)) = BENDING.iter().find(|(number, _)| *number == opcode) {
            return Some(*bending);
        }
        // Version and flags stand between an opcode and the length of what it needs.
        let length = usize::try_from(number(at + 12)?).ok()?;
        at = at.checked_add(16)?.checked_add(length)?;
    }
    None
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

    /// What `frame`, the whole sensor as it is stored in `depth`, says of light: counts in
    /// proportion to it, in the part that it falls on; a pattern begins with its first photosite.
    pub(super) fn developed_no_further(
        &self,
        frame: Frame,
        depth: Depth,
    ) -> Result<Decoded, ImageError> {
        let frame = self.active(frame).map_err(ImageError::Odd)?;
        self.linear(frame, depth)
    }

    /// The same of a frame that is the active part already.
    fn linear(&self, mut frame: Frame, mut depth: Depth) -> Result<Decoded, ImageError> {
        let mut step_dn = 1;
        if let Some(table) = &self.table {
            let Samples::U16(stored) = &mut frame.samples else {
                return Err(ImageError::Odd(Oddity::Table));
            };
            let last = table.len() - 1;
            for count in stored.iter_mut() {
                *count = table[usize::from(*count).min(last)];
            }
            // What a table makes of 8 bits are counts of more.
            depth = Depth::Bits(16);
            let steps = table.windows(2).map(|pair| pair[1].abs_diff(pair[0]));
            step_dn = steps.max().unwrap_or(1).max(1);
        }
        Ok(Decoded {
            mosaic: self.mosaic,
            white_level_dn: self.white_level_dn,
            pixel_aspect: self.pixel_aspect,
            step_dn,
            ..Decoded::plain(frame, depth)
        })
    }

    fn active(&self, frame: Frame) -> Result<Frame, Oddity> {
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

/// What a DNG says of its counts that a decoder of camera RAW has to unpack.
pub struct PackedDng(Undeveloped);

impl PackedDng {
    /// What `bytes` say, if they are one.
    pub fn find(bytes: &[u8]) -> Option<Self> {
        match find(bytes) {
            Some(Found::Packed(packed)) => Some(Self(packed)),
            _ => None,
        }
    }

    /// The file without its table of counts, which decoders fill up with noise; `None` where it
    /// has none and can be decoded as it is.
    pub fn without_table(&self, bytes: &[u8]) -> Option<Vec<u8>> {
        let mut all = self.0.table.is_some().then(|| bytes.to_vec())?;
        for (at, patch) in &self.0.patches {
            let at = usize::try_from(*at).ok()?;
            all.get_mut(at..at + patch.len())?.copy_from_slice(patch);
        }
        Some(all)
    }

    /// What the unpacked `frame`, the active part of the sensor as it is stored in `depth`, says of
    /// light.
    ///
    /// # Errors
    ///
    /// [`Oddity::Table`]: a table stands beside numbers that are not whole.
    pub fn counts(&self, frame: Frame, depth: Depth) -> Result<Decoded, ImageError> {
        self.0.linear(frame, depth)
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

#[cfg(test)]
mod tests;
