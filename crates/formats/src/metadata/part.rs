//! A file read without its picture: what it says of itself stands elsewhere, in few bytes.

use super::Metadata;
use super::camera_raw::{self, Kind};
use super::tags::{self, Known, Stretch};
use crate::image::Format;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

/// Bytes that are read in one go.
const PIECE: u64 = 1 << 16;
/// The most that is read in one go of what a file says of itself.
const LONGEST: u64 = 1 << 24;
/// A block of a FITS header.
const BLOCK: usize = 2880;
/// Rounds in which the values of tags are followed: the first directory, EXIF's own, and what both
/// point at.
const ROUNDS: usize = 4;

impl Metadata {
    /// What the file `source` says, of which no more is read than that takes: as [`Self::read`] of
    /// all its bytes.
    ///
    /// # Errors
    ///
    /// What reading reports.
    pub fn of_file(source: &mut (impl Read + Seek)) -> io::Result<Self> {
        let length = source.seek(SeekFrom::End(0))?;
        let mut part = Part {
            source,
            bytes: vec![],
            length,
        };
        part.append(PIECE)?;
        match Format::of(&part.bytes) {
            Some(Format::Pnm) => Ok(Self::default()),
            Some(Format::Fits) => {
                let ends = |block: &[u8]| block.chunks(80).any(|card| card.trim_ascii() == b"END");
                while part.bytes.len() < length as usize
                    && !part.bytes.chunks_exact(BLOCK).any(ends)
                {
                    part.append(PIECE)?;
                }
                Ok(Self::read(&part.bytes))
            }
            Some(Format::Png) => part.png(),
            Some(Format::Tiff) => part.tiff(),
            Some(Format::Exr) => {
                part.source.seek(SeekFrom::Start(0))?;
                // Its header has no length of its own: it is read up to its end and no farther.
                Ok(super::exr(BufReader::new(part.source)))
            }
            None => part.camera_raw(),
        }
    }
}

/// A file, and some of its bytes at their places.
struct Part<'a, S> {
    source: &'a mut S,
    bytes: Vec<u8>,
    length: u64,
}

