//! Exposure times in the names of files: `spot_1ms`, `dark-0.5s`, `exp250us`.

use super::TimeUnit;

/// What the name of a file says of its exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NamedExposure {
    /// Nothing.
    None,
    /// A time, s.
    Seconds(f64),
    /// Either of two times, s: `1-30s` may be a thirtieth, or number one of 30 s.
    Ambiguous(f64, f64),
}

/// The exposure time in a file name, where a number and its unit stand apart from other words.
///
/// ```
/// use formats::metadata::{NamedExposure, exposure_in_name};
/// assert_eq!(exposure_in_name("spot_07_2.5ms.tif"), NamedExposure::Seconds(0.0025));
/// assert_eq!(exposure_in_name("spot_1-30s.tif"), NamedExposure::Ambiguous(1.0 / 30.0, 30.0));
/// assert_eq!(exposure_in_name("marbles.tif"), NamedExposure::None);
/// ```
pub fn exposure_in_name(name: &str) -> NamedExposure {
    let stem = match name.rsplit_once('.') {
        // The end behind the last dot is the format, unless it is half of a number.
        Some((stem, end)) if !end.starts_with(|c: char| c.is_ascii_digit()) => stem,
        _ => name,
    };
    let words: Vec<&str> = stem
        .split(|c: char| !(c.is_alphanumeric() || c == '.'))
        .collect();
    let mut found = NamedExposure::None;
    for (i, word) in words.iter().enumerate() {
        let Some(seconds) = time(word) else { continue };
        // Behind a lone 1 the number may be the lower half of a fraction.
        let this = match i.checked_sub(1).map(|before| words[before]) {
            Some("1") => match time(&format!("{}s", word.trim_end_matches(char::is_alphabetic))) {
                Some(number) if number > 1.0 => {
                    NamedExposure::Ambiguous(seconds / (number * number), seconds)
                }
                _ => NamedExposure::Seconds(seconds),
            },
            _ => NamedExposure::Seconds(seconds),
        };
        found = match found {
            NamedExposure::None => this,
            NamedExposure::Seconds(before) if this == NamedExposure::Seconds(before) => this,
            NamedExposure::Seconds(before) => NamedExposure::Ambiguous(before, seconds),
            ambiguous => ambiguous,
        };
    }
    found
}

/// The seconds of a word that is a number and its unit, `exp` or `t` before it aside.
fn time(word: &str) -> Option<f64> {
    let number = word.trim_end_matches(char::is_alphabetic);
    let unit = match TimeUnit::of(&word[number.len()..])? {
        // A minute is more often a minimum.
        TimeUnit::Minutes => return None,
        unit => unit,
    };
    let start = number
        .rfind(|c: char| !(c.is_ascii_digit() || c == '.'))
        .map_or(0, |last| {
            last + number[last..].chars().next().map_or(0, char::len_utf8)
        });
    let (prefix, digits) = number.split_at(start);
    let prefix_fits = matches!(
        prefix.to_lowercase().as_str(),
        "" | "exp" | "exposure" | "t" | "shutter"
    );
    // The number of `frame.5s` may be 5 or a half.
    let whole = prefix.is_empty() || !digits.starts_with('.');
    let value: f64 = digits.parse().ok()?;
    (prefix_fits && whole && value > 0.0 && value.is_finite()).then(|| unit.seconds(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_where_they_stand_apart() {
        use NamedExposure::{Ambiguous, None, Seconds};
        for (name, expected) in [
            ("sample_1ms.tif", Seconds(0.001)),
            ("sample_0.5s.tif", Seconds(0.5)),
            ("exp250us", Seconds(250e-6)),
            ("exp250µs.pgm", Seconds(250e-6)),
            ("dark-2s-03.png", Seconds(2.0)),
            ("WHITE 30MS (2).TIF", Seconds(0.03)),
            ("frame.4s.tif", None),
            ("a_.5s.tif", Seconds(0.5)),
            ("a_1-30s.tif", Ambiguous(1.0 / 30.0, 30.0)),
            ("3-30s.tif", Seconds(30.0)),
            ("10ms_20ms.tif", Ambiguous(0.01, 0.02)),
            ("10ms_0.01s.tif", Seconds(0.01)),
            ("sample01.tif", None),
            ("img5s.tif", None),
            ("5min.tif", None),
            ("0s.tif", None),
            ("s.tif", None),
            ("", None),
            ("ünï_ßs.tif", None),
        ] {
            assert_eq!(exposure_in_name(name), expected, "{name}");
        }
    }
}
