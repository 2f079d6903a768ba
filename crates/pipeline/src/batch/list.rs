//! Which captures, and what each is called.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::{read_text, safe_name};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// The captures of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct List {
    /// Every manifest once, in the order of the list.
    pub captures: Vec<Listed>,
    /// The lists themselves.
    pub lists: Vec<PathBuf>,
}

/// A capture of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// What its folder is called.
    pub name: String,
    /// Its manifest, which need not be there.
    pub manifest: PathBuf,
}

impl List {
    /// The captures that `arguments` name: manifests (`*.toml`), patterns of them, and text files
    /// with a manifest or a pattern on each line, relative to their own folder.
    ///
    /// Each is called by the folder of its `capture.toml`, or by its own name where it has another;
    /// where that is not enough to tell two apart, the folders above come before it.
    ///
    /// # Errors
    ///
    /// Something that was typed does not exist, or a pattern finds nothing. A missing manifest in a
    /// list is no error here: it is one capture that fails.
    pub fn read(arguments: &[PathBuf]) -> Result<Self> {
        let mut found = vec![];
        let mut lists = vec![];
        for argument in arguments {
            let place = argument.display();
            if argument.is_file() && is_manifest(argument) {
                found.push(argument.clone());
            } else if argument.is_file() {
                let text = read_text(argument)?;
                let folder = argument.parent().unwrap_or(Path::new(""));
                let lines = text.lines().map(str::trim).enumerate();
                for (number, line) in lines {
                    if line.is_empty() || line.starts_with('#') {
                        continue;
                    }
                    let path = folder.join(line);
                    if is_pattern(&path) {
                        let place = format!("{place}, line {}", number + 1);
                        found.extend(matches(&path, &place)?);
                    } else {
                        found.push(path);
                    }
                }
                lists.push(argument.clone());
            } else if is_pattern(argument) {
                found.extend(matches(argument, &place.to_string())?);
            } else {
                let found = if argument.is_dir() {
                    "is a folder"
                } else {
                    "no such file"
                };
                let message = format!(
                    "{place}: {found}; expected a manifest, a pattern like 'series/*/capture.toml', \
                     or a file with one of these on each line"
                );
                return Err(Error::new(Kind::Input, message));
            }
        }
        let mut seen = BTreeSet::new();
        found.retain(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| absolute(path))));
        if found.is_empty() {
            let lists: Vec<String> = lists.iter().map(|l| l.display().to_string()).collect();
            let message = format!(
                "{}: names no capture; expected a manifest or a pattern on each line",
                lists.join(", ")
            );
            return Err(Error::new(Kind::Input, message));
        }
        let names = names(&found);
        let captures = (names.into_iter().zip(found))
            .map(|(name, manifest)| Listed { name, manifest })
            .collect();
        Ok(Self { captures, lists })
    }
}

fn is_manifest(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// Whether `path` names files by a pattern, and not one file by a name that looks like one.
fn is_pattern(path: &Path) -> bool {
    !path.exists() && path.to_string_lossy().contains(['*', '?', '['])
}

/// The files that `pattern` finds, in the order of their names.
fn matches(pattern: &Path, place: &str) -> Result<Vec<PathBuf>> {
    let text = pattern.to_string_lossy();
    let mut found = vec![];
    for path in glob::glob(&text).input(place)? {
        let path = path.input(place)?;
        if path.is_file() {
            found.push(path);
        }
    }
    if found.is_empty() {
        let message = format!("{place}: no file is called like `{text}`");
        return Err(Error::new(Kind::Input, message));
    }
    found.sort();
    Ok(found)
}

/// `path` from the root, without looking at the disk: it need not exist.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// A name for each manifest, no two alike, whatever case a file system ignores. They depend on how
/// the ends of the paths differ, and not on where the whole series stands.
fn names(manifests: &[PathBuf]) -> Vec<String> {
    let parts: Vec<Vec<String>> = manifests.iter().map(|path| parts(path)).collect();
    let mut depths = vec![1; parts.len()];
    loop {
        let names: Vec<String> = (parts.iter().zip(&depths))
            .map(|(parts, &depth)| {
                let end: Vec<&str> = parts[..depth].iter().rev().map(String::as_str).collect();
                end.join("-")
            })
            .collect();
        let mut alike: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, name) in names.iter().enumerate() {
            alike.entry(name.to_lowercase()).or_default().push(index);
        }
        let mut longer = false;
        for index in alike.values().filter(|of| of.len() > 1).flatten() {
            if depths[*index] < parts[*index].len() {
                depths[*index] += 1;
                longer = true;
            }
        }
        if !longer {
            return numbered(names);
        }
    }
}

