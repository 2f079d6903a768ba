//! What a finished capture says of itself, so that it need not be measured again.

use crate::capture::{Input, Loaded};
use crate::error::{Blame, Result};
use crate::fit_json::SCHEMA_VERSION;
use crate::measure::Choices;
use physics::simd::SimdPath;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// The file that makes a folder a finished capture of a batch.
pub(super) const NAME: &str = "batch.json";

/// A whole `batch.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Record {
    schema_version: u32,
    beamspot_version: String,
    /// Of all that the numbers depend on; see [`fingerprint`].
    fingerprint: String,
    /// BLAKE3 of every other file of the folder.
    outputs: BTreeMap<String, String>,
}

impl Record {
    /// Of the files in `folder`, made from what has this `fingerprint`.
    pub(super) fn of(folder: &Path, fingerprint: String) -> Result<Self> {
        let mut outputs = BTreeMap::new();
        for entry in fs::read_dir(folder).fault(folder.display())? {
            let path = entry.fault(folder.display())?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            outputs.insert(name.into_owned(), hash(&path)?);
        }
        Ok(Self {
            schema_version: SCHEMA_VERSION,
            beamspot_version: env!("CARGO_PKG_VERSION").to_owned(),
            fingerprint,
            outputs,
        })
    }

    /// Whether `folder` holds a finished capture with this `fingerprint`, every file as it was
    /// written.
    pub(super) fn stands(folder: &Path, fingerprint: &str) -> bool {
        let Ok(text) = fs::read(folder.join(NAME)) else {
            return false;
        };
        let Ok(record) = serde_json::from_slice::<Self>(&text) else {
            return false;
        };
        record.schema_version == SCHEMA_VERSION
            && record.fingerprint == fingerprint
            && (record.outputs.iter())
                .all(|(name, wanted)| hash(&folder.join(name)).is_ok_and(|found| found == *wanted))
    }

    /// The text of the file.
    pub(super) fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|text| text + "\n")
    }
}

/// BLAKE3 of all that the outputs depend on: the version of beamspot, its instruction path, what was
/// chosen, and name and bytes of the manifest and of every file that it names. Files that are among
/// `known` are not read again.
pub(super) fn fingerprint(loaded: &Loaded, choices: &Choices, known: &[Input]) -> Result<String> {
    let known: BTreeMap<&PathBuf, &String> = known.iter().map(|i| (&i.path, &i.blake3)).collect();
    let mut all = blake3::Hasher::new();
    let mut put = |text: &str| {
        // With its length, so that two texts cannot be taken for two others.
        all.update(&(text.len() as u64).to_le_bytes());
        all.update(text.as_bytes());
    };
    put(env!("CARGO_PKG_VERSION"));
    put(SimdPath::best().name());
    // Every field shows itself, also one that is added later.
    put(&format!("{choices:?}"));
    for path in loaded.paths() {
        let name = path.strip_prefix(&loaded.folder).unwrap_or(&path);
        put(&name.to_string_lossy());
        match known.get(&path) {
            Some(hash) => put(hash),
            None => put(&hash(&path)?),
        }
    }
    Ok(all.finalize().to_hex().to_string())
}

/// BLAKE3 of a file, which is read piece by piece.
fn hash(path: &Path) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let file = File::open(path).input(path.display())?;
    hasher.update_reader(file).input(path.display())?;
    Ok(hasher.finalize().to_hex().to_string())
}
