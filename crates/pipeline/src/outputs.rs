//! What a measurement leaves behind.

use crate::capture::Loaded;
use crate::error::Result;
use crate::files::Outputs;
use crate::fitting::{model_curve, transport_curve, u_model_curve};
use crate::measure::Measurement;
use crate::picture::{self, Seen};
use crate::swatch::swatch;
use physics::ProfilePoint;
use physics::footprint::Beam;
use report::{
    ChannelReport, CurvePoint, ExposureRow, Report, figure_svg, picture_svg, report_html,
};
use std::io::Write;
use std::path::Path;

/// The files of a measurement; a figure of each channel comes on top.
const NAMES: [&str; 7] = [
    "radiance.exr",
    "profile.csv",
    "totals.csv",
    "beam.csv",
    "fit.json",
    "materials.csv",
    "report.html",
];

/// Name of the figure of this `kind` of a channel.
fn figure_name(kind: &str, channel: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() { c } else { '_' };
    format!(
        "{kind}_{}.svg",
        channel.chars().map(safe).collect::<String>()
    )
}

/// Opens the outputs of measuring `loaded` into `folder`, and refuses what is in the way.
///
/// # Errors
///
/// One of the files exists and is not to be replaced.
pub fn open(loaded: &Loaded, folder: &Path, force: bool) -> Result<Outputs> {
    // Before the frames are read nobody knows which channels there are.
    let figures = ["R", "G", "B", "Y"]
        .into_iter()
        .flat_map(|channel| ["profile", "picture"].map(|kind| figure_name(kind, channel)));
    let names = NAMES.into_iter().map(str::to_owned).chain(figures);
    Outputs::new(folder, names, &loaded.paths(), force)
}

/// Writes everything and moves it into place.
///
/// # Errors
///
/// The disk is full, or an output has appeared meanwhile.
pub fn write(files: Outputs, loaded: &Loaded, measurement: &Measurement) -> Result<()> {
    let radiance = measurement.radiance.to_file(loaded);
    files.write("radiance.exr", |out| {
        Ok(formats::write_radiance(&radiance, out)?)
    })?;
    let profiles = measurement.profiles();
    files.write("profile.csv", |out| {
        Ok(formats::profile_csv::write(&profiles, out)?)
    })?;
    let totals = measurement.totals();
    files.write("totals.csv", |out| {
        Ok(formats::totals_csv::write(&totals, out)?)
    })?;
    let beams = measurement.fits.iter().zip(&measurement.beams);
    let spreads = beams.filter_map(|(fit, beam)| match &beam.beam {
        Beam::Measured(spread) => Some((fit.channel.as_str(), spread)),
        _ => None,
    });
    files.write("beam.csv", |out| {
        Ok(formats::beam_csv::write(spreads, out)?)
    })?;
    let document = measurement.document();
    files.write("fit.json", |out| {
        Ok(out.write_all(document.to_json()?.as_bytes())?)
    })?;
    let rows = &measurement.materials;
    files.write("materials.csv", |out| {
        Ok(formats::materials_csv::write(rows, out)?)
    })?;

    let mut channels = vec![];
    for (index, ((fit, profile), row)) in
        measurement.fits.iter().zip(&profiles).zip(rows).enumerate()
    {
        let given = &measurement.given[index];
        let seen = given.entry_factor(given.eta) * fit.scale;
        let monte_carlo = measurement.confirmation(index).map_or(vec![], |c| {
            let place = |p: &ProfilePoint| CurvePoint {
                radius_mm: p.radius_mm,
                reflectance_per_mm2: seen * p.reflectance_per_mm2,
            };
            c.curve.iter().map(place).collect()
        });
        let points = |curve: Vec<(f64, f64)>| -> Vec<CurvePoint> {
            let place = |(radius_mm, reflectance_per_mm2)| CurvePoint {
                radius_mm,
                reflectance_per_mm2,
            };
            curve.into_iter().map(place).collect()
        };
        channels.push(ChannelReport {
            fit,
            profile,
            wavelength_nm: row.wavelength_nm,
            model_curve: points(model_curve(profile, fit, given)?),
            u_model_per_mm2: u_model_curve(profile, fit, given)?,
            transport: transport_curve(profile, fit, given)?.map_or(vec![], points),
            total_reflectance: row.total_reflectance.unwrap_or(0.0),
            monte_carlo,
            truth: None,
        });
    }
    let mut comparison = vec![];
    for (index, profile) in profiles.iter().enumerate() {
        let reports = measurement
            .compared
            .iter()
            .map(|compared| compared.report(index, profile));
        comparison.push(
            reports
                .collect::<Result<Vec<_>>>()?
                .into_iter()
                .flatten()
                .collect(),
        );
    }
    let radiance = &measurement.radiance;
    let pictures = measurement.measured.iter().enumerate();
    let pictures = pictures.map(|(index, measured)| {
        let fit = &measurement.fits[index];
        let seen = Seen {
            name: fit.channel.clone(),
            channel: &radiance.map.channel(index),
            size: (radiance.map.width, radiance.map.height),
            view: &radiance.view,
            measured,
            sectors_deg: &loaded.capture.sample.sectors_deg,
            range_mm: fit.range_mm,
        };
        picture::picture(&seen, measurement.measured.len())
    });
    let pictures = pictures.collect::<Result<Vec<_>>>()?;
    let exposures = radiance.frames.iter().map(|frame| ExposureRow {
        subject: frame.subject.field().to_owned(),
        exposure_s: frame.exposure_s,
        used_and_saturated: frame.channels.iter().map(|(_, shares)| *shares).collect(),
    });
    let given = measurement.common();
    let page = Report {
        material: &measurement.material,
        eta: given.eta,
        u_eta: given.u_eta,
        model: &given.model.name,
        constraint: given.constraint,
        channels,
        warnings: measurement.warnings.clone(),
        assumptions: measurement.assumptions.clone(),
        comparison,
        verdict: measurement.verdict_lines(),
        confirmation: measurement.confirmation_lines(),
        beam: measurement.beam_lines(),
        merge: measurement.radiance.merge_lines.clone(),
        exposures: exposures.collect(),
        pictures,
        swatch: swatch(&measurement.fits, &measurement.given),
        tool: concat!("beamspot ", env!("CARGO_PKG_VERSION")),
        settings: measurement.settings(),
        inputs: measurement
            .radiance
            .inputs
            .iter()
            .map(|i| report::Input {
                name: i.name.clone(),
                blake3: i.blake3.clone(),
            })
            .collect(),
    };
    for channel in &page.channels {
        let name = figure_name("profile", &channel.fit.channel);
        let svg = figure_svg(&measurement.material, channel);
        files.write(name, |out| Ok(out.write_all(svg.as_bytes())?))?;
    }
    for picture in &page.pictures {
        let name = figure_name("picture", &picture.channel);
        let svg = picture_svg(&measurement.material, picture);
        files.write(name, |out| Ok(out.write_all(svg.as_bytes())?))?;
    }
    files.write("report.html", |out| {
        Ok(out.write_all(report_html(&page).as_bytes())?)
    })?;
    files.commit()
}
