//! From the radiance that a camera saw to exitance, as transport has it.
//!
//! `profile` takes the light inside as isotropic, which it is not near the beam nor in dark media:
//! half a percent for marble, a fifth for a reduced albedo of 0.6. A model that solves transport
//! knows the factor of its own medium, radius by radius, and the medium is what a fit finds: one
//! after the other until neither moves.

use crate::error::Result;
use crate::fitting::{Given, ScaleInput};
use crate::library;
use physics::footprint::{Blur, Footprints};
use physics::{Coefficients, ExitFactor, ForwardModel};
use profile::{Exit, Measured};

/// Rounds of fit and factor at most.
const ROUNDS: usize = 16;
/// Relative change of a coefficient from which on another round would change nothing.
const SETTLED: f64 = 1e-4;
/// Relative change of a coefficient in the last round from which on the rounds went astray.
const ASTRAY: f64 = 0.05;
/// Relative error that the data may have while only the diffuse factor is known, and share of a
/// coefficient's last change that the factor may still be off by. Without it, a fit of a dark medium
/// with permille noise may leave for another medium altogether, rather than bear a factor that is
/// off by a fifth.
const UNKNOWN: f64 = 0.1;
const FOLLOWS: f64 = 0.2;
/// Least and largest radius of the sum, in 1/σₜ′, and the ratio of one to the next.
const NEAREST: f64 = 1e-3;
const FARTHEST: f64 = 1e3;
const STEP: f64 = 1.1;
/// σₐ stays above this, mm⁻¹, to have a logarithm.
const LEAST: f64 = 1e-9;

/// `measured` with the factor of transport in place of the diffuse one, and a sentence on it;
/// `None` where the model of `given` knows no factor of its own, or the profile has no fit.
///
/// # Errors
///
/// The model is unknown.
pub(crate) fn of_transport(
    measured: &Measured,
    scale: &[ScaleInput],
    given: &Given,
) -> Result<Option<(Measured, String)>> {
    let Exit::Fresnel { angle, .. } = given.exit else {
        return Ok(None);
    };
    if !given.model.solves_transport() {
        return Ok(None);
    }
    let model = library::model(&given.model, given.eta)?;
    let u_scale = given.u_scale(scale);
    let diffuse = given.exit.factor();
    let fitted = |seen: &Measured, doubt: f64| {
        let mut profile = seen.profile.clone();
        for point in &mut profile.points {
            let doubted = doubt * point.reflectance_per_mm2;
            point.u_reflectance_per_mm2 = point.u_reflectance_per_mm2.hypot(doubted);
        }
        let options = given.options(u_scale.hypot(doubt));
        let fit = fit::fit(&profile, Some(&seen.total), &*model, &options).ok()?;
        let Coefficients {
            sigma_a,
            sigma_s_prime,
        } = fit.coefficients();
        Some([sigma_a.max(LEAST).ln(), sigma_s_prime.ln()])
    };
    // Where there is no fit, the real one will say why.
    let mut doubt = UNKNOWN;
    let Some(mut point) = fitted(measured, doubt) else {
        return Ok(None);
    };
    let (mut seen, mut sentence) = (measured.clone(), String::new());
    let mut before: Option<[[f64; 2]; 2]> = None;
    let mut off = f64::INFINITY;
    for _ in 0..ROUNDS {
        let at = Coefficients {
            sigma_a: point[0].exp(),
            sigma_s_prime: point[1].exp(),
        };
        let factor = model.exit_factor(at, angle.cos());
        seen = with(measured, &*model, at, &factor, diffuse, &given.blur());
        sentence = format!(
            "{}: radiance became exitance by transport's own factor, {:.3} over the plane, where \
             light that is isotropic inside would have {diffuse:.3}",
            measured.total.channel, factor.mean
        );
        let Some(found) = fitted(&seen, doubt) else {
            return Ok(None);
        };
        off = (0..2).fold(0.0, |most: f64, i| most.max((found[i] - point[i]).abs()));
        doubt = doubt.min(FOLLOWS * off);
        if off < SETTLED {
            break;
        }
        // In dark media the answer swings by half of what was put in: the secant takes that out.
        let next = std::array::from_fn(|i| {
            let slope = before.map_or(0.0, |[points, founds]| {
                let slope = (found[i] - founds[i]) / (point[i] - points[i]);
                if slope.is_finite() {
                    slope.clamp(-0.95, 0.5)
                } else {
                    0.0
                }
            });
            point[i] + (found[i] - point[i]) / (1.0 - slope)
        });
        before = Some([point, found]);
        point = next;
    }
    if off > ASTRAY {
        let sentence = format!(
            "{}: transport's own exit factor and the medium it belongs to did not settle: the \
             factor of isotropic light stands, which in so dark a medium may be off by tens of \
             percent",
            measured.total.channel
        );
        return Ok(Some((measured.clone(), sentence)));
    }
    Ok(Some((seen, sentence)))
}

