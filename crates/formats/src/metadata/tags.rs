//! The directories of TIFF, BigTIFF and EXIF: a walk over two of them that copies no pixels.

use super::{Metadata, Source, Stated, TimeUnit, camera};
use std::ops::Range;

const IMAGE_DESCRIPTION: u16 = 270;
const MAKE: u16 = 271;
const MODEL: u16 = 272;
const ORIENTATION: u16 = 274;
const SUB_DIRECTORIES: u16 = 330;
const EXPOSURE_TIME: u16 = 33434;
const EXIF: u16 = 34665;
const ISO: u16 = 34855;
const SHUTTER_SPEED: u16 = 37377;
const SERIAL_NUMBER: u16 = 42033;
const MICRO_MANAGER: u16 = 51123;

/// The tags that metadata come from.
const LOOKED_AT: [u16; 9] = [
    IMAGE_DESCRIPTION,
    MAKE,
    MODEL,
    EXPOSURE_TIME,
    EXIF,
    ISO,
    SHUTTER_SPEED,
    SERIAL_NUMBER,
    MICRO_MANAGER,
];

/// What the first directory of a TIFF and its EXIF directory say.
pub(super) fn read(bytes: &[u8]) -> Metadata {
    read_known(Known::all(bytes))
}

/// The same of a file of which only parts are there.
pub(super) fn read_known(bytes: Known<'_>) -> Metadata {
    let Some(file) = File::of(bytes) else {
        return Metadata::default();
    };
    let first = file.directory(file.first);
    let exif = first.get(EXIF).and_then(|tag| file.whole(tag));
    let exif = exif.map_or_else(Directory::default, |at| file.directory(at));
    let mut exposures = vec![];
    // RAW-like TIFF has the time in its first directory; cameras write it into EXIF's own.
    let time = [&exif, &first].into_iter().find_map(|directory| {
        let time = file.ratio(directory.get(EXPOSURE_TIME)?)?;
        (time > 0.0).then_some((time, "ExposureTime"))
    });
    let apex = || {
        let speed = file.ratio(exif.get(SHUTTER_SPEED)?)?;
        Some(((-speed).exp2(), "ShutterSpeedValue"))
    };
    let in_seconds = |source, field: &str, value: f64, unit| {
        (value > 0.0 && value.is_finite()).then(|| Stated {
            source,
            field: field.to_owned(),
            value,
            unit: Some(unit),
        })
    };
    if let Some((value, field)) = time.or_else(apex) {
        exposures.extend(in_seconds(Source::Exif, field, value, TimeUnit::Seconds));
    }
    if let Some((value, unit)) = file.text(first.get(IMAGE_DESCRIPTION)).and_then(ome) {
        exposures.extend(in_seconds(
            Source::Ome,
            "ExposureTime of Plane",
            value,
            unit,
        ));
    }
    if let Some(value) = file.text(first.get(MICRO_MANAGER)).and_then(micro_manager) {
        let unit = TimeUnit::Milliseconds;
        exposures.extend(in_seconds(Source::MicroManager, "Exposure-ms", value, unit));
    }
    let iso = [&exif, &first]
        .into_iter()
        .find_map(|directory| file.whole(directory.get(ISO)?));
    Metadata {
        exposures,
        iso,
        camera: camera([
            file.text(first.get(MAKE)),
            file.text(first.get(MODEL)),
            file.text(exif.get(SERIAL_NUMBER)),
        ]),
    }
}

/// How the pixels are to be turned before they are looked at, as the first directory of EXIF has it.
pub(crate) fn orientation(exif: &[u8]) -> Option<u16> {
    let file = File::open(exif)?;
    let tag = file.directory(file.first).get(ORIENTATION)?;
    u16::try_from(file.whole(tag)?).ok()
}

/// Places of a file, from the first byte to the one behind the last.
pub(super) type Stretch = Range<u64>;

/// The longest value that is anything but a picture: a text.
const LONGEST: u64 = 1 << 24;
/// More than the tags of a directory take.
const DIRECTORY: u64 = 1 << 16;

