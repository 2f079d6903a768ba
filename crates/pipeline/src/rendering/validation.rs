//! All methods on one scene: pictures, and how far the models are from transport.

use super::difference::{ChannelDifference, difference_frame, differences, flip};
use super::outputs::{FaceLine, developed, faces, map, planes, radiance_file};
use super::{BssrdfModel, Loaded, MethodChoice, RenderOptions, render};
use crate::error::{Error, Kind, Result};
use crate::files::Outputs;
use crate::monitor::Monitor;
use formats::{encode_png, write_radiance};
use physics::RadianceMap;
use render::bssrdf::Sampling;
use render::{Gather, Kind as BrdfKind};
use report::{ValidationPage, ValidationRow, significant, uncertain, validation_html};
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

/// What one method made of the scene.
#[derive(Clone, Debug, Serialize)]
pub struct MethodLine {
    /// Its name, which is that of its picture, too.
    pub method: String,
    /// Rms of the pixels' standard errors over the mean pixel.
    pub relative_error: f64,
    /// Against `monte-carlo`, by channel; none where that cannot render the scene.
    pub differences: Vec<ChannelDifference>,
    /// Powers through faces, where light was followed from its lamp.
    pub faces: Vec<FaceLine>,
    /// Mean of HDR-FLIP against `monte-carlo`, of pictures of one or three channels.
    pub flip: Option<f64>,
    /// Seconds on the clock; in no file.
    #[serde(skip)]
    pub seconds: f64,
}

/// All methods.
#[derive(Clone, Debug, Serialize)]
pub struct Validation {
    /// One line a method, `monte-carlo` first.
    pub methods: Vec<MethodLine>,
    /// Why a method has no picture.
    pub left_out: Vec<String>,
}

fn methods(layered: bool) -> Vec<(String, MethodChoice)> {
    let mut all = vec![("monte-carlo".to_owned(), MethodChoice::MonteCarlo)];
    for (name, model) in BssrdfModel::ALL {
        let choice = MethodChoice::Bssrdf(model, Sampling::Axes);
        all.push((format!("bssrdf-{name}"), choice));
    }
    for (name, gather) in [
        ("hierarchy", Gather::HIERARCHY),
        ("smoothstep", Gather::Smoothstep { radius: None }),
    ] {
        let choice = MethodChoice::PointCloud(BssrdfModel::Jensen2001, gather);
        all.push((format!("point-cloud-{name}"), choice));
    }
    for (name, kind) in [("jensen", BrdfKind::Jensen), ("lambert", BrdfKind::Lambert)] {
        all.push((format!("brdf-{name}"), MethodChoice::Brdf(kind)));
    }
    if layered {
        all.push(("brdf-layered".to_owned(), MethodChoice::Layered));
    }
    all
}

/// Head and rows of the powers through faces, a column for each channel.
fn face_table(loaded: &Loaded, faces: &[FaceLine]) -> Vec<Vec<String>> {
    let channels = &loaded.scene.channels;
    let of_channel = |k: usize| faces.iter().filter(move |f| f.channel == channels[k]);
    let rows = of_channel(0).enumerate().map(|(row, face)| {
        let powers = (0..channels.len()).filter_map(|k| of_channel(k).nth(row));
        let powers = powers.map(|f| uncertain(f.power.value, f.power.u));
        let name = format!("{}, {}", face.object, face.face);
        std::iter::once(name).chain(powers).collect()
    });
    let head = channels.iter().map(|channel| format!("{channel}, W"));
    let head = std::iter::once("power out through".to_owned()).chain(head);
    let mut table: Vec<Vec<String>> = rows.collect();
    if !table.is_empty() {
        table.insert(0, head.collect());
    }
    table
}