/// `measured` with `factor` in place of `diffuse`.
fn with(
    measured: &Measured,
    model: &dyn ForwardModel,
    at: Coefficients,
    factor: &ExitFactor,
    diffuse: f64,
    blur: &Blur,
) -> Measured {
    let mut seen = measured.clone();
    let points = &mut seen.profile.points;
    // Beam and pixel carry light from radii where the factor is another, and the point at the
    // beam, into a ring.
    let footprints = Footprints::new(points, blur);
    let [mut exitance, mut radiance] = [vec![0.0; points.len()], vec![0.0; points.len()]];
    footprints.reflectance(model, at, &mut exitance);
    footprints.mean(
        |radii, out| radiance_at(model, at, factor, radii, out),
        &mut radiance,
    );
    for (p, (exitance, radiance)) in points.iter_mut().zip(exitance.into_iter().zip(radiance)) {
        let change = diffuse * exitance / (radiance + factor.at_beam * blur.density(p.radius_mm));
        p.reflectance_per_mm2 *= change;
        p.u_reflectance_per_mm2 *= change;
    }
    // The mean over the plane, less what leaves outside the circle, where the factor varies little.
    let circle = seen.total.radius_max_mm.unwrap_or(f64::INFINITY);
    let (all, outside) = (model.beyond(at, 0.0), model.beyond(at, circle));
    let inside = if outside > 0.0 {
        (factor.mean * all - factor.at(circle) * outside) / (all - outside)
    } else {
        factor.mean
    };
    // Summed over the radii it is the same but for what neither resolves at the beam.
    let doubt = summed(model, at, factor, circle) / inside - 1.0;
    let total = &mut seen.total;
    total.total_reflectance *= diffuse / inside;
    total.u_total_reflectance *= diffuse / inside;
    total.u_total_reflectance = total
        .u_total_reflectance
        .hypot(doubt * total.total_reflectance);
    seen
}

/// π·radiance at each of `radii`, the point at the beam left out.
fn radiance_at(
    model: &dyn ForwardModel,
    at: Coefficients,
    factor: &ExitFactor,
    radii: &[f64],
    out: &mut [f64],
) {
    model.diffuse_reflectance(at, radii, out);
    for (value, &radius) in out.iter_mut().zip(radii) {
        *value *= factor.at(radius);
    }
}