/// What [`read_known`] looks at in a file of `length` bytes of which only these stretches need be
/// there; more of them once those are.
pub(super) fn stretches(bytes: Known<'_>, length: u64) -> Vec<Stretch> {
    let Some(file) = File::of(bytes) else {
        return vec![];
    };
    let first = file.directory(file.first);
    let exif = first.get(EXIF).and_then(|tag| file.whole(tag));
    let mut found = vec![];
    for at in [Some(file.first), exif].into_iter().flatten() {
        found.push(at..at.saturating_add(DIRECTORY));
        let tags = file.directory(at).0.into_iter();
        let values = tags.filter(|tag| LOOKED_AT.contains(&tag.number));
        let values = values.filter_map(|tag| file.elsewhere(tag));
        found.extend(values.filter(|values| values.end - values.start <= LONGEST));
    }
    let inside = found.into_iter().map(|s| s.start..s.end.min(length));
    inside.filter(|s| s.start < s.end).collect()
}

/// Where the values of some tag reach to, if that is beyond the end of the file: the decoder would
/// ask for the memory before it reads them.
pub(crate) fn beyond_the_end(bytes: &[u8]) -> Option<u64> {
    let file = File::open(bytes)?;
    let mut at = file.first;
    // Pictures below the first, where cameras keep the undeveloped one.
    let below = file.directory(at).get(SUB_DIRECTORIES);
    let below = below.and_then(|tag| file.list(tag, MOST_DIRECTORIES as u64));
    let reaches = below.into_iter().flatten().map(|at| file.reach(at));
    if let Some(reach) = reaches.max().filter(|reach| *reach > bytes.len() as u64) {
        return Some(reach);
    }
    // A chain that bites its tail has no end.
    for _ in 0..MOST_DIRECTORIES {
        let reach = file.reach(at);
        if reach > bytes.len() as u64 {
            return Some(reach);
        }
        at = file.next(at)?;
    }
    None
}

/// More than a file with one frame and its small copies has; one with more is refused for it.
const MOST_DIRECTORIES: usize = 64;

/// Time and unit of the planes of an OME-XML text, where all agree.
fn ome(text: &str) -> Option<(f64, TimeUnit)> {
    if !text.contains("<OME") {
        return None;
    }
    let attribute = |plane: &'_ str, name: &str| {
        let behind = plane.split_once(name)?.1.split_once('"')?.1;
        Some(behind.split_once('"')?.0.to_owned())
    };
    let mut planes = text.split("<Plane ").skip(1).map(|plane| {
        let plane = plane.split('>').next().unwrap_or_default();
        let value: f64 = attribute(plane, "ExposureTime=")?.parse().ok()?;
        // The schema's default is a second.
        let unit = attribute(plane, "ExposureTimeUnit=");
        Some((
            value,
            unit.map_or(Some(TimeUnit::Seconds), |u| TimeUnit::of(&u))?,
        ))
    });
    let first = planes.next()??;
    planes.all(|plane| plane == Some(first)).then_some(first)
}

/// Milliseconds in Micro-Manager's JSON.
fn micro_manager(text: &str) -> Option<f64> {
    let json: serde_json::Value = serde_json::from_str(text).ok()?;
    let value = json.get("Exposure-ms")?;
    let typed = value.get("scalar").unwrap_or(value);
    typed.as_f64().or_else(|| typed.as_str()?.parse().ok())
}

/// A tag: its type, how many values, and the bytes that hold them or point at them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tag<'a> {
    number: u16,
    kind: u16,
    count: u64,
    pub(crate) field: &'a [u8],
}

/// The tags of a picture.
#[derive(Default)]
pub(crate) struct Directory<'a>(Vec<Tag<'a>>);

impl<'a> Directory<'a> {
    /// The tag with this number.
    pub(crate) fn get(&self, number: u16) -> Option<Tag<'a>> {
        self.0.iter().find(|tag| tag.number == number).copied()
    }
}

/// The bytes of a file that are there: those at its beginning, and stretches farther on, each from
/// its place.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub(super) beginning: &'a [u8],
    pub(super) further: &'a [(u64, Vec<u8>)],
}

impl<'a> Known<'a> {
    /// A file of which all bytes are there.
    fn all(bytes: &'a [u8]) -> Self {
        Self {
            beginning: bytes,
            further: &[],
        }
    }

