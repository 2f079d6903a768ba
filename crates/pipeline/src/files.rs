//! Reading with names, writing whole or not at all.

use crate::error::{Blame, Error, Kind, Result};
use formats::FileWords;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The bytes of a file.
///
/// # Errors
///
/// The error names the file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    there(fs::read(path), path)
}

/// What came of opening `path`, with what to do where nothing is there.
fn there<T>(opened: std::io::Result<T>, path: &Path) -> Result<T> {
    opened.map_err(|e| match e.kind() {
        ErrorKind::NotFound => Error::new(
            Kind::Input,
            format!(
                "{}: No such file: correct the name; names in a manifest or a scene count from its own folder",
                path.display()
            ),
        ),
        ErrorKind::IsADirectory => a_folder(path),
        _ => Error::new(Kind::Input, format!("{}: {e}", path.display())),
    })
}

fn a_folder(path: &Path) -> Error {
    let inside = path.join("capture.toml");
    let hint = if inside.is_file() {
        format!("name its manifest, {}", inside.display())
    } else {
        "name a file in it".to_owned()
    };
    let found = format!(
        "{}: a folder, where a file is expected: {hint}",
        path.display()
    );
    Error::new(Kind::Input, found)
}

/// Bytes that are read and hashed in one go: they stay in the cache from the one to the other, and
/// the kernel copies four times as fast into it as into memory.
const PIECE: usize = 1 << 17;

/// The least memory of a file, in words: more than the 32 MiB up to which glibc may take it from a
/// heap, where what is given back stays, and what has grown leaves a hole. A page that nothing is
/// written to costs nothing.
const OWN_PAGES: usize = 33 << 19;

/// A file in the memory of `words`, and the hash of its bytes.
///
/// # Errors
///
/// The error names the file.
pub(crate) fn read_into(path: &Path, mut words: Vec<u16>) -> Result<(FileWords, blake3::Hash)> {
    words.clear();
    let mut file = there(File::open(path), path)?;
    let metadata = file.metadata().input(path.display())?;
    if metadata.is_dir() {
        let found = "is a folder; expected the file of a frame: correct the name";
        return Err(Error::new(
            Kind::Input,
            format!("{}: {found}", path.display()),
        ));
    }
    let length = metadata.len();
    let needed = usize::try_from(length).unwrap_or(0).div_ceil(2);
    words.reserve_exact(needed.max(OWN_PAGES));
    let mut total = 0;
    let mut hasher = blake3::Hasher::new();
    let mut read = |piece: &mut [u16]| -> Result<usize> {
        let piece: &mut [u8] = bytemuck::cast_slice_mut(piece);
        let mut filled = 0;
        while filled < piece.len() {
            match file.read(&mut piece[filled..]) {
                Ok(0) => break,
                Ok(more) => filled += more,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error).input(path.display()),
            }
        }
        Ok(filled)
    };
    // While one piece is hashed and kept, the next is read. In a scope, so that all the pieces stay
    // with one thread of the pool, and no other has to be woken for each.
    let (mut piece, mut next) = (vec![0_u16; PIECE / 2], vec![0_u16; PIECE / 2]);
    rayon::scope(|_| -> Result<()> {
        let mut filled = read(&mut piece)?;
        while filled > 0 {
            let (ahead, ()) = rayon::join(
                || {
                    words.extend_from_slice(&piece[..filled.div_ceil(2)]);
                    read(&mut next)
                },
                || {
                    hasher.update(&bytemuck::cast_slice(&piece)[..filled]);
                },
            );
            total += filled;
            filled = ahead?;
            std::mem::swap(&mut piece, &mut next);
        }
        Ok(())
    })?;
    Ok((FileWords::new(words, total), hasher.finalize()))
}

/// A file, to be read piece by piece.
///
/// # Errors
///
/// The error names the file.
pub fn open(path: &Path) -> Result<BufReader<File>> {
    Ok(BufReader::new(there(File::open(path), path)?))
}

/// The text of a file.
///
/// # Errors
///
/// The error names the file.
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read(path)?).map_err(|e| {
        let found = format!(
            "{}: {}, where text in UTF-8 is expected: name another file, or save it as UTF-8",
            path.display(),
            e.utf8_error()
        );
        Error::new(Kind::Input, found)
    })
}

/// Files on their way into a folder: all of them arrive, or none.
///
/// They are written to a hidden folder beside the target, which disappears if they never do.
pub struct Outputs {
    folder: PathBuf,
    stage: TempDir,
    names: Vec<PathBuf>,
    force: bool,
}

impl Outputs {
    /// Outputs called `names` into `folder`, which need not exist.
    ///
    /// # Errors
    ///
    /// One that exists is refused unless `force`, and so is one that is among `inputs`, always.
    pub fn new(
        folder: &Path,
        names: impl IntoIterator<Item = impl Into<PathBuf>>,
        inputs: &[PathBuf],
        force: bool,
    ) -> Result<Self> {
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        if folder.exists() && !folder.is_dir() {
            let found = format!("{}: a file stands where a folder should", folder.display());
            return Err(Error::new(Kind::Input, found));
        }
        let names: Vec<PathBuf> = names.into_iter().map(Into::into).collect();
        for name in &names {
            refuse_existing(&folder.join(name), inputs, force)?;
        }
        let mut parent = folder;
        while !parent.is_dir() {
            parent = match parent.parent() {
                Some(up) if !up.as_os_str().is_empty() => up,
                _ => Path::new("."),
            };
        }
        let stage = tempfile::Builder::new()
            .prefix(".beamspot-")
            .tempdir_in(parent)
            .fault(format!("writing to {}", parent.display()))?;
        Ok(Self {
            folder: folder.to_owned(),
            stage,
            names,
            force,
        })
    }