/// The factor of all light within `circle`, from that at every radius and the point at the beam.
fn summed(model: &dyn ForwardModel, at: Coefficients, factor: &ExitFactor, circle: f64) -> f64 {
    let per_length = at.sigma_t_prime();
    let (mut inner, mut within) = (0.0, 0.0);
    let mut sum = factor.at_beam;
    let mut outer = NEAREST / per_length;
    while inner < circle && inner * per_length < FARTHEST {
        let next = model.within(at, outer.min(circle)).value;
        sum += factor.at((inner.max(0.5 * outer) * outer).sqrt()) * (next - within);
        (inner, within, outer) = (outer, next, outer * STEP);
    }
    sum / within
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::ModelChoice;
    use fit::Constraint;
    use physics::footprint::Beam;
    use physics::{ProfilePoint, RadialProfile, TotalReflectance};
    use std::f64::consts::PI;
    use transport::TransportModel;

    /// Dark media under a camera at 25 degrees, seen as transport has them and read as diffusion
    /// has them: off by a tenth before, right after.
    #[test]
    fn what_a_camera_saw_of_a_dark_medium_becomes_its_exitance() {
        // The green of Jensen's ketchup is as black as media get, and its far light is all noise.
        for (sigma_a, sigma_s_prime, noise) in [(0.2, 0.8, (1e-3, 0.0)), (0.97, 0.07, (1e-4, 1e-9))]
        {
            let truth = Coefficients {
                sigma_a,
                sigma_s_prime,
            };
            assert_exitance(truth, noise);
        }
    }

    fn assert_exitance(truth: Coefficients, (relative, floor): (f64, f64)) {
        let (eta, g, angle) = (1.3, 0.8, 0.44_f64);
        let model = TransportModel::new(eta, g).unwrap();
        let factor = model.exit_factor(truth, angle.cos());
        let exit = Exit::Fresnel { eta, angle };
        let radii: Vec<f64> = (0..70).map(|i| 0.3 * 1.06_f64.powi(i)).collect();
        let mut exitance = vec![0.0; radii.len()];
        model.diffuse_reflectance(truth, &radii, &mut exitance);
        let points = radii.iter().zip(&exitance).map(|(&radius_mm, value)| {
            let value = value * factor.at(radius_mm) / exit.factor();
            ProfilePoint {
                ring_mm: None,
                radius_mm,
                reflectance_per_mm2: value,
                u_reflectance_per_mm2: (relative * value).hypot(floor),
                pixels: None,
            }
        });
        let channel = "G".to_owned();
        let measured = Measured {
            profile: RadialProfile {
                channel: channel.clone(),
                points: points.collect(),
            },
            total: TotalReflectance {
                channel,
                total_reflectance: model.beyond(truth, 0.0) * factor.mean / exit.factor(),
                u_total_reflectance: 1e-3 * model.beyond(truth, 0.0),
                radius_max_mm: None,
                u_scale_relative: 0.0,
                u_offset_per_mm2: 0.0,
            },
            center_px: [0.0; 2],
            rejected_pixels: 0,
            unmeasured_pixels: 0,
            unseen_share: 0.0,
            relative_scatter: 0.0,
        };
        let choice = ModelChoice {
            name: "monte-carlo".to_owned(),
            g: Some(g),
            ..ModelChoice::default()
        };
        let given = Given {
            constraint: Constraint::Joint,
            range_mm: Some((0.3, 16.0)),
            entry_loss: false,
            exit,
            ..Given::of(choice, eta)
        };
        let off = |measured: &Measured| {
            let points = measured.profile.points.iter().zip(&exitance);
            points.fold(0.0_f64, |most, (p, e)| {
                most.max((p.reflectance_per_mm2 / e - 1.0).abs())
            })
        };
        let (seen, sentence) = of_transport(&measured, &[], &given).unwrap().unwrap();
        let (before, after) = (off(&measured), off(&seen));
        println!("{before:.4} before, {after:.5} after: {sentence}");
        assert!(before > 0.02 && after < 2e-3, "{before}, {after}");
        assert!(sentence.contains("transport's own factor"));
        let lambert = Given {
            exit: Exit::Lambert,
            ..given
        };
        assert!(of_transport(&measured, &[], &lambert).unwrap().is_none());
    }

    /// Against a plain double sum about the beam: light that scattered once goes like 1/r, and a
    /// rule that samples it by chance was off by 0.3 % here, ten times the noise.
    #[test]
    fn a_ring_sees_what_beam_and_pixel_carry_into_it() {
        let at = Coefficients {
            sigma_a: 0.0002,
            sigma_s_prime: 7.38,
        };
        let model = TransportModel::new(1.3, 0.8).unwrap();
        let factor = model.exit_factor(at, 1.0);
        let blur = Blur {
            beam: Beam::Gaussian { fwhm_mm: 0.3 },
            pixel_mm: 0.04,
        };
        let variance = blur.standard_deviation_mm().powi(2);
        for radius_mm in [0.27_f64, 0.3, 0.4, 0.7, 2.0] {
            let point = ProfilePoint {
                ring_mm: None,
                radius_mm,
                reflectance_per_mm2: 1.0,
                u_reflectance_per_mm2: 0.1,
                pixels: None,
            };
            let rule = Footprints::new(&[point], &blur);
            let (mut exitance, mut radiance) = ([0.0], [0.0]);
            rule.reflectance(&model, at, &mut exitance);
            rule.mean(
                |radii, out| radiance_at(&model, at, &factor, radii, out),
                &mut radiance,
            );

            let step = (radius_mm + 0.9) / 4000.0;
            let radii: Vec<f64> = (0..4000).map(|i| (f64::from(i) + 0.5) * step).collect();
            let sum = |fill: &dyn Fn(&mut [f64])| {
                let mut values = vec![0.0; radii.len()];
                fill(&mut values);
                let circle = |s: f64| -> f64 {
                    let angles = (0..200).map(|j| PI * (f64::from(j) + 0.5) / 200.0);
                    let squares = angles
                        .map(|phi| s * s + radius_mm * radius_mm - 2.0 * s * radius_mm * phi.cos());
                    squares.map(|d2| (-0.5 * d2 / variance).exp()).sum()
                };
                let parts = radii.iter().zip(&values).map(|(&s, v)| v * s * circle(s));
                parts.sum::<f64>() * step / (200.0 * variance)
            };
            let expected = [
                sum(&|out| model.diffuse_reflectance(at, &radii, out)),
                sum(&|out| radiance_at(&model, at, &factor, &radii, out)),
            ];
            let off = [
                exitance[0] / expected[0] - 1.0,
                radiance[0] / expected[1] - 1.0,
            ];
            println!("{radius_mm}: {off:?}");
            // The factor has corners where its own table ends.
            assert!(
                off[0].abs() < 1e-4 && off[1].abs() < 6e-4,
                "{radius_mm}: {off:?}"
            );
        }
    }
}
