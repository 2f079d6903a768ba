//! EXIF in the files of cameras that are no TIFF: RAF, around whose counts a JPEG stands, and CR3,
//! which is made of boxes.

use super::{Metadata, tags};

/// What the file says of itself.
pub(super) fn read(bytes: &[u8]) -> Metadata {
    if bytes.starts_with(b"FUJIFILMCCD-RAW") {
        raf(bytes).map_or_else(Metadata::default, tags::read)
    } else if bytes.get(4..12) == Some(b"ftypcrx ") {
        cr3(bytes).unwrap_or_default()
    } else {
        Metadata::default()
    }
}

fn number(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..at.checked_add(4)?)?;
    let number = u32::from_be_bytes(bytes.try_into().ok()?);
    usize::try_from(number).ok()
}

/// The EXIF of the small JPEG to which the header points.
fn raf(bytes: &[u8]) -> Option<&[u8]> {
    let picture = bytes.get(number(bytes, 84)?..)?;
    // Start of image, then the segment of applications.
    let segment = picture.strip_prefix(&[0xff, 0xd8, 0xff, 0xe1])?;
    let (length, segment) = segment.split_first_chunk::<2>()?;
    let length = usize::from(u16::from_be_bytes(*length)).checked_sub(2)?;
    segment.get(..length)?.strip_prefix(b"Exif\0\0")
}

/// The boxes CMT1, the first directory, and CMT2, that of EXIF, each a TIFF without pixels.
fn cr3(bytes: &[u8]) -> Option<Metadata> {
    let movie = boxes(bytes).find(|(kind, _)| kind == b"moov")?.1;
    let canon = boxes(movie)
        .find(|(kind, _)| kind == b"uuid")?
        .1
        .get(16..)?;
    let of = |wanted: &[u8; 4]| {
        let found = boxes(canon).find(|(kind, _)| kind == wanted);
        found.map_or_else(Metadata::default, |(_, body)| tags::read(body))
    };
    Some(Metadata {
        camera: of(b"CMT1").camera,
        ..of(b"CMT2")
    })
}

/// The boxes in `bytes`, each with its kind and its body, up to the first that is cut off.
fn boxes(mut bytes: &[u8]) -> impl Iterator<Item = ([u8; 4], &[u8])> {
    std::iter::from_fn(move || {
        let length = number(bytes, 0)?;
        let kind: [u8; 4] = bytes.get(4..8)?.try_into().ok()?;
        let body = bytes.get(8..length)?;
        bytes = &bytes[length..];
        Some((kind, body))
    })
}
