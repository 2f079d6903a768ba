//! Captures at the level of profiles, as the default camera of `synth` takes them.

use physics::profile::mean_radius;
use physics::{Coefficients, ForwardModel, ProfilePoint, RadialProfile, TotalReflectance};
use pipeline::fitting::{Given, ScaleInput};
use pipeline::library::ModelChoice;
use profile::Exit;

/// Largest radius of the picture, mm.
const REACH_MM: f64 = 20.5;
const PIXEL_MM: f64 = 0.04;
/// Electrons of a pixel that is just unsaturated in some exposure, and read noise.
const FULL_E: f64 = 20_000.0;
const READ_E: f64 = 2.0;
/// R_d that just saturates the longest exposure, mm⁻²: what is darker has fewer electrons.
const LONGEST_PER_MM2: f64 = 1e-4;

/// Rings 5 % wide, none below 0.06 mm.
fn edges() -> Vec<f64> {
    let mut edges: Vec<f64> = vec![0.0];
    let mut last: f64 = 0.0;
    while last < REACH_MM {
        last = (last + (0.05 * last).max(0.06)).min(REACH_MM);
        edges.push(last);
    }
    edges
}

/// Rings, their noise, and the total of `medium`, without noise on the values.
///
/// A ring's mean is taken from the light beyond its edges, for a point beam: its values are those
/// of `model` where no beam blurs them.
pub(crate) fn noiseless(
    model: &dyn ForwardModel,
    entry_factor: f64,
    medium: Coefficients,
) -> (RadialProfile, TotalReflectance) {
    let (mut total, mut variance) = (0.0, 0.0);
    let edges = edges();
    let beyond: Vec<f64> = edges
        .iter()
        .map(|r| entry_factor * model.beyond(medium, *r))
        .collect();
    let points = edges
        .windows(2)
        .zip(beyond.windows(2))
        .map(|(edge, beyond)| {
            let ring = (edge[0], edge[1]);
            let mut point = ProfilePoint {
                ring_mm: Some(ring),
                radius_mm: mean_radius(ring.0, ring.1),
                reflectance_per_mm2: 0.0,
                u_reflectance_per_mm2: 0.0,
                pixels: None,
            };
            let area = point.area_mm2();
            let value = ((beyond[0] - beyond[1]) / area).max(0.0);
            // Electrons that R_d of 1 mm⁻² gives a pixel, in the best exposure for this value.
            let per_unit = FULL_E / value.max(LONGEST_PER_MM2);
            let pixel = (value * per_unit + READ_E * READ_E).sqrt() / per_unit;
            point.reflectance_per_mm2 = value;
            point.u_reflectance_per_mm2 = pixel * PIXEL_MM / area.sqrt();
            total += area * value;
            variance += (area * point.u_reflectance_per_mm2).powi(2);
            point
        })
        .collect();
    let channel = "G".to_owned();
    let total = TotalReflectance {
        channel: channel.clone(),
        total_reflectance: total,
        u_total_reflectance: variance.sqrt(),
        radius_max_mm: Some(REACH_MM),
        u_scale_relative: 0.0,
        u_offset_per_mm2: 0.0,
    };
    (RadialProfile { channel, points }, total)
}

/// What a fit of a closed form takes as given, nothing uncertain but the scale.
pub(crate) fn given(model: ModelChoice, eta: f64) -> Given {
    Given {
        discrepancy: false,
        constraint: fit::Constraint::Joint,
        exit: Exit::Fresnel { eta, angle: 0.0 },
        ..Given::of(model, eta)
    }
}

/// A scale with this relative standard uncertainty.
pub(crate) fn scale(u_relative: f64) -> [ScaleInput; 1] {
    [ScaleInput {
        source: "white reference",
        u_relative,
    }]
}
