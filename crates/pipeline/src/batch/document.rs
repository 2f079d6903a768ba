//! What the doors say of a batch: the same in JSON and in words, whichever opens.

use super::{Batch, Outcome};
use crate::fit_json::{ChannelSummary, SCHEMA_VERSION};
use serde::Serialize;

/// A batch as one JSON document.
#[derive(Debug, Serialize)]
pub struct Document<'a> {
    schema_version: u32,
    measured: usize,
    measured_before: usize,
    not_measured: usize,
    captures: Vec<Capture<'a>>,
}

#[derive(Debug, Serialize)]
struct Capture<'a> {
    capture: &'a str,
    state: &'static str,
    measured_before: bool,
    material: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<&'a str>,
    channels: &'a [ChannelSummary],
}

impl Batch {
    /// Everything, capture by capture.
    pub fn document(&self) -> Document<'_> {
        Document {
            schema_version: SCHEMA_VERSION,
            measured: self.captures.len() - self.failed(),
            measured_before: self.stood(),
            not_measured: self.failed(),
            captures: self.captures.iter().map(Capture::from).collect(),
        }
    }

    /// What a person wants to see first, line by line: of many captures, those that want mending,
    /// and how many there are.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![];
        for Outcome { name, found, .. } in &self.captures {
            match found {
                Ok(found) => {
                    let bad = found.fit.bad();
                    lines.extend(bad.map(|said| format!("{name}: verdict BAD, {said}")));
                }
                Err(failure) => {
                    let state = failure.state();
                    lines.push(format!("{name}: {state}: {}", failure.error));
                }
            }
        }
        let (all, failed, stood) = (self.captures.len(), self.failed(), self.stood());
        let before = if stood > 0 {
            format!(" ({stood} of them before)")
        } else {
            String::new()
        };
        let measured = all - failed;
        lines.push(format!(
            "{all} captures: {measured} measured{before}, {failed} not"
        ));
        lines
    }
}

impl<'a> From<&'a Outcome> for Capture<'a> {
    fn from(outcome: &'a Outcome) -> Self {
        let (state, error) = match &outcome.found {
            Ok(_) => ("measured", None),
            Err(failure) => (failure.state(), Some(failure.error.as_str())),
        };
        let found = outcome.found.as_ref().ok();
        Self {
            capture: &outcome.name,
            state,
            measured_before: found.is_some_and(|found| found.stood),
            material: outcome.material.as_deref(),
            error,
            channels: found.map_or(&[], |found| &found.fit.channels),
        }
    }
}
