//! `beamspot doctor`

use super::print;
use crate::args::Common;
use physics::simd::SimdPath;
use pipeline::error::Blame;
use pipeline::files::Outputs;
use pipeline::fit_json::SCHEMA_VERSION;
use pipeline::library::{self, MODELS, ModelChoice};
use pipeline::simulation::{self, Part};
use pipeline::{Error, Kind, Result, Silent};
use report::{significant, uncertain};
use serde::Serialize;
use std::io::Write;
use std::path::Path;

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    beamspot_version: &'static str,
    target: String,
    build: &'static str,
    /// Whether camera RAW is read.
    raw: bool,
    models: [&'static str; MODELS.len()],
    /// The instruction paths of this processor, slowest first.
    simd_available: Vec<&'static str>,
    /// The one that is taken: the last of them.
    simd: &'static str,
    processors: Option<usize>,
    threads: usize,
    checks: Vec<Check>,
}

/// Something without which beamspot would not work, and whether it does.
#[derive(Serialize)]
struct Check {
    what: &'static str,
    good: bool,
    /// What was found, and what to do where it is not good.
    said: String,
}

/// Says what this beamspot is, what it found of the machine, and whether both work.
pub(crate) fn run(common: Common, out: &mut impl Write) -> Result<()> {
    let document = Document {
        schema_version: SCHEMA_VERSION,
        beamspot_version: env!("CARGO_PKG_VERSION"),
        target: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
        build: if cfg!(debug_assertions) {
            "debug"
        } else {
            "release"
        },
        raw: cfg!(feature = "raw"),
        models: MODELS,
        simd_available: SimdPath::ALL
            .into_iter()
            .filter(|path| path.is_available())
            .map(SimdPath::name)
            .collect(),
        simd: SimdPath::best().name(),
        processors: std::thread::available_parallelism().ok().map(Into::into),
        threads: rayon::current_num_threads(),
        checks: vec![table(), photons(), folder()],
    };
    if common.json {
        print::json(out, &document)?;
    } else {
        text(out, &document)?;
    }
    let bad = document.checks.iter().find(|check| !check.good);
    bad.map_or(Ok(()), |check| {
        let message = format!("{}: {}", check.what, check.said);
        Err(Error::new(Kind::Fault, message))
    })
}

fn text(out: &mut impl Write, document: &Document) -> Result<()> {
    let raw = if document.raw {
        "read"
    } else {
        "not read: build with --features raw (its decoder is under the LGPL), or convert to DNG"
    };
    let slow = if document.build == "debug" {
        " (slow: build with --release)"
    } else {
        ""
    };
    let processors = document
        .processors
        .map_or(String::new(), |n| format!(" of {n} processors"));
    let rows = [
        (
            "beamspot",
            format!(
                "{}, {} build{slow}",
                document.beamspot_version, document.build
            ),
        ),
        ("machine", document.target.clone()),
        (
            "instructions",
            format!(
                "{} (of {}); results on one path repeat to the byte",
                document.simd,
                document.simd_available.join(", ")
            ),
        ),
        ("threads", format!("{}{processors}", document.threads)),
        ("camera RAW", raw.to_owned()),
        ("models", document.models.join(", ")),
    ];
    for (what, said) in rows {
        print::line(out, format!("{what:13} {said}"))?;
    }
    for Check { what, good, said } in &document.checks {
        let word = if *good { "good" } else { "BAD" };
        print::line(out, format!("{what:13} {word}: {said}"))?;
    }
    Ok(())
}

/// Whether the shipped tables are whole.
fn table() -> Check {
    let transport = ModelChoice {
        name: "monte-carlo".to_owned(),
        g: Some(0.8),
        ..ModelChoice::default()
    };
    let rows = library::materials().len();
    let (good, said) = match library::model(&transport, 1.4) {
        Ok(_) => (true, format!("{rows} rows of materials, and transport")),
        Err(error) => (false, format!("{error}; install beamspot again")),
    };
    Check {
        what: "tables",
        good,
        said,
    }
}

/// Whether photons, on the instructions that are taken, agree with what van de Hulst's method gives
/// for the same half-space (Giovanelli 1955, as quoted by Wang, Jacques and Zheng 1995).
fn photons() -> Check {
    const MEDIUM: &str =
        "[[layer]]\nsigma_a_per_mm = 0.1\nsigma_s_per_mm = 0.9\ng = 0.0\neta = 1.5\n";
    // 0.2600 in all, of which 0.04 is reflected at the surface.
    const EXPECTED: f64 = 0.2200;
    let found = formats::medium_toml::parse(MEDIUM)
        .fault("the medium of the check")
        .and_then(|medium| simulation::run(&medium, 200_000, Part::WHOLE, 1, None, &Silent));
    let (good, said) = match found {
        Ok(photons) => {
            let found = photons.tally().reflectance();
            // Half a unit of the last digit of what is expected comes on top.
            let good = (found.value - EXPECTED).abs() < 4.0 * found.u + 5e-5;
            let way = if good {
                ""
            } else {
                "; try --simd portable, and please report it"
            };
            let (found, expected) = (uncertain(found.value, found.u), significant(EXPECTED, 4));
            (
                good,
                format!("diffuse reflectance {found}, expected {expected}{way}"),
            )
        }
        Err(error) => (false, error.to_string()),
    };
    Check {
        what: "photons",
        good,
        said,
    }
}

/// Whether outputs can be written where you stand.
fn folder() -> Check {
    let (good, said) = match Outputs::new(Path::new("."), [""; 0], &[], false) {
        Ok(_) => (true, "files can be written here".to_owned()),
        Err(error) => (false, format!("{error}; give -o a folder of your own")),
    };
    Check {
        what: "folder",
        good,
        said,
    }
}