    /// Writes one of the outputs.
    ///
    /// # Errors
    ///
    /// The disk may be full; the error names the file.
    pub fn write(
        &self,
        name: impl AsRef<Path>,
        fill: impl FnOnce(&mut BufWriter<File>) -> anyhow::Result<()>,
    ) -> Result<()> {
        let name = name.as_ref();
        debug_assert!(
            self.names.iter().any(|n| n == name),
            "{} was not announced",
            name.display()
        );
        let path = self.stage.path().join(name);
        let place = || format!("writing {}", self.folder.join(name).display());
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).fault(place())?;
        }
        let mut out = BufWriter::new(File::create(&path).fault(place())?);
        fill(&mut out).fault(place())?;
        out.flush().fault(place())
    }

    /// Moves everything into place.
    ///
    /// # Errors
    ///
    /// An output that has appeared meanwhile is refused unless forced.
    pub fn commit(self) -> Result<()> {
        for name in &self.names {
            refuse_existing(&self.folder.join(name), &[], self.force)?;
        }
        for name in &self.names {
            let (from, to) = (self.stage.path().join(name), self.folder.join(name));
            if !from.exists() {
                continue;
            }
            let place = || format!("writing {}", to.display());
            if let Some(parent) = to.parent() {
                fs::create_dir_all(parent).fault(place())?;
            }
            fs::rename(&from, &to).fault(place())?;
        }
        Ok(())
    }
}

/// `text` as the name of a file or a folder, wherever it comes from.
pub fn safe_name(text: &str) -> String {
    let safe = |(place, c): (usize, char)| {
        // One that begins with a dot is hidden, or leads elsewhere.
        if c.is_alphanumeric() || "-_".contains(c) || (c == '.' && place > 0) {
            c
        } else {
            '_'
        }
    };
    text.chars().enumerate().map(safe).collect()
}

/// The folder and the name of one output file.
///
/// # Errors
///
/// A path that ends in no name is refused.
pub fn split(path: &Path) -> Result<(PathBuf, PathBuf)> {
    let name = path.file_name().filter(|_| !path.is_dir()).ok_or_else(|| {
        let found = format!("{}: expected the name of a file to write", path.display());
        Error::new(Kind::Input, found)
    })?;
    Ok((
        path.parent().unwrap_or(Path::new("")).to_owned(),
        name.into(),
    ))
}

fn refuse_existing(target: &Path, inputs: &[PathBuf], force: bool) -> Result<()> {
    if !target.exists() {
        return Ok(());
    }
    let same = |input: &PathBuf| matches!((target.canonicalize(), input.canonicalize()), (Ok(a), Ok(b)) if a == b);
    if inputs.iter().any(same) {
        let found = format!("{}: is an input; choose another output", target.display());
        return Err(Error::new(Kind::Input, found));
    }
    if force {
        return Ok(());
    }
    let found = format!(
        "{}: exists; choose another output, or replace it with --force",
        target.display()
    );
    Err(Error::new(Kind::Input, found))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fill(text: &'static str) -> impl FnOnce(&mut BufWriter<File>) -> anyhow::Result<()> {
        move |out| Ok(out.write_all(text.as_bytes())?)
    }

    #[test]
    fn nothing_arrives_before_the_commit_and_nothing_stays_without_one() {
        let here = tempfile::tempdir().unwrap();
        let target = here.path().join("deep/er");
        let outputs = Outputs::new(&target, ["a.txt", "sub/b.txt"], &[], false).unwrap();
        outputs.write("a.txt", fill("a")).unwrap();
        assert!(!target.exists());
        drop(outputs);
        assert_eq!(fs::read_dir(here.path()).unwrap().count(), 0);

        let outputs = Outputs::new(&target, ["a.txt", "sub/b.txt"], &[], false).unwrap();
        outputs.write("a.txt", fill("a")).unwrap();
        outputs.write("sub/b.txt", fill("b")).unwrap();
        outputs.commit().unwrap();
        assert_eq!(fs::read_to_string(target.join("sub/b.txt")).unwrap(), "b");
        assert_eq!(fs::read_dir(here.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_output_that_exists_is_refused_unless_forced_and_an_input_always() {
        let here = tempfile::tempdir().unwrap();
        let file = here.path().join("a.txt");
        fs::write(&file, "old").unwrap();
        let error = Outputs::new(here.path(), ["a.txt"], &[], false)
            .err()
            .unwrap();
        assert!(error.to_string().contains("a.txt: exists"), "{error}");
        assert_eq!(error.kind(), Kind::Input);
        let inputs = [file.clone()];
        let error = Outputs::new(here.path(), ["a.txt"], &inputs, true)
            .err()
            .unwrap();
        assert!(error.to_string().contains("is an input"), "{error}");
        let outputs = Outputs::new(here.path(), ["a.txt"], &[], true).unwrap();
        outputs.write("a.txt", fill("new")).unwrap();
        outputs.commit().unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
    }

    #[test]
    fn an_output_that_appears_meanwhile_is_not_overwritten() {
        let here = tempfile::tempdir().unwrap();
        let outputs = Outputs::new(here.path(), ["a.txt"], &[], false).unwrap();
        outputs.write("a.txt", fill("new")).unwrap();
        fs::write(here.path().join("a.txt"), "theirs").unwrap();
        assert!(outputs.commit().is_err());
        assert_eq!(
            fs::read_to_string(here.path().join("a.txt")).unwrap(),
            "theirs"
        );
    }
}