/// The parts of a path that can tell it from others, from the end to the root.
fn parts(manifest: &Path) -> Vec<String> {
    let mut parts: Vec<String> = vec![];
    for component in absolute(manifest).components() {
        match component {
            Component::Normal(part) => parts.push(part.to_string_lossy().into_owned()),
            Component::ParentDir => {
                parts.pop();
            }
            _ => {}
        }
    }
    parts.reverse();
    match parts.first() {
        Some(file) if file == "capture.toml" && parts.len() > 1 => {
            parts.remove(0);
        }
        Some(file) => {
            let stem = Path::new(file).file_stem().unwrap_or_default();
            parts[0] = stem.to_string_lossy().into_owned();
        }
        None => parts.push("capture".to_owned()),
    }
    parts.iter().map(|part| safe_name(part)).collect()
}

/// `names` with numbers where two paths differ only in what is no letter.
fn numbered(names: Vec<String>) -> Vec<String> {
    let mut used = BTreeSet::new();
    let unlike = |name: String| {
        let mut numbered = name.clone();
        let mut number = 1;
        while !used.insert(numbered.to_lowercase()) {
            number += 1;
            numbered = format!("{name}-{number}");
        }
        numbered
    };
    names.into_iter().map(unlike).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn called(paths: &[&str]) -> Vec<String> {
        let paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
        names(&paths)
    }

    #[test]
    fn a_capture_is_called_by_its_folder_and_those_above_where_that_is_not_enough() {
        assert_eq!(
            called(&["/x/milk/capture.toml", "/x/skin/capture.toml"]),
            ["milk", "skin"]
        );
        assert_eq!(
            called(&["/x/milk/green.toml", "/x/red.toml"]),
            ["green", "red"]
        );
        assert_eq!(
            called(&[
                "/x/a/1/capture.toml",
                "/x/b/1/capture.toml",
                "/x/b/2/capture.toml"
            ]),
            ["a-1", "b-1", "2"]
        );
        assert_eq!(
            called(&["/x/Milk/capture.toml", "/y/z/../milk/capture.toml"]),
            ["x-Milk", "y-milk"]
        );
        assert_eq!(
            called(&["/x/a b/capture.toml", "/x/a_b/capture.toml"]),
            ["x-a_b", "x-a_b-2"]
        );
        assert_eq!(
            called(&["/capture.toml", "/.hidden/capture.toml"]),
            ["capture", "_hidden"]
        );
    }

    #[test]
    fn a_list_is_relative_to_its_folder_and_names_each_capture_once() {
        let here = tempfile::tempdir().unwrap();
        let path = |name: &str| here.path().join(name);
        for name in ["b", "a", "c"] {
            fs::create_dir(path(name)).unwrap();
            fs::write(path(name).join("capture.toml"), "").unwrap();
        }
        let lines = "# a remark\n\nc/capture.toml\n*/capture.toml\nd/capture.toml\n";
        fs::write(path("list.txt"), lines).unwrap();
        let list = List::read(&[path("list.txt")]).unwrap();
        let names: Vec<&str> = list.captures.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["c", "a", "b", "d"]);
        assert_eq!(list.captures[0].manifest, path("c/capture.toml"));
        assert_eq!(list.lists, [path("list.txt")]);
        let pattern = List::read(&[path("[ab]/capture.toml"), path("a/capture.toml")]).unwrap();
        assert_eq!(pattern.captures.len(), 2);
    }

    #[test]
    fn what_names_nothing_is_refused() {
        let here = tempfile::tempdir().unwrap();
        let path = |name: &str| here.path().join(name);
        fs::write(path("empty.txt"), "# nothing\n").unwrap();
        fs::write(path("vain.txt"), "\nx*/capture.toml\n").unwrap();
        for (name, said) in [
            ("", "is a folder"),
            ("none.toml", "no such file"),
            ("*/none.toml", "no file is called like"),
            ("empty.txt", "names no capture"),
            ("vain.txt", "vain.txt, line 2"),
        ] {
            let error = List::read(&[path(name)]).unwrap_err();
            assert_eq!(error.kind(), Kind::Input);
            assert!(error.to_string().contains(said), "{name}: {error}");
        }
    }
}
