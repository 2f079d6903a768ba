//! What a file is that is no frame, for its owner to know it again.

/// Bytes of a beginning that are kept.
const KEPT: usize = 32;

/// Where some bytes stand in well-known files, which, what those are called, and what to do.
const KNOWN: [(usize, &[u8], &str, &str); 18] = [
    (0, b"\xff\xd8\xff", "a JPEG", BENT),
    (0, b"\0\0\0\x0cjP  ", "a JPEG 2000", BENT),
    (0, b"\0\0\0\x0cJXL ", "a JPEG XL", BENT),
    (4, b"ftyphei", "a HEIC", BENT),
    (4, b"ftypmif1", "a HEIC", BENT),
    (4, b"ftypavif", "an AVIF", BENT),
    (0, b"RIFF", "a WebP or a film", BENT),
    (0, b"GIF8", "a GIF", BENT),
    (0, b"BM", "a BMP", CONVERT),
    (0, b"#?RADIANCE", "a Radiance picture", CONVERT),
    (0, b"\x1f\x8b", "packed by gzip", UNPACK),
    (0, b"PK\x03\x04", "a zip archive", UNPACK),
    (0, b"\x89HDF", "HDF5", CONVERT),
    (0, b"\x93NUMPY", "an array of NumPy", CONVERT),
    (0, b"Pf", "a PFM", CONVERT),
    (0, b"PF", "a PFM", CONVERT),
    (
        0,
        b"version https://git-lfs",
        "the pointer of Git LFS",
        FETCH,
    ),
    (
        0,
        b"XTENSION",
        "an extension of FITS without its first part",
        CONVERT,
    ),
];

const BENT: &str = "its counts are bent, and packed with loss: photograph RAW, or save 16-bit TIFF";
const CONVERT: &str = "convert it without changing its counts";
const UNPACK: &str = "unpack it";
const FETCH: &str = "fetch the file itself (git lfs pull)";

/// What is kept of a file.
pub(super) fn of(bytes: &[u8]) -> Vec<u8> {
    bytes.iter().take(KEPT).copied().collect()
}

fn known(beginning: &[u8]) -> Option<(&'static str, &'static str)> {
    let netpbm = match beginning {
        [b'P', b'1'..=b'3', b' ' | b'\t'..=b'\r' | b'#', ..] => Some("PBM, PGM or PPM in text"),
        [b'P', b'4', b' ' | b'\t'..=b'\r' | b'#', ..] => Some("a PBM, black and white"),
        [b'P', b'7', b' ' | b'\t'..=b'\r' | b'#', ..] => Some("a PAM"),
        _ => None,
    };
    let mut all = KNOWN.iter();
    let found =
        all.find(|(at, mark, ..)| beginning.get(*at..).is_some_and(|b| b.starts_with(mark)));
    netpbm
        .map(|name| (name, CONVERT))
        .or(found.map(|(_, _, name, advice)| (*name, *advice)))
}

/// What the file is.
pub(super) fn found(beginning: &[u8]) -> String {
    match known(beginning) {
        _ if beginning.is_empty() => "the file is empty".to_owned(),
        Some((name, _)) => format!("the file is {name}"),
        None => format!(
            "the file begins with {:02x?}",
            &beginning[..beginning.len().min(4)]
        ),
    }
}

/// What to do with it.
pub(super) fn advice(beginning: &[u8]) -> &'static str {
    match known(beginning) {
        _ if beginning.is_empty() => "copy it anew",
        Some((_, advice)) => advice,
        None => CONVERT,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_strangers_send_is_called_by_its_name() {
        for (bytes, name, what_to_do) in [
            (&b""[..], "is empty", "copy it"),
            (b"\xff\xd8\xff\xe0", "a JPEG", "RAW"),
            (b"P2 1 1 255\n7", "in text", "convert"),
            (b"\0\0\0\x18ftypheic", "a HEIC", "RAW"),
            (b"\x1f\x8b\x08", "gzip", "unpack"),
            (b"hello", "[68, 65, 6c, 6c]", "convert"),
        ] {
            let (found, advice) = (found(&of(bytes)), advice(&of(bytes)));
            assert!(
                found.contains(name) && advice.contains(what_to_do),
                "{found}: {advice}"
            );
        }
    }
}