/// Renders a scene by every method into `folder`, with one page beside the pictures.
///
/// # Errors
///
/// The outputs exist, an interrupt, or a fault of ours. A method that cannot render the scene says
/// why in [`Validation::left_out`].
pub fn validate(
    loaded: &Loaded,
    options: &RenderOptions,
    folder: &Path,
    force: bool,
    monitor: &dyn Monitor,
) -> Result<Validation> {
    let all = methods(loaded.layers.iter().all(|layers| !layers.is_empty()));
    let endings = ["", "-difference", "-flip"];
    let pictures = all.iter().flat_map(|(name, _)| {
        let pngs = endings.map(|ending| format!("{name}{ending}.png"));
        pngs.into_iter().chain([format!("{name}.exr")])
    });
    let names = pictures.chain(["validation.html", "validation.json"].map(str::to_owned));
    let files = Outputs::new(folder, names, &loaded.inputs, force)?;

    let mut found = Validation {
        methods: vec![],
        left_out: vec![],
    };
    let mut truth: Option<RadianceMap> = None;
    let mut exposure = options.exposure;
    let mut rows = vec![];
    for (name, method) in all {
        let options = RenderOptions {
            method,
            components: false,
            ..options.clone()
        };
        let start = Instant::now();
        let picture = match render(loaded, &options, None, monitor) {
            Ok(picture) => picture,
            Err(e) if e.kind() == Kind::Input => {
                found.left_out.push(format!("{name}: {e}"));
                continue;
            }
            Err(e) => return Err(e),
        };
        monitor.check()?;
        let seconds = start.elapsed().as_secs_f64();
        let planes = planes(loaded, &options);
        let picture_map = map(loaded, &planes, &picture);
        let file = radiance_file(loaded, &options, &picture, &picture_map);
        files.write(format!("{name}.exr"), |out| Ok(write_radiance(&file, out)?))?;
        // All pictures under one exposure: that of the first.
        let (frame, used) = developed(&loaded.scene, planes.len(), &picture, exposure);
        exposure = Some(used);
        files.write(format!("{name}.png"), |out| Ok(encode_png(&frame, out)?))?;
        let mut line = MethodLine {
            method: name.clone(),
            relative_error: picture.radiance.relative_error(),
            differences: vec![],
            faces: faces(loaded, &picture),
            flip: None,
            seconds,
        };
        let mut row = ValidationRow {
            name: name.clone(),
            picture: format!("{name}.png"),
            difference: None,
            flip: None,
            faces: face_table(loaded, &line.faces),
            lines: vec![if line.relative_error.is_finite() {
                format!("noise {} %", significant(100.0 * line.relative_error, 3))
            } else {
                "noise not known from one round".to_owned()
            }],
        };
        match &truth {
            Some(truth) => {
                line.differences = differences(&picture_map, truth);
                if matches!(truth.channels.len(), 1 | 3) {
                    let (mean, frame) = flip(&picture_map, truth);
                    row.lines.push(format!("HDR-FLIP {}", significant(mean, 3)));
                    line.flip = Some(mean);
                    let shown = format!("{name}-flip.png");
                    files.write(&shown, |out| Ok(encode_png(&frame, out)?))?;
                    row.flip = Some(shown);
                }
                for d in &line.differences {
                    row.lines.push(format!(
                        "{}: mean {} of transport's, rms beyond noise {} %, median block {} %",
                        d.channel,
                        significant(d.mean[0] / d.mean[1], 3),
                        significant(100.0 * d.relative_beyond_noise, 3),
                        significant(100.0 * d.median_relative_by_block.unwrap_or(0.0), 3),
                    ));
                }
                let (frame, full) = difference_frame(&picture_map, truth);
                let shown = format!("{name}-difference.png");
                files.write(&shown, |out| Ok(encode_png(&frame, out)?))?;
                row.difference = Some((shown, significant(full, 3)));
            }
            None if method == MethodChoice::MonteCarlo => truth = Some(picture_map),
            None => {}
        }
        rows.push(row);
        found.methods.push(line);
    }
    if rows.is_empty() {
        return Err(Error::new(Kind::Input, found.left_out.join("; ")));
    }
    let title = loaded
        .path
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into());
    let page = ValidationPage {
        title,
        exposure: significant(exposure.unwrap_or(1.0), 3),
        rows,
        notes: found
            .left_out
            .iter()
            .chain(&loaded.warnings)
            .cloned()
            .collect(),
        tool: concat!("beamspot ", env!("CARGO_PKG_VERSION")),
    };
    files.write("validation.html", |out| {
        Ok(out.write_all(validation_html(&page).as_bytes())?)
    })?;
    files.write("validation.json", |out| {
        serde_json::to_writer_pretty(&mut *out, &found)?;
        Ok(out.write_all(b"\n")?)
    })?;
    files.commit()?;
    Ok(found)
}