impl<S: Read + Seek> Part<'_, S> {
    /// Reads on behind what is there.
    fn append(&mut self, count: u64) -> io::Result<()> {
        self.source.seek(SeekFrom::Start(self.bytes.len() as u64))?;
        (&mut *self.source)
            .take(count)
            .read_to_end(&mut self.bytes)?;
        Ok(())
    }

    /// The chunks before the first that holds EXIF, each without what is in it.
    fn png(&mut self) -> io::Result<Metadata> {
        let mut at = 8;
        let mut head = [0; 8];
        while at + 8 <= self.length {
            self.source.seek(SeekFrom::Start(at))?;
            self.source.read_exact(&mut head)?;
            let [a, b, c, d, kind @ ..] = head;
            let length = u64::from(u32::from_be_bytes([a, b, c, d]));
            if kind == *b"eXIf" && at + 8 + length <= self.length {
                let mut exif = vec![];
                (&mut *self.source).take(length).read_to_end(&mut exif)?;
                return Ok(tags::read(&exif));
            }
            at += 12 + length;
        }
        Ok(Metadata::default())
    }

    /// The tags, wherever in the file they stand.
    fn tiff(&mut self) -> io::Result<Metadata> {
        let mut further: Vec<(u64, Vec<u8>)> = vec![];
        for _ in 0..ROUNDS {
            let known = Known {
                beginning: &self.bytes,
                further: &further,
            };
            let mut wanted = tags::stretches(known, self.length);
            wanted.retain(|stretch| !known.holds(stretch));
            if wanted.is_empty() {
                break;
            }
            for Stretch { start, end } in wanted {
                let bytes = self.piece(start, end - start)?;
                further.push((start, bytes));
            }
        }
        Ok(tags::read_known(Known {
            beginning: &self.bytes,
            further: &further,
        }))
    }

    /// The piece of a camera's own format in which its EXIF is.
    fn camera_raw(&mut self) -> io::Result<Metadata> {
        match Kind::of(&self.bytes) {
            Some(Kind::Raf) => {
                let at = camera_raw::picture_of_raf(&self.bytes);
                let picture = self.piece(at.unwrap_or(0) as u64, camera_raw::SEGMENT)?;
                Ok(camera_raw::of_picture(&picture))
            }
            Some(Kind::Cr3) => {
                let mut at = 0;
                loop {
                    let head = self.piece(at, 8)?;
                    let Some((length, kind)) = head.split_first_chunk::<4>() else {
                        return Ok(Metadata::default());
                    };
                    let length = u64::from(u32::from_be_bytes(*length));
                    if kind == camera_raw::MOVIE && length <= LONGEST {
                        return Ok(camera_raw::of_boxes(&self.piece(at, length)?));
                    }
                    // A box is not shorter than its head.
                    if length < 8 {
                        return Ok(Metadata::default());
                    }
                    at += length;
                }
            }
            None => Ok(Metadata::default()),
        }
    }

    /// The `length` bytes from `at` on, fewer at the end of the file.
    fn piece(&mut self, at: u64, length: u64) -> io::Result<Vec<u8>> {
        self.source.seek(SeekFrom::Start(at))?;
        let mut bytes = vec![];
        (&mut *self.source).take(length).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Counts what is read.
    struct Counted<'a>(Cursor<&'a [u8]>, u64);

    impl Read for Counted<'_> {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let count = self.0.read(into)?;
            self.1 += count as u64;
            Ok(count)
        }
    }

    impl Seek for Counted<'_> {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.seek(to)
        }
    }

    fn both(bytes: &[u8]) -> (Metadata, u64) {
        let mut source = Counted(Cursor::new(bytes), 0);
        let found = Metadata::of_file(&mut source).unwrap();
        assert_eq!(found, Metadata::read(bytes));
        (found, source.1)
    }

    /// A TIFF whose directory stands behind its picture of `size` bytes, as most writers leave it.
    fn with_the_tags_behind(size: u32) -> Vec<u8> {
        let mut bytes = b"II*\0".to_vec();
        bytes.extend((8 + size).to_le_bytes());
        bytes.resize(8 + size as usize, 0x5a);
        bytes.extend(1_u16.to_le_bytes());
        for number in [33434_u16, 5] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend((8 + size + 18).to_le_bytes());
        bytes.extend(0_u32.to_le_bytes());
        bytes.extend([1_u32, 40].into_iter().flat_map(u32::to_le_bytes));
        bytes
    }

    #[test]
    fn a_picture_is_not_read() {
        let (found, read) = both(&with_the_tags_behind(10_000_000));
        assert_eq!(found.exposures[0].value, 0.025);
        assert!(read < 200_000, "{read}");
        let mut fits = format!(
            "{:80}{:80}",
            "SIMPLE  =                    T", "EXPTIME = 2.0 / s"
        );
        fits += &format!("{:2720}", "END");
        let mut fits = fits.into_bytes();
        fits.resize(10_000_000, 0);
        let (found, read) = both(&fits);
        assert_eq!(found.exposures[0].value, 2.0);
        assert!(read < 200_000, "{read}");
        let exr = exr_of(1500);
        let (found, read) = both(&exr);
        assert_eq!(found.exposures[0].value, 0.125);
        assert!(exr.len() > 4_000_000 && read < 200_000, "{read}");
    }

    /// A picture of `side` by `side` zeros, exposed an eighth of a second.
    fn exr_of(side: usize) -> Vec<u8> {
        use ::exr::prelude::*;
        let samples = FlatSamples::F16(vec![f16::ZERO; side * side]);
        let channels = AnyChannels::sort([AnyChannel::new("Y", samples)].into_iter().collect());
        let attributes = LayerAttributes {
            exposure: Some(0.125),
            ..LayerAttributes::default()
        };
        let layer = Layer::new((side, side), attributes, Encoding::UNCOMPRESSED, channels);
        let mut out = Cursor::new(Vec::new());
        Image::from_layer(layer)
            .write()
            .non_parallel()
            .to_buffered(&mut out)
            .unwrap();
        out.into_inner()
    }

    #[test]
    fn camera_raw_is_read_as_far_as_its_exif() {
        let cr3 = include_bytes!("../../../../fixtures/frames/raw/canon-r6.cr3");
        let raf = include_bytes!("../../../../fixtures/frames/raw/fujifilm_x_t1_01.raf.meta");
        for (bytes, seconds) in [(&cr3[..], 0.01), (&raf[..], 0.4)] {
            // The counts follow what there is of them here.
            let mut whole = bytes.to_vec();
            whole.resize(10_000_000, 0);
            let (found, read) = both(&whole);
            assert_eq!(found.exposures[0].value, seconds);
            assert!(read < 400_000, "{read}");
            for end in [0, 11, 90, 3000] {
                both(&bytes[..end]);
            }
        }
    }

    /// A file of which only the tags exist: nobody has the memory for the rest.
    struct Huge {
        parts: Vec<(u64, Vec<u8>)>,
        length: u64,
        at: u64,
    }

    impl Read for Huge {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let count = into.len().min((self.length - self.at) as usize);
            for (byte, place) in into[..count].iter_mut().zip(self.at..) {
                let part = self.parts.iter().rev().find_map(|(from, bytes)| {
                    bytes.get(usize::try_from(place.checked_sub(*from)?).ok()?)
                });
                *byte = part.copied().unwrap_or(0);
            }
            self.at += count as u64;
            Ok(count)
        }
    }

    impl Seek for Huge {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.at = match to {
                SeekFrom::Start(at) => at,
                SeekFrom::End(from) => self.length.saturating_add_signed(from),
                SeekFrom::Current(from) => self.at.saturating_add_signed(from),
            };
            Ok(self.at)
        }
    }

    #[test]
    fn the_tags_of_a_file_of_terabytes_are_found() {
        let (directory, value) = (5_u64 << 40, 7_u64 << 40);
        let mut head = b"II\x2b\0\x08\0\0\0".to_vec();
        head.extend(directory.to_le_bytes());
        let mut tags = 1_u64.to_le_bytes().to_vec();
        // A text that is longer than its tag.
        tags.extend(270_u16.to_le_bytes());
        tags.extend(2_u16.to_le_bytes());
        let text = b"<OME><Plane ExposureTime=\"20\" ExposureTimeUnit=\"ms\"/></OME>";
        tags.extend((text.len() as u64).to_le_bytes());
        tags.extend(value.to_le_bytes());
        tags.extend(0_u64.to_le_bytes());
        let mut source = Huge {
            parts: vec![(0, head), (directory, tags), (value, text.to_vec())],
            length: 8 << 40,
            at: 0,
        };
        let found = Metadata::of_file(&mut source).unwrap();
        assert_eq!(found.exposure("", None).unwrap().unwrap().seconds, 0.02);
    }
}
