//! Which files a manifest means, and how long each was exposed.

use crate::error::{Blame, Error, Kind, Result};
use crate::files;
use formats::capture::{FrameEntry, Frames};
use formats::metadata::{Metadata, TimeUnit};
use std::collections::BTreeMap;
use std::path::Path;

/// The frames of the list `field`, found in `folder` where they are not written out; where the
/// times were found goes to `notes`.
///
/// # Errors
///
/// A pattern that no file matches, or a file that does not tell how long it was exposed.
pub(crate) fn find(
    folder: &Path,
    field: &str,
    frames: Frames,
    fits_unit: Option<TimeUnit>,
    notes: &mut Vec<String>,
) -> Result<Vec<FrameEntry>> {
    let written = match frames {
        Frames::List(list) => list
            .into_iter()
            .map(|frame| (frame.file, frame.exposure_s))
            .collect(),
        Frames::Pattern(pattern) => matching(folder, field, &pattern)?
            .into_iter()
            .map(|file| (file, None))
            .collect::<Vec<_>>(),
    };
    let mut sources: BTreeMap<_, usize> = BTreeMap::new();
    let mut entries = Vec::with_capacity(written.len());
    for (file, stated) in written {
        let exposure_s = match stated {
            Some(exposure_s) => exposure_s,
            None => {
                let path = folder.join(&file);
                let mut source = files::open(&path)?.into_inner();
                let metadata = Metadata::of_file(&mut source).input(path.display())?;
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let found = metadata.exposure(&name, fits_unit).input(path.display())?;
                let found = found.ok_or_else(|| {
                    let message = format!(
                        "{}: neither its metadata nor its name tells the exposure time: write \
                         exposure_s in the manifest, or name the file as in `spot_20ms.tif`",
                        path.display()
                    );
                    Error::new(Kind::Input, message)
                })?;
                *sources.entry(found.source).or_default() += 1;
                found.seconds
            }
        };
        entries.push(FrameEntry { file, exposure_s });
    }
    for (source, count) in sources {
        notes.push(format!("{field}: {count} exposure times from the {source}"));
    }
    Ok(entries)
}

/// The files in `folder` that match, in alphabetical order, with `/` between folders.
fn matching(folder: &Path, field: &str, pattern: &str) -> Result<Vec<String>> {
    let refuse = |what: &str| {
        let message = format!("{}: field `{field}`: {pattern}: {what}", folder.display());
        Error::new(Kind::Input, message)
    };
    let escaped = glob::Pattern::escape(&folder.to_string_lossy());
    let whole = Path::new(&escaped).join(pattern);
    let paths = glob::glob(&whole.to_string_lossy()).map_err(|e| refuse(e.msg))?;
    let mut found = vec![];
    for path in paths {
        let path = path.input(format!("field `{field}`"))?;
        if path.is_file() {
            let relative = path.strip_prefix(folder).unwrap_or(&path);
            let parts: Vec<_> = relative.iter().map(|part| part.to_string_lossy()).collect();
            found.push(parts.join("/"));
        }
    }
    if found.is_empty() {
        return Err(refuse(
            "no file matches; expected a pattern as sample/*.tif",
        ));
    }
    Ok(found)
}
