//! A file read without its picture: what it says of itself stands elsewhere, in few bytes.

use super::Metadata;
use super::tags::{self, Stretch};
use crate::image::Format;
use std::io::{self, Read, Seek, SeekFrom};

/// Bytes that are read in one go.
const PIECE: u64 = 1 << 16;
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
            Some(Format::Tiff) if length <= u64::from(u32::MAX) => part.tiff(),
            // The header of an OpenEXR has no length of its own, and camera RAW is a box of boxes.
            _ => {
                part.append(length)?;
                Ok(Self::read(&part.bytes))
            }
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

    /// The tags, and zeros where the picture is.
    fn tiff(&mut self) -> io::Result<Metadata> {
        // Memory to which nothing is written is not taken from the machine.
        let mut whole = vec![0; self.length as usize];
        whole[..self.bytes.len()].copy_from_slice(&self.bytes);
        let mut read: Vec<Stretch> = Vec::with_capacity(ROUNDS);
        read.push(0..self.bytes.len() as u64);
        for _ in 0..ROUNDS {
            let wanted = tags::stretches(&whole);
            let missing = wanted.into_iter().filter(|wanted| {
                !read
                    .iter()
                    .any(|r| r.start <= wanted.start && wanted.end <= r.end)
            });
            let missing: Vec<Stretch> = missing.collect();
            if missing.is_empty() {
                break;
            }
            for stretch in missing {
                self.source.seek(SeekFrom::Start(stretch.start))?;
                let into = &mut whole[stretch.start as usize..stretch.end as usize];
                self.source.read_exact(into)?;
                read.push(stretch);
            }
        }
        Ok(tags::read(&whole))
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
    }
}
