//! A list of frames as a manifest writes it.

use super::FrameEntry;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

/// Frames as written: a pattern that file names match, or each file by itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Frames {
    /// As in `"sample/*.tif"`, relative to the folder of the manifest.
    Pattern(String),
    /// File by file.
    List(Vec<WrittenFrame>),
}

/// One frame as written.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "{ file, exposure_s }")]
pub struct WrittenFrame {
    /// The file, relative to the folder of the manifest.
    pub file: String,
    /// Exposure time, s; found in the file or its name where absent.
    pub exposure_s: Option<f64>,
}

impl Frames {
    /// The frames, if each one stands here with its exposure time.
    pub fn stated(self) -> Option<Vec<FrameEntry>> {
        let Self::List(list) = self else { return None };
        list.into_iter()
            .map(|WrittenFrame { file, exposure_s }| {
                let exposure_s = exposure_s?;
                Some(FrameEntry { file, exposure_s })
            })
            .collect()
    }
}

impl<'de> Deserialize<'de> for Frames {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FramesVisitor)
    }
}

struct FramesVisitor;

impl<'de> Visitor<'de> for FramesVisitor {
    type Value = Frames;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of { file, exposure_s }, or a pattern as \"sample/*.tif\"")
    }

    fn visit_str<E>(self, pattern: &str) -> Result<Frames, E> {
        Ok(Frames::Pattern(pattern.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Frames, A::Error> {
        Deserialize::deserialize(SeqAccessDeserializer::new(list)).map(Frames::List)
    }
}
