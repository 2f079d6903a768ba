//! TOML into any struct, with errors that say where and what was meant.

use crate::nearest::nearest;
use serde::de::DeserializeOwned;
use thiserror::Error;

/// A TOML text does not fit its struct.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TomlError {
    /// A key that the struct does not have.
    #[error(
        "line {line}: unknown key `{key}`{}; known here: {}",
        nearest.as_ref().map(|n| format!(", did you mean `{n}`?")).unwrap_or_default(),
        known.join(", ")
    )]
    UnknownKey {
        /// Line of the key, from 1.
        line: usize,
        /// The key found.
        key: String,
        /// The known key next to it, where one is near.
        nearest: Option<String>,
        /// Every key that is known in its place.
        known: Vec<String>,
    },
    /// Not TOML, a missing key, or a value of another type; the message shows the line.
    #[error("{}", .0.to_string().trim_end())]
    Text(#[from] toml::de::Error),
}

/// The struct that `text` describes.
///
/// ```
/// #[derive(Debug, serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Lens { focal_length_mm: f64 }
///
/// let error = formats::parse_toml::<Lens>("\nfocal_lenght_mm = 50").unwrap_err();
/// assert!(error.to_string().starts_with(
///     "line 2: unknown key `focal_lenght_mm`, did you mean `focal_length_mm`?"
/// ));
/// ```
///
/// # Errors
///
/// [`TomlError`]; a key is unknown only to structs with `deny_unknown_fields`.
pub fn parse_toml<T: DeserializeOwned>(text: &str) -> Result<T, TomlError> {
    toml::from_str(text).map_err(|error| unknown_key(text, &error).unwrap_or(error.into()))
}

/// serde tells an unknown field in words alone: "unknown field `x`, expected one of `a`, `b`".
fn unknown_key(text: &str, error: &toml::de::Error) -> Option<TomlError> {
    let message = error.message().strip_prefix("unknown field `")?;
    let mut names = message.split('`').step_by(2).map(str::to_owned);
    let key = names.next()?;
    let known: Vec<String> = names.collect();
    let start = error.span()?.start;
    Some(TomlError::UnknownKey {
        line: 1 + text.get(..start)?.matches('\n').count(),
        nearest: nearest(&key, known.iter().map(String::as_str)).map(str::to_owned),
        key,
        known,
    })
}

/// A string as TOML writes it, quoted and escaped.
pub(crate) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Camera {
        #[allow(dead_code, reason = "read by the messages under test alone")]
        gain_e_per_dn: f64,
        #[allow(dead_code, reason = "read by the messages under test alone")]
        read_noise_e: Option<f64>,
    }

    #[test]
    fn faults_show_their_line() {
        let message = |text| parse_toml::<Camera>(text).unwrap_err().to_string();
        assert_eq!(
            message("gain_e_per_dn = 1\n# noise\nread_noise = 3"),
            "line 3: unknown key `read_noise`, did you mean `read_noise_e`?; \
             known here: gain_e_per_dn, read_noise_e"
        );
        assert!(message("").contains("missing field `gain_e_per_dn`"));
        assert!(message("\ngain_e_per_dn = \"two\"").contains("line 2"));
        assert!(message("gain_e_per_dn = ").contains("line 1"));
    }
}
