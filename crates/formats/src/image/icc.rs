//! Whether an ICC profile bends counts: the tone curves of ICC.1, section 10.6 and 10.18.

const CURVES: [&[u8; 4]; 4] = [b"kTRC", b"rTRC", b"gTRC", b"bTRC"];

/// Whether some tone curve of the profile is no straight line. A profile that shows none, or that
/// is damaged, is taken to bend: nobody attaches one to counts by accident.
pub(super) fn bends(profile: &[u8]) -> bool {
    straight(profile) != Some(true)
}

fn straight(profile: &[u8]) -> Option<bool> {
    let number = |bytes: &[u8], at: usize| {
        let four = bytes.get(at..at.checked_add(4)?)?.first_chunk::<4>()?;
        Some(u32::from_be_bytes(*four))
    };
    // A header of 128 bytes, then a table of name, place and length of each tag.
    let count = number(profile, 128)? as usize;
    let table = profile.get(132..)?.chunks_exact(12).take(count);
    let mut found = false;
    for tag in table.filter(|tag| CURVES.iter().any(|name| tag.starts_with(*name))) {
        found = true;
        let curve = profile.get(number(tag, 4)? as usize..)?;
        let fine = match curve.get(..4)? {
            b"curv" => match number(curve, 8)? as usize {
                0 => true,
                // A gamma in eighths of a byte: 0x0100 is 1.
                1 => curve.get(12..14)? == [1, 0],
                points => {
                    let (values, _) = curve.get(12..)?.as_chunks::<2>();
                    let last = (points - 1) as f64;
                    values.get(..points)?.iter().enumerate().all(|(i, value)| {
                        let line = 65535.0 * i as f64 / last;
                        (f64::from(u16::from_be_bytes(*value)) - line).abs() <= 1.0
                    })
                }
            },
            b"para" => curve.get(8..10)? == [0, 0] && number(curve, 12)? == 0x0001_0000,
            _ => false,
        };
        if !fine {
            return Some(false);
        }
    }
    found.then_some(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(curve: &[u8]) -> Vec<u8> {
        let mut out = vec![0; 128];
        out.extend(1_u32.to_be_bytes());
        out.extend(b"kTRC");
        out.extend(144_u32.to_be_bytes());
        out.extend((curve.len() as u32).to_be_bytes());
        out.extend(curve);
        out
    }

    #[test]
    fn only_straight_lines_are_straight() {
        let straight: [&[u8]; 4] = [
            b"curv\0\0\0\0\0\0\0\0",
            b"curv\0\0\0\0\0\0\0\x01\x01\x00",
            b"curv\0\0\0\0\0\0\0\x03\0\0\x7f\xff\xff\xff",
            b"para\0\0\0\0\0\0\0\0\0\x01\0\0",
        ];
        for curve in straight {
            assert!(!bends(&profile(curve)), "{curve:?}");
        }
        let bent: [&[u8]; 6] = [
            b"curv\0\0\0\0\0\0\0\x01\x02\x33",
            b"curv\0\0\0\0\0\0\0\x03\0\0\x30\0\xff\xff",
            b"para\0\0\0\0\0\0\0\0\0\x02\x33\x33",
            b"para\0\0\0\0\0\x03\0\0\0\x01\0\0",
            b"curv\0\0\0\0\xff\xff\xff\xff",
            b"cu",
        ];
        for curve in bent {
            assert!(bends(&profile(curve)), "{curve:?}");
        }
        assert!(bends(b""));
    }
}
