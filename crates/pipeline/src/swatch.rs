//! A small picture of the measured material for the report: a cube that a beam falls on.

use crate::fitting::Given;
use crate::rendering::{self, BssrdfModel};
use fit::Fit;
use formats::encode_png;
use physics::{Medium, ReducedMedium};
use render::bssrdf::Sampling;
use render::camera::Lens;
use render::{
    Block, Camera, Lamp, Light, Material, Method, Object, Scene, Shaded, Shape, Spot, Vec3, View,
};
use report::Swatch;
use std::ops::ControlFlow;

/// Side of the cube, mm.
const SIDE_MM: f64 = 20.0;
/// Full width of the beam at half of its maximum, mm.
const FWHM_MM: f64 = 1.0;
/// Pixels of a side.
const PIXELS: usize = 128;
/// Rounds of rendering; what noise they leave nobody sees at this size.
const ROUNDS: u64 = 12;
/// Exposure over that which just keeps the spot: the glow is what one wants to see.
const LONGER: f64 = 4.0;
/// Any would do; the same every time, so that the same fit has the same bytes.
const SEED: u64 = 8;
/// A medium without absorption is none that the surface models know: so much of σₛ′ is absorbed at
/// least.
const LEAST_ABSORPTION: f64 = 1e-6;

/// The cube in the colours of the fits, or why there is none.
///
/// Red, green and blue become colours; of other channels the first is shown in gray.
pub(crate) fn swatch(fits: &[Fit], given: &[Given]) -> Result<Swatch, String> {
    let names: Vec<&str> = fits.iter().map(|fit| fit.channel.as_str()).collect();
    let coloured = names == ["R", "G", "B"];
    let shown = if coloured { 3 } else { 1 };
    let media: Vec<Medium> = (fits.iter().zip(given).take(shown))
        .map(|(fit, given)| medium(fit, given))
        .collect();
    let name = names.first().ok_or("nothing was fitted")?;
    let colours = if coloured {
        "by white light".to_owned()
    } else {
        format!("in channel {name}")
    };
    let scene = scene(&names[..shown], media)?;
    let shader = rendering::bssrdf(&scene, BssrdfModel::Corrected, Sampling::Axes)
        .map_err(|e| e.to_string())?;
    let method = Shaded::new(&scene, shader, SEED, false);
    let mut picture = method.empty();
    method.run(0..ROUNDS, &mut picture, &mut |_| ControlFlow::Continue(()));
    let (_, exposure) = rendering::developed(&scene, shown, &picture, None);
    let (frame, _) = rendering::developed(&scene, shown, &picture, Some(LONGER * exposure));
    let mut png = vec![];
    encode_png(&frame, &mut png).map_err(|e| e.to_string())?;
    Ok(Swatch {
        png,
        size: [PIXELS; 2],
        caption: format!(
            "A cube of {SIDE_MM} mm of the material, lit {colours} in a beam of {FWHM_MM} mm and \
             exposed for its glow, so that the spot burns out (a rendering by the dipole)"
        ),
    })
}

fn medium(fit: &Fit, given: &Given) -> Medium {
    let c = fit.coefficients();
    let reduced = ReducedMedium {
        sigma_a: c.sigma_a.max(LEAST_ABSORPTION * c.sigma_s_prime),
        sigma_s_prime: c.sigma_s_prime,
        eta: given.eta,
    };
    reduced.with_g(given.model.g.unwrap_or(0.0))
}

/// A cube seen over one of its edges, with a beam onto its upper face, near the front.
fn scene(channels: &[&str], media: Vec<Medium>) -> Result<Scene, String> {
    let half = 0.5 * SIDE_MM;
    let view = View {
        from: half * Vec3::new(3.4, -7.0, 4.6),
        to: half * Vec3::new(0.0, 0.0, -0.12),
        up: Vec3::Z,
        width: PIXELS,
        height: PIXELS,
    };
    let lens = Lens::Pinhole {
        field: 22.0_f64.to_radians(),
    };
    let scene = Scene {
        channels: channels.iter().map(|&name| name.to_owned()).collect(),
        objects: vec![Object {
            name: "cube".to_owned(),
            shape: Shape::Block(Block {
                min: Vec3::splat(-half),
                max: Vec3::splat(half),
            }),
            material: Material {
                media,
                texture: None,
            },
        }],
        lamps: vec![Lamp {
            light: Light::Beam {
                from: half * Vec3::new(0.35, -0.55, 4.0),
                direction: -Vec3::Z,
                spot: Spot::gaussian(FWHM_MM),
            },
            strength: vec![1.0; channels.len()],
        }],
        camera: Camera::new(view, lens)?,
    };
    let scene = scene.validated().map_err(|e| e.to_string())?;
    scene.check_for_surfaces().map_err(|e| e.to_string())?;
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::ModelChoice;
    use fit::{Estimate, Termination};

    fn fit(channel: &str, sigma_a: f64, sigma_s_prime: f64) -> Fit {
        let estimate = |value: f64| Estimate {
            value,
            u: 0.01 * value,
            ci95: (value, value),
            degrees_of_freedom: f64::INFINITY,
        };
        Fit {
            channel: channel.to_owned(),
            sigma_a: estimate(sigma_a),
            sigma_s_prime: estimate(sigma_s_prime),
            correlation: 0.0,
            budget: vec![],
            upper_limit: None,
            total: None,
            scale: 1.0,
            range_mm: (1.0, 10.0),
            share_outside: 0.0,
            reduced_chi2: 1.0,
            evaluations: 1,
            termination: Termination::Converged,
            warnings: vec![],
            residuals: vec![],
            nuisances: vec![],
        }
    }

    fn shown(fits: &[Fit]) -> Result<Swatch, String> {
        let given = Given::of(ModelChoice::default(), 1.4);
        swatch(fits, &vec![given; fits.len()])
    }

    fn decoded(swatch: &Swatch) -> Vec<f32> {
        let frame = formats::decode_frame(&swatch.png).unwrap().frame;
        assert_eq!((frame.width, frame.height), (PIXELS, PIXELS));
        frame.samples.to_f32()
    }

    /// A medium that absorbs blue and little red glows red, and the corners of the picture, where
    /// nothing is, are black; the same in gives the same out.
    #[test]
    fn a_red_medium_glows_red() {
        let fits = [fit("R", 0.005, 1.0), fit("G", 0.1, 1.0), fit("B", 0.4, 1.0)];
        let found = shown(&fits).unwrap();
        let samples = decoded(&found);
        let sum = |channel: usize| samples.iter().skip(channel).step_by(3).sum::<f32>();
        assert!(sum(0) > 1.5 * sum(1) && sum(1) > 1.2 * sum(2));
        assert_eq!(samples[..3], [0.0; 3]);
        assert_eq!(shown(&fits).unwrap(), found);
    }

    /// One channel is gray; clear, white and black media are shown or explained, and none panics.
    #[test]
    fn every_medium_is_shown_or_explained() {
        for (sigma_a, sigma_s_prime) in [
            (0.0, 5.0),
            (0.0, 0.0),
            (10.0, 0.01),
            (1e-9, 1e-6),
            (1e6, 1e6),
            (f64::NAN, 1.0),
        ] {
            match shown(&[fit("Y", sigma_a, sigma_s_prime)]) {
                Ok(found) => {
                    assert_eq!(decoded(&found).len(), PIXELS * PIXELS);
                    assert!(found.caption.contains("channel Y"));
                }
                Err(reason) => assert!(!reason.is_empty()),
            }
        }
        assert!(shown(&[]).is_err());
    }
}
