//! A medium given by reduced coefficients, one pair for each channel.
//!
//! ```
//! let medium = formats::sample_toml::parse(r#"
//!     material = "gypsum"
//!     eta = 1.5
//!     [[channel]]
//!     name = "Y"
//!     sigma_a_per_mm = 0.01
//!     sigma_s_prime_per_mm = 2.5
//! "#)?;
//! assert_eq!(medium.channel[0].name, "Y");
//! # Ok::<(), formats::sample_toml::SampleTomlError>(())
//! ```

use crate::toml_text::{TomlError, parse_toml};
use physics::{InvalidMedium, ReducedMedium};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A material by its reduced coefficients.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedMediumFile {
    /// Name of the material.
    pub material: String,
    /// Index of the material over that of its surroundings.
    pub eta: f64,
    /// The channels, at least one.
    pub channel: Vec<ReducedChannel>,
}

/// The coefficients of one channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedChannel {
    /// Name of the channel: `R`, `G`, `B` or `Y`.
    pub name: String,
    /// Absorption coefficient σₐ, mm⁻¹.
    pub sigma_a_per_mm: f64,
    /// Reduced scattering coefficient σₛ′, mm⁻¹.
    pub sigma_s_prime_per_mm: f64,
}

/// A medium file cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SampleTomlError {
    /// The text does not fit.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// No channel at all.
    #[error("field `channel`: found none; expected at least one [[channel]]")]
    NoChannel,
    /// One name twice.
    #[error("field `channel[{index}].name`: `{name}` was given before; expected each name once")]
    RepeatedChannel {
        /// Position of the second one, from 0.
        index: usize,
        /// The name.
        name: String,
    },
    /// The coefficients of a channel make no medium.
    #[error("field `channel[{index}]`: {source}")]
    Medium {
        /// Position of the channel, from 0.
        index: usize,
        /// What is wrong.
        source: InvalidMedium,
    },
}

impl ReducedMediumFile {
    /// The medium of `channel`.
    pub fn medium(&self, channel: &ReducedChannel) -> ReducedMedium {
        ReducedMedium {
            sigma_a: channel.sigma_a_per_mm,
            sigma_s_prime: channel.sigma_s_prime_per_mm,
            eta: self.eta,
        }
    }
}

/// The medium that `text` describes, checked.
///
/// # Errors
///
/// [`SampleTomlError`] names the field.
pub fn parse(text: &str) -> Result<ReducedMediumFile, SampleTomlError> {
    let file: ReducedMediumFile = parse_toml(text)?;
    if file.channel.is_empty() {
        return Err(SampleTomlError::NoChannel);
    }
    for (index, channel) in file.channel.iter().enumerate() {
        if file.channel[..index].iter().any(|c| c.name == channel.name) {
            return Err(SampleTomlError::RepeatedChannel {
                index,
                name: channel.name.clone(),
            });
        }
        file.medium(channel)
            .validated()
            .map_err(|source| SampleTomlError::Medium { index, source })?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(channels: &str) -> String {
        parse(&format!("material = \"m\"\neta = 1.3\n{channels}"))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn faults_name_the_field() {
        let good = "[[channel]]\nname = \"G\"\nsigma_a_per_mm = 0.1\nsigma_s_prime_per_mm = 1\n";
        assert!(parse(&format!("material = \"m\"\neta = 1.3\n{good}")).is_ok());
        assert!(message(&format!("{good}{good}")).contains("`channel[1].name`: `G`"));
        assert!(message("channel = []").contains("`channel`: found none"));
        let bad = good.replace("0.1", "-0.1");
        let found = message(&format!("{}{bad}", good.replace("\"G\"", "\"R\"")));
        assert!(
            found.contains("`channel[1]`: absorption") && found.contains("-0.1"),
            "{found}"
        );
        assert!(
            message(&good.replace("per_mm", "per_cm")).contains("did you mean `sigma_a_per_mm`")
        );
    }
}
