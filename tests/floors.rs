//! Three floors and the doors on top: arrows go down and never sideways.

use std::collections::BTreeMap;
use std::path::Path;

/// The floor of each crate; 0 is the ground.
fn floors() -> BTreeMap<&'static str, u32> {
    let mut floors = BTreeMap::from([("physics", 0)]);
    for middle in [
        "formats",
        "hdr",
        "profile",
        "raw",
        "fit",
        "synth",
        "tables",
        "layers",
        "montecarlo",
        "render",
        "transport",
    ] {
        floors.insert(middle, 1);
    }
    // The roof joins the stages; the doors are what people open.
    floors.extend([("report", 2), ("pipeline", 3), ("cli", 4), ("python", 4)]);
    floors
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// The crates of ours that `manifest` depends on outside its tests.
fn dependencies(manifest: &str) -> Vec<String> {
    let table: toml::Table = manifest.parse().unwrap();
    ["dependencies", "build-dependencies"]
        .iter()
        .filter_map(|key| table.get(*key)?.as_table())
        .flat_map(|section| section.keys().cloned())
        .filter(|name| floors().contains_key(name.as_str()))
        .collect()
}

/// Every arrow of `manifest`, whose crate is `name`, that does not go down.
fn offences(name: &str, manifest: &str) -> Vec<String> {
    let floors = floors();
    dependencies(manifest)
        .into_iter()
        .filter(|below| floors[below.as_str()] >= floors[name])
        .map(|below| format!("{name} -> {below}"))
        .collect()
}

#[test]
fn every_crate_has_a_floor_and_every_arrow_goes_down() {
    let mut seen = vec![];
    let mut offenders = vec![];
    for entry in std::fs::read_dir(root().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        assert!(
            floors().contains_key(name.as_str()),
            "crates/{name} has no floor: give it one here"
        );
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        offenders.extend(offences(&name, &manifest));
        seen.push(name);
    }
    assert_eq!(seen.len(), floors().len(), "{seen:?}");
    assert!(offenders.is_empty(), "{offenders:?}");
}

#[test]
fn an_arrow_that_goes_up_or_sideways_is_seen() {
    let sideways = "[dependencies]\nphysics.workspace = true\nformats.workspace = true\n";
    assert_eq!(offences("hdr", sideways), ["hdr -> formats"]);
    assert_eq!(
        offences("physics", "[dependencies]\nfit = { path = \"x\" }\n"),
        ["physics -> fit"]
    );
    assert!(offences("cli", sideways).is_empty());
}

/// The ground and the middle open nothing and parse no arguments; that they print nothing is a
/// lint of the workspace.
#[test]
fn only_the_roof_knows_files() {
    for (name, floor) in floors() {
        if floor > 1 {
            continue;
        }
        let mut folders = vec![root().join("crates").join(name).join("src")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                    continue;
                }
                let text = std::fs::read_to_string(&path).unwrap();
                for word in ["std::fs", "std::path", "clap::", "std::thread"] {
                    assert!(!text.contains(word), "{} uses {word}", path.display());
                }
            }
        }
    }
}
