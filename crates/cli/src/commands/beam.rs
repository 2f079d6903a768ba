//! `beamspot beam`

use super::print;
use crate::args::{BeamArgs, Common};
use ::profile::{Background, View};
use pipeline::fit_json::{InputHash, SCHEMA_VERSION};
use pipeline::spot::{self, Spot};
use pipeline::{Monitor, Result, capture};
use report::{text_table, uncertain};
use serde::Serialize;
use std::io::Write;

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    inputs: Vec<InputHash>,
    channels: Vec<Channel>,
}

#[derive(Serialize)]
struct Channel {
    channel: String,
    center_px: [f64; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    u_center_px: Option<[f64; 2]>,
    /// Along the principal axes, the larger first.
    d4sigma_px: [f64; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    u_d4sigma_px: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    d4sigma_mm: Option<[f64; 2]>,
    /// From the rows' direction to the axis of the larger width, toward increasing rows.
    angle_deg: f64,
    background: f64,
    aperture_share: f64,
}

/// Prints centre and d4σ widths of the beam in a frame, or on the reference of a capture.
pub(crate) fn run(
    args: &BeamArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let is_capture = args
        .input
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let (spots, input, view) = if is_capture {
        let loaded = capture::load(&args.input)?;
        let spots = spot::of_reference(&loaded, monitor)?;
        let view = loaded.view()?;
        (spots, loaded.input, Some(view))
    } else {
        let (spots, input) = spot::of_frame(&args.input)?;
        (spots, input, None)
    };
    let channels: Vec<Channel> = spots.iter().map(|s| channel(s, view)).collect();
    if common.json {
        let inputs = vec![InputHash {
            file: input.name,
            blake3: input.blake3,
        }];
        let schema_version = SCHEMA_VERSION;
        return print::json(
            out,
            &Document {
                schema_version,
                inputs,
                channels,
            },
        );
    }
    let header = [
        "channel",
        "centre x, y [px]",
        "d4sigma [px]",
        "angle [deg]",
        "background",
    ];
    let pair = |values: [f64; 2], u: Option<[f64; 2]>, join: &str| match u {
        Some(u) => format!(
            "{}{join}{}",
            uncertain(values[0], u[0]),
            uncertain(values[1], u[1])
        ),
        None => format!("{:.2}{join}{:.2}", values[0], values[1]),
    };
    let rows: Vec<Vec<String>> = channels
        .iter()
        .map(|c| {
            vec![
                c.channel.clone(),
                pair(c.center_px, c.u_center_px, ", "),
                pair(c.d4sigma_px, c.u_d4sigma_px, " x "),
                format!("{:.1}", c.angle_deg),
                report::significant(c.background, 4),
            ]
        })
        .collect();
    print::line(out, text_table(&header, &rows).trim_end())?;
    for c in &channels {
        if let Some([major, minor]) = c.d4sigma_mm {
            let text = format!("{}: d4sigma {major:.4} x {minor:.4} mm", c.channel);
            print::line(out, text)?;
        }
        if c.aperture_share < 0.99 {
            let text = format!(
                "{}: only {:.0} % of the three widths over which moments are taken lie in the picture: \
                 the beam may be cut off",
                c.channel,
                100.0 * c.aperture_share
            );
            print::line(out, text)?;
        }
    }
    Ok(())
}

fn channel(spot: &Spot, view: Option<View>) -> Channel {
    let moments = &spot.moments;
    let knows_noise = spot.background == Background::Surroundings;
    Channel {
        channel: spot.channel.clone(),
        center_px: moments.center_px,
        u_center_px: knows_noise.then_some(moments.u_center_px),
        d4sigma_px: moments.d4sigma_px,
        u_d4sigma_px: knows_noise.then_some(moments.u_d4sigma_px),
        d4sigma_mm: view
            .and_then(|view| view.square_mm())
            .map(|mm| moments.d4sigma_px.map(|d| d * mm)),
        angle_deg: moments.angle.to_degrees(),
        background: moments.background,
        aperture_share: moments.aperture_share,
    }
}