    /// The bytes from `at` on, as far as they are there.
    fn from(&self, at: u64) -> Option<&'a [u8]> {
        let further = self.further.iter().map(|(from, bytes)| (*from, &bytes[..]));
        let parts = [(0, self.beginning)].into_iter().chain(further);
        parts
            .filter_map(|(from, bytes)| bytes.get(usize::try_from(at.checked_sub(from)?).ok()?..))
            .max_by_key(|bytes| bytes.len())
    }

    /// Whether the whole of `stretch` is there.
    pub(super) fn holds(&self, stretch: &Stretch) -> bool {
        self.get(stretch.start, stretch.end - stretch.start)
            .is_some()
    }

    /// The `length` bytes from `at` on.
    fn get(&self, at: u64, length: u64) -> Option<&'a [u8]> {
        self.from(at)?.get(..usize::try_from(length).ok()?)
    }
}

/// A TIFF or BigTIFF.
pub(crate) struct File<'a> {
    bytes: Known<'a>,
    little: bool,
    big: bool,
    /// Where the first directory stands.
    pub(crate) first: u64,
}

impl<'a> File<'a> {
    /// The file, if its first bytes are those of one.
    pub(crate) fn open(bytes: &'a [u8]) -> Option<Self> {
        Self::of(Known::all(bytes))
    }

    fn of(known: Known<'a>) -> Option<Self> {
        let bytes = known.beginning;
        let little = match bytes.get(..2)? {
            b"II" => true,
            b"MM" => false,
            _ => return None,
        };
        let mut file = Self {
            bytes: known,
            little,
            big: false,
            first: 0,
        };
        file.big = match file.unsigned(bytes.get(2..4)?) {
            42 => false,
            43 => true,
            _ => return None,
        };
        let first = if file.big { 8..16 } else { 4..8 };
        file.first = file.unsigned(bytes.get(first)?);
        Some(file)
    }

    fn unsigned(&self, bytes: &[u8]) -> u64 {
        let add = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        if self.little {
            bytes.iter().rev().fold(0, add)
        } else {
            bytes.iter().fold(0, add)
        }
    }

