//! EXIF in the files of cameras that are no TIFF: RAF, around whose counts a JPEG stands, and CR3,
//! which is made of boxes.

use super::{Metadata, tags};

/// One of those formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Raf,
    Cr3,
}

/// Bytes of the small JPEG of a RAF behind which its EXIF, a segment, cannot reach.
pub(super) const SEGMENT: u64 = 6 + (1 << 16);

impl Kind {
    /// The format that the first of `bytes` announce.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"FUJIFILMCCD-RAW") {
            Some(Self::Raf)
        } else if bytes.get(4..12) == Some(b"ftypcrx ") {
            Some(Self::Cr3)
        } else {
            None
        }
    }
}

/// What the file says of itself.
pub(super) fn read(bytes: &[u8]) -> Metadata {
    match Kind::of(bytes) {
        Some(Kind::Raf) => {
            let picture = picture_of_raf(bytes).and_then(|at| bytes.get(at..));
            picture.map_or_else(Metadata::default, of_picture)
        }
        Some(Kind::Cr3) => of_boxes(bytes),
        None => Metadata::default(),
    }
}

fn number(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..at.checked_add(4)?)?;
    let number = u32::from_be_bytes(bytes.try_into().ok()?);
    usize::try_from(number).ok()
}

/// Where the header of a RAF says that its small JPEG stands.
pub(super) fn picture_of_raf(header: &[u8]) -> Option<usize> {
    number(header, 84)
}

/// What the EXIF of a JPEG says.
pub(super) fn of_picture(picture: &[u8]) -> Metadata {
    let exif = || {
        // Start of image, then the segment of applications.
        let segment = picture.strip_prefix(&[0xff, 0xd8, 0xff, 0xe1])?;
        let (length, segment) = segment.split_first_chunk::<2>()?;
        let length = usize::from(u16::from_be_bytes(*length)).checked_sub(2)?;
        segment.get(..length)?.strip_prefix(b"Exif\0\0")
    };
    exif().map_or_else(Metadata::default, tags::read)
}

/// What the boxes of a CR3 say: CMT1, the first directory, and CMT2, that of EXIF, each a TIFF
/// without pixels.
pub(super) fn of_boxes(bytes: &[u8]) -> Metadata {
    let found = || {
        let movie = boxes(bytes).find(|(kind, _)| kind == MOVIE)?.1;
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
    };
    found().unwrap_or_default()
}

/// The box in which all that is.
pub(super) const MOVIE: &[u8; 4] = b"moov";

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
