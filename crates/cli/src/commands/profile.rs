//! `beamspot profile`

use super::print;
use crate::args::{Common, ProfileArgs};
use ::profile::{Measured, ProfileOptions, View, slice_profile};
use physics::{RadialProfile, RadianceMap, TotalReflectance};
use pipeline::error::Blame;
use pipeline::files::{Outputs, open, split};
use pipeline::{Error, Kind, Monitor, Result, capture, measure};
use report::{text_table, uncertain};
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    output: String,
    channels: Vec<Channel>,
}

#[derive(Serialize)]
struct Channel {
    channel: String,
    center_px: [f64; 2],
    points: usize,
    total_reflectance: f64,
    u_total_reflectance: f64,
    radius_max_mm: Option<f64>,
    u_scale_relative: f64,
    rejected_pixels: u64,
    unmeasured_pixels: u64,
}

/// A picture in mm⁻², and what a profile of it needs.
struct Picture {
    map: RadianceMap,
    u_scale_relative: Vec<f64>,
    u_offset_per_mm2: Vec<f64>,
    view: View,
    centers_px: Vec<Option<[f64; 2]>>,
    sectors_deg: Vec<[f64; 2]>,
}

/// Writes the profile of a capture or a radiance map, and its totals beside it.
pub(crate) fn run(
    args: &ProfileArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let (folder, name) = split(&args.output)?;
    let is_map = args
        .input
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    let totals_name = PathBuf::from("totals.csv");
    let outputs_beside =
        |inputs: &[PathBuf]| Outputs::new(&folder, [&name, &totals_name], inputs, common.force);
    let (picture, outputs) = if is_map {
        let outputs = outputs_beside(std::slice::from_ref(&args.input))?;
        (from_map(args)?, outputs)
    } else {
        let loaded = capture::load(&args.input)?;
        let outputs = outputs_beside(&loaded.paths())?;
        (from_capture(&loaded, monitor)?, outputs)
    };
    let place = args.input.display();
    let measured = measure::profiles(
        &picture.map,
        &picture.u_scale_relative,
        &picture.u_offset_per_mm2,
        picture.view,
        &picture.centers_px,
        &picture.sectors_deg,
    )
    .map_err(|e| e.within(&place))?;
    let profiles = if args.slice {
        slices(&picture, &measured).map_err(|e| e.within(&place))?
    } else {
        measured.iter().map(|m| m.profile.clone()).collect()
    };
    let totals: Vec<TotalReflectance> = measured.iter().map(|m| m.total.clone()).collect();
    outputs.write(&name, |out| {
        Ok(formats::profile_csv::write(&profiles, out)?)
    })?;
    outputs.write(&totals_name, |out| {
        Ok(formats::totals_csv::write(&totals, out)?)
    })?;
    outputs.commit()?;
    print_summary(args, common, &measured, &profiles, out)
}

fn from_capture(loaded: &capture::Loaded, monitor: &dyn Monitor) -> Result<Picture> {
    let radiance = measure::radiance(loaded, monitor)?;
    let centers_px = pipeline::geometry::centers(loaded, &radiance, false)?.px;
    Ok(Picture {
        u_scale_relative: radiance.scales.iter().map(|s| s.u_relative).collect(),
        u_offset_per_mm2: radiance.u_offsets(),
        map: radiance.map,
        view: radiance.view,
        centers_px,
        sectors_deg: loaded.capture.sample.sectors_deg.clone(),
    })
}

fn from_map(args: &ProfileArgs) -> Result<Picture> {
    let place = args.input.display();
    let file = formats::read_radiance(open(&args.input)?).input(&place)?;
    let missing = |what: &str| Error::new(Kind::Input, format!("{place}: {what}"));
    if file.scale.is_empty() {
        return Err(missing(
            "the map is in DN/s; expected one that a white reference has scaled to mm^-2, as \
             `beamspot hdr` writes it",
        ));
    }
    let view = match (file.view_mm, file.mm_per_pixel) {
        (Some(rows), _) => View::from_rows(rows).input(&place)?,
        (None, Some(side)) => View::square(side),
        (None, None) => {
            return Err(missing(
                "attribute `beamspot.mm_per_pixel` is missing; make the file with `beamspot hdr`",
            ));
        }
    };
    let centers_px = vec![None; file.scale.len()];
    Ok(Picture {
        u_scale_relative: file.scale.iter().map(|s| s.u_scale_relative).collect(),
        u_offset_per_mm2: file.scale.iter().map(|s| s.u_offset_per_mm2).collect(),
        map: file.map.into_owned(),
        view,
        centers_px,
        sectors_deg: vec![],
    })
}

fn slices(picture: &Picture, measured: &[Measured]) -> Result<Vec<RadialProfile>> {
    let RadianceMap { width, height, .. } = picture.map;
    measured
        .iter()
        .enumerate()
        .map(|(index, m)| {
            let channel = &*picture.map.channel(index);
            let options = ProfileOptions {
                view: picture.view,
                center_px: Some(m.center_px),
                ..ProfileOptions::default()
            };
            slice_profile(channel, width, height, &options)
                .map(|m| m.profile)
                .input(format!("channel {}", channel.name))
        })
        .collect()
}

fn print_summary(
    args: &ProfileArgs,
    common: Common,
    measured: &[Measured],
    profiles: &[RadialProfile],
    out: &mut impl Write,
) -> Result<()> {
    let output = args.output.display().to_string();
    if common.json {
        let channels = measured
            .iter()
            .zip(profiles)
            .map(|(m, profile)| Channel {
                channel: m.total.channel.clone(),
                center_px: m.center_px,
                points: profile.points.len(),
                total_reflectance: m.total.total_reflectance,
                u_total_reflectance: m.total.u_total_reflectance,
                radius_max_mm: m.total.radius_max_mm,
                u_scale_relative: m.total.u_scale_relative,
                rejected_pixels: m.rejected_pixels,
                unmeasured_pixels: m.unmeasured_pixels,
            })
            .collect();
        let schema_version = pipeline::fit_json::SCHEMA_VERSION;
        return print::json(
            out,
            &Document {
                schema_version,
                output,
                channels,
            },
        );
    }
    let header = [
        "channel",
        "centre [px]",
        "points",
        "total inside",
        "within [mm]",
        "u(scale)",
        "rejected",
    ];
    let rows: Vec<Vec<String>> = measured
        .iter()
        .zip(profiles)
        .map(|(m, profile)| {
            vec![
                m.total.channel.clone(),
                format!("{:.2}, {:.2}", m.center_px[0], m.center_px[1]),
                profile.points.len().to_string(),
                uncertain(m.total.total_reflectance, m.total.u_total_reflectance),
                m.total
                    .radius_max_mm
                    .map_or("all".to_owned(), |r| format!("{r:.2}")),
                format!("{:.2} %", 100.0 * m.total.u_scale_relative),
                m.rejected_pixels.to_string(),
            ]
        })
        .collect();
    print::line(out, text_table(&header, &rows).trim_end())?;
    print::line(out, format!("wrote {output}, and totals.csv beside it"))
}