    /// The tags of the directory at `offset`, as far as the file has them.
    pub(crate) fn directory(&self, offset: u64) -> Directory<'a> {
        let (head, entry, field) = if self.big { (8, 20, 12) } else { (2, 12, 8) };
        let Some(rest) = self.bytes.from(offset) else {
            return Directory::default();
        };
        let Some((count, entries)) = rest.split_at_checked(head) else {
            return Directory::default();
        };
        let count = usize::try_from(self.unsigned(count)).unwrap_or(usize::MAX);
        let tags = entries
            .chunks_exact(entry)
            .take(count.min(65536))
            .map(|tag| Tag {
                number: self.unsigned(&tag[..2]) as u16,
                kind: self.unsigned(&tag[2..4]) as u16,
                count: self.unsigned(&tag[4..field]),
                field: &tag[field..],
            });
        Directory(tags.collect())
    }

    /// Where the values of the directory at `offset` reach to.
    fn reach(&self, offset: u64) -> u64 {
        let directory = self.directory(offset);
        let reach = directory.0.iter().map(|tag| self.elsewhere(*tag));
        reach.flatten().map(|values| values.end).max().unwrap_or(0)
    }

    /// Where the values of a tag are that does not hold them itself.
    fn elsewhere(&self, tag: Tag<'a>) -> Option<Range<u64>> {
        let width = match tag.kind {
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16..=18 => 8,
            _ => 1,
        };
        let length = tag.count.saturating_mul(width);
        let inside = length <= tag.field.len() as u64;
        let start = self.unsigned(tag.field);
        (!inside).then(|| start..start.saturating_add(length))
    }

    /// Where the directory behind the one at `offset` stands.
    pub(crate) fn next(&self, offset: u64) -> Option<u64> {
        let pointer = if self.big { 8 } else { 4 };
        let next = self.unsigned(self.bytes.get(self.next_at(offset)?, pointer)?);
        (next != 0).then_some(next)
    }

    /// Where the directory at `offset` says which one follows.
    pub(crate) fn next_at(&self, offset: u64) -> Option<u64> {
        let (head, entry) = if self.big { (8, 20) } else { (2, 12) };
        let count = self.unsigned(self.bytes.get(offset, head)?);
        let length = count.checked_mul(entry)?.checked_add(head)?;
        offset.checked_add(length)
    }

    /// Where the header says which directory is the first.
    pub(crate) fn first_at(&self) -> u64 {
        if self.big { 8 } else { 4 }
    }

    /// Where a tag's field stands.
    pub(crate) fn place(&self, field: &[u8]) -> u64 {
        // A field is a part of the file, and whoever changes one has all of it.
        (field.as_ptr() as usize - self.bytes.beginning.as_ptr() as usize) as u64
    }

    /// Bytes of a tag before its field: its number, its type and its count.
    pub(crate) fn before_field(&self) -> u64 {
        if self.big { 12 } else { 8 }
    }

    /// A pointer as the file writes it.
    pub(crate) fn pointer(&self, to: u64) -> Vec<u8> {
        let length = if self.big { 8 } else { 4 };
        match self.little {
            true => to.to_le_bytes()[..length].to_vec(),
            false => to.to_be_bytes()[8 - length..].to_vec(),
        }
    }

    /// A 16-bit number as the file writes it.
    pub(crate) fn short(&self, value: u16) -> Vec<u8> {
        match self.little {
            true => value.to_le_bytes().to_vec(),
            false => value.to_be_bytes().to_vec(),
        }
    }

    /// The whole numbers of a tag, of which there may be `most`.
    pub(crate) fn list(&self, tag: Tag<'a>, most: u64) -> Option<Vec<u64>> {
        let width = match tag.kind {
            1 | 7 => 1,
            other => whole_width(other)?,
        };
        if tag.count > most {
            return None;
        }
        let values = self.values(tag, width)?;
        let all = values.chunks_exact(width as usize);
        Some(all.map(|value| self.unsigned(value)).collect())
    }

    /// The bytes of a tag's values, each `width` wide.
    fn values(&self, tag: Tag<'a>, width: u64) -> Option<&'a [u8]> {
        let length = tag.count.checked_mul(width)?;
        if length <= tag.field.len() as u64 {
            return tag.field.get(..length as usize);
        }
        self.bytes.get(self.unsigned(tag.field), length)
    }

    /// The first whole number of a tag.
    pub(crate) fn whole(&self, tag: Tag<'a>) -> Option<u64> {
        let width = whole_width(tag.kind)?;
        let values = self.values(tag, width)?;
        Some(self.unsigned(values.get(..width as usize)?))
    }

    /// The bytes of a tag that is a list of bytes.
    pub(crate) fn raw(&self, tag: Tag<'a>) -> Option<&'a [u8]> {
        matches!(tag.kind, 1 | 7)
            .then(|| self.values(tag, 1))
            .flatten()
    }

    /// Two numbers above or at 0 that need not be whole.
    pub(crate) fn ratios(&self, tag: Tag<'a>) -> Option<[f64; 2]> {
        if tag.count != 2 || tag.kind != 5 {
            return None;
        }
        let values = self.values(tag, 8)?;
        let number = |at: usize| Some(f64::from(self.unsigned(values.get(at..at + 4)?) as u32));
        let both = [number(0)? / number(4)?, number(8)? / number(12)?];
        both.iter().all(|ratio| ratio.is_finite()).then_some(both)
    }

    /// A number that need not be whole.
    pub(crate) fn ratio(&self, tag: Tag<'a>) -> Option<f64> {
        // FLOAT and DOUBLE: not by the letter of EXIF, but Pillow for one writes them.
        let float = match tag.kind {
            11 => Some(f64::from(f32::from_bits(
                self.unsigned(self.values(tag, 4)?.get(..4)?) as u32,
            ))),
            12 => Some(f64::from_bits(
                self.unsigned(self.values(tag, 8)?.get(..8)?),
            )),
            _ => None,
        };
        if float.is_some() {
            return float.filter(|value| value.is_finite());
        }
        let values = self.values(tag, 8)?;
        let (above, below) = (
            self.unsigned(values.get(..4)?) as u32,
            self.unsigned(values.get(4..8)?) as u32,
        );
        let ratio = match tag.kind {
            5 => f64::from(above) / f64::from(below),
            10 => f64::from(above.cast_signed()) / f64::from(below.cast_signed()),
            _ => return None,
        };
        ratio.is_finite().then_some(ratio)
    }

    /// The text of a tag.
    pub(crate) fn text(&self, tag: Option<Tag<'a>>) -> Option<&'a str> {
        let tag = tag?;
        if !matches!(tag.kind, 1 | 2 | 7) {
            return None;
        }
        let text = std::str::from_utf8(self.values(tag, 1)?).ok()?;
        Some(text.trim_end_matches('\0').trim())
    }
}

/// Bytes of a SHORT, LONG, IFD, LONG8 or IFD8.
fn whole_width(kind: u16) -> Option<u64> {
    Some(match kind {
        3 => 2,
        4 | 13 => 4,
        16 | 18 => 8,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A TIFF without pixels: the tags of its first directory, then those of EXIF.
    fn file(first: &[(u16, u16, u32, [u8; 4])], exif: &[(u16, u16, u32, [u8; 4])]) -> Vec<u8> {
        let mut out = b"II\x2a\0\x08\0\0\0".to_vec();
        let after = 8 + 2 + 12 * (first.len() as u32 + 1) + 4;
        for (list, more) in [(first, true), (exif, false)] {
            out.extend((list.len() as u16 + u16::from(more)).to_le_bytes());
            let pointer = (EXIF, 4, 1, after.to_le_bytes());
            for (number, kind, count, field) in list.iter().chain(more.then_some(&pointer)) {
                out.extend(number.to_le_bytes());
                out.extend(kind.to_le_bytes());
                out.extend(count.to_le_bytes());
                out.extend(field);
            }
            out.extend([0; 4]);
        }
        out
    }

    fn with_ratio(tag: u16, kind: u16, in_first: bool, [above, below]: [i32; 2]) -> Vec<u8> {
        let pointed = |at: u32| (tag, kind, 1, at.to_le_bytes());
        let build = |at| match in_first {
            true => file(&[pointed(at)], &[]),
            false => file(&[], &[pointed(at)]),
        };
        let mut out = build(build(0).len() as u32);
        out.extend(above.to_le_bytes());
        out.extend(below.to_le_bytes());
        out
    }

    #[test]
    fn times_are_found_in_either_directory() {
        let cases = [
            (with_ratio(EXPOSURE_TIME, 5, true, [1, 250]), 0.004),
            (with_ratio(EXPOSURE_TIME, 5, false, [1, 250]), 0.004),
            (with_ratio(SHUTTER_SPEED, 10, false, [3, 1]), 0.125),
            (with_ratio(SHUTTER_SPEED, 10, false, [-2, 1]), 4.0),
            // The two halves of a double, the low one first.
            (
                with_ratio(EXPOSURE_TIME, 12, false, [0, 0x3fc0_0000]),
                0.125,
            ),
        ];
        for (bytes, seconds) in cases {
            let found = read(&bytes).exposure("", None).unwrap().unwrap();
            assert_eq!(found.seconds, seconds);
        }
        let none = with_ratio(EXPOSURE_TIME, 5, true, [1, 0]);
        assert_eq!(read(&none), Metadata::default());
    }

    #[test]
    fn microscopes_write_their_own() {
        let plane =
            |more: &str| format!("<OME><Plane TheC=\"0\" ExposureTime=\"20.0\"{more}/></OME>");
        assert_eq!(ome(&plane("")), Some((20.0, TimeUnit::Seconds)));
        let unit = plane(" ExposureTimeUnit=\"ms\"");
        assert_eq!(ome(&unit), Some((20.0, TimeUnit::Milliseconds)));
        assert_eq!(ome("<Plane ExposureTime=\"20\"/>"), None);
        assert_eq!(micro_manager(r#"{"Exposure-ms": 12.5}"#), Some(12.5));
        assert_eq!(micro_manager(r#"{"Exposure-ms": "12.5"}"#), Some(12.5));
        assert_eq!(micro_manager("{"), None);
    }

    proptest! {
        #[test]
        fn damage_does_not_panic(
            hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
            big in any::<bool>(),
        ) {
            let mut bytes = with_ratio(EXPOSURE_TIME, 5, false, [1, 250]);
            if big {
                bytes[2] = 43;
            }
            for (index, value) in hits {
                let at = index.index(bytes.len());
                bytes[at] = value;
            }
            let _ = read(&bytes);
        }
    }
}
