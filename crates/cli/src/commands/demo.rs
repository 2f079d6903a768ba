//! `beamspot demo`

use super::{measure::summary, print};
use crate::args::{Common, DemoArgs};
use pipeline::fit_json::FitDocument;
use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, measure};
use pipeline::{Error, Kind, Monitor, Result, capture, outputs, synthesis};
use report::{significant, text_table, uncertain};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The material of the demonstration, the paper's Figure 6.
const MATERIAL: &str = "Marble";
/// Any would do; this one is written down so that everybody sees the same.
const SEED: u64 = 2001;

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    truth: Vec<Truth>,
    fit: FitDocument,
}

#[derive(Serialize)]
struct Truth {
    channel: String,
    sigma_a_per_mm: f64,
    sigma_s_prime_per_mm: f64,
}

/// Writes a synthetic capture, measures it from its files and compares with what made it.
pub(crate) fn run(
    args: &DemoArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let folder = match &args.output {
        Some(folder) => folder.clone(),
        None => fresh_folder()?,
    };
    let sample = synthesis::sample_of(MATERIAL)?;
    let frames = folder.join("capture");
    let camera = synth::Camera::default();
    let manifest = synthesis::write(
        &sample,
        camera,
        &ModelChoice::default(),
        SEED,
        &frames,
        common.force,
        monitor,
    )?;

    let loaded = capture::load(&manifest)?;
    let files = outputs::open(&loaded, &folder, common.force)?;
    let measurement = measure(&loaded, &Choices::default(), monitor)?;
    outputs::write(files, &loaded, &measurement)?;

    if common.json {
        let truth = sample
            .channels
            .iter()
            .map(|(channel, c)| Truth {
                channel: channel.clone(),
                sigma_a_per_mm: c.sigma_a,
                sigma_s_prime_per_mm: c.sigma_s_prime,
            })
            .collect();
        let schema_version = pipeline::fit_json::SCHEMA_VERSION;
        return print::json(
            out,
            &Document {
                schema_version,
                truth,
                fit: measurement.document(),
            },
        );
    }
    print::line(
        out,
        format!("photographed (synthetically): {}", manifest.display()),
    )?;
    summary(out, &measurement, &folder, common)?;
    print::line(out, "\nrecovered against true, mm^-1:")?;
    let header = [
        "channel",
        "coefficient",
        "true",
        "recovered",
        "error",
        "in u",
    ];
    let mut rows = vec![];
    for (fit, (channel, truth)) in measurement.fits.iter().zip(&sample.channels) {
        for (name, found, truth) in [
            ("sigma_a", &fit.sigma_a, truth.sigma_a),
            ("sigma_s'", &fit.sigma_s_prime, truth.sigma_s_prime),
        ] {
            let error = found.value - truth;
            rows.push(vec![
                channel.clone(),
                name.to_owned(),
                significant(truth, 4),
                uncertain(found.value, found.u),
                format!("{:+.2} %", 100.0 * error / truth),
                format!("{:+.1}", error / found.u),
            ]);
        }
    }
    print::line(out, text_table(&header, &rows).trim_end())
}

/// `beamspot-demo`, or the first numbered one that is not there yet.
fn fresh_folder() -> Result<PathBuf> {
    let named = |n: u32| {
        if n == 1 {
            PathBuf::from("beamspot-demo")
        } else {
            format!("beamspot-demo-{n}").into()
        }
    };
    (1..10_000)
        .map(named)
        .find(|folder| !Path::new(folder).exists())
        .ok_or_else(|| {
            Error::new(
                Kind::Input,
                "there are 10,000 beamspot-demo folders here: give one with -o",
            )
        })
}
