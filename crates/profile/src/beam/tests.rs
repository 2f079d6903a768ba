//! Spots that are known, blurred by the quadrature of `physics`, which shares nothing with the
//! design matrix.

use super::*;
use physics::footprint::Beam;
use physics::profile::mean_radius;
use physics::{Blur, DiffuseFresnel, DipoleModel, Footprints, Gradient};

const SPECTRALON: Coefficients = Coefficients {
    sigma_a: 0.0,
    sigma_s_prime: 11.6,
};
const MARBLE: Coefficients = Coefficients {
    sigma_a: 0.0041,
    sigma_s_prime: 2.62,
};

/// Rings as a camera of 0.04 mm per pixel has them.
fn points() -> Vec<ProfilePoint> {
    let mut edges = vec![0.0];
    while edges[edges.len() - 1] < 20.0 {
        let last = edges[edges.len() - 1];
        edges.push(last + 0.06_f64.max(0.025 * last));
    }
    edges
        .windows(2)
        .map(|e| ProfilePoint {
            ring_mm: Some((e[0], e[1])),
            radius_mm: mean_radius(e[0], e[1]),
            reflectance_per_mm2: 0.0,
            u_reflectance_per_mm2: 0.0,
            pixels: None,
        })
        .collect()
}

fn model(eta: f64) -> DipoleModel {
    DipoleModel::new(eta, DiffuseFresnel::Exact)
}

/// The picture of `at` under `blur`, with a noise that is a share of each value.
fn picture(eta: f64, at: Coefficients, blur: &Blur, noise: f64) -> RadialProfile {
    let mut points = points();
    let mut values = vec![0.0; points.len()];
    Footprints::new(&points, blur).reflectance(&model(eta), at, &mut values);
    for (index, (point, value)) in points.iter_mut().zip(values).enumerate() {
        point.reflectance_per_mm2 = value * (1.0 + noise * sign(77, index));
        point.u_reflectance_per_mm2 = value * noise.max(1e-4);
    }
    RadialProfile {
        channel: "Y".to_owned(),
        points,
    }
}

fn blur(beam: Beam) -> Blur {
    Blur {
        beam,
        pixel_mm: 0.04,
    }
}

#[test]
fn a_beam_comes_back_from_a_white_that_glows() {
    let white_model = model(1.3);
    let glow = Glow {
        model: &white_model,
        at: SPECTRALON,
    };
    for (beam, width, tolerance) in [
        (Beam::Gaussian { fwhm_mm: 0.3 }, 0.3_f64, 0.01),
        (Beam::Gaussian { fwhm_mm: 1.0 }, 1.0, 3e-3),
        (Beam::Disk { fwhm_mm: 1.0 }, 1.0, 0.0),
    ] {
        let truth = blur(beam.clone());
        let found = measure_beam(&picture(1.3, SPECTRALON, &truth, 1e-3), Some(glow)).unwrap();
        let spread = Beam::Measured(found.spread.clone());
        let deviation = blur(spread.clone()).standard_deviation_mm();
        println!(
            "{beam:?}: fwhm {:.4} u {:.4}, sd {deviation:.5} for {:.5}, misfit {:.1e}",
            found.spread.fwhm_mm(),
            found.u_fwhm_mm,
            truth.standard_deviation_mm(),
            found.misfit
        );
        if tolerance > 0.0 {
            // A pixel's square widens a Gaussian by its second moment.
            let seen = (width * width + 8.0 * LN_2 * 0.04 * 0.04 / 12.0).sqrt();
            assert!(
                (found.spread.fwhm_mm() / seen - 1.0).abs() < tolerance,
                "{beam:?}: {}",
                found.spread.fwhm_mm()
            );
        }
        assert!(
            (deviation / truth.standard_deviation_mm() - 1.0).abs() < 0.01,
            "{beam:?}: {deviation}"
        );
        // What counts: the picture of a sample by the measured spread, against the true one.
        let by = |blur: &Blur| picture(1.5, MARBLE, blur, 0.0).points;
        for (a, b) in by(&blur(spread)).iter().zip(by(&truth)) {
            let off = a.reflectance_per_mm2 / b.reflectance_per_mm2 - 1.0;
            // The two innermost rings hang on the heart of the spot alone.
            let limit = if a.radius_mm < 0.1 { 0.01 } else { 2e-3 };
            assert!(off.abs() < limit, "{beam:?}, {} mm: {off}", a.radius_mm);
        }
    }
}

#[test]
fn an_ideal_surface_shows_the_spread_itself() {
    let (fwhm_mm, noise) = (0.8, 1e-3);
    let beyond = |r: f64| (-4.0 * LN_2 * (r / fwhm_mm).powi(2)).exp();
    let mut white = RadialProfile {
        channel: "Y".to_owned(),
        points: points(),
    };
    for (index, p) in white.points.iter_mut().enumerate() {
        let (inner, outer) = p.ring_mm.unwrap();
        let mean = (beyond(inner) - beyond(outer)) / p.area_mm2();
        p.reflectance_per_mm2 = mean * (1.0 + noise * sign(78, index));
        p.u_reflectance_per_mm2 = (mean * noise).max(1e-9);
    }
    let found = measure_beam(&white, None).unwrap();
    let fwhm = found.spread.fwhm_mm();
    assert!((fwhm / fwhm_mm - 1.0).abs() < 3e-3, "{fwhm}");
    let truth = blur(Beam::Gaussian { fwhm_mm });
    // Spectralon taken for one is wider than the beam, and says nothing of it.
    let wide = measure_beam(&picture(1.3, SPECTRALON, &truth, 1e-3), None).unwrap();
    assert!(
        wide.spread.fwhm_mm() > 1.02 * 0.8,
        "{}",
        wide.spread.fwhm_mm()
    );
}

#[test]
fn a_wrong_glow_moves_the_width_the_right_way() {
    let white_model = model(1.3);
    let truth = blur(Beam::Gaussian { fwhm_mm: 1.0 });
    let white = picture(1.3, SPECTRALON, &truth, 1e-3);
    // A white that scatters less glows wider, and leaves less to the beam.
    let widths = [9.0, 11.6, 15.0, 1e4].map(|sigma_s_prime| {
        let glow = Glow {
            model: &white_model,
            at: Coefficients {
                sigma_a: 0.0,
                sigma_s_prime,
            },
        };
        let glow = (sigma_s_prime < 1e3).then_some(glow);
        measure_beam(&white, glow).unwrap().spread.fwhm_mm()
    });
    println!("{widths:?}");
    assert!(
        widths.is_sorted() && (widths[1] - 1.0).abs() < 4e-3,
        "{widths:?}"
    );
    assert!(widths[2] < 1.1 && widths[3] < 1.4, "{widths:?}");
}

#[test]
fn more_noise_makes_a_beam_less_certain() {
    let white_model = model(1.3);
    let glow = Glow {
        model: &white_model,
        at: SPECTRALON,
    };
    let truth = blur(Beam::Gaussian { fwhm_mm: 0.5 });
    let u = |noise| {
        let found = measure_beam(&picture(1.3, SPECTRALON, &truth, noise), Some(glow)).unwrap();
        let off = found.spread.fwhm_mm() / 0.5 - 1.0;
        assert!(
            off.abs() < 0.005 + 4.0 * found.u_fwhm_mm / 0.5,
            "{noise}: {off}"
        );
        found.u_fwhm_mm
    };
    let (little, much) = (u(1e-3), u(2e-2));
    assert!(much > 3.0 * little, "{little} {much}");
}

#[test]
fn a_picture_without_a_spot_shows_no_beam() {
    let truth = blur(Beam::Gaussian { fwhm_mm: 0.5 });
    let mut white = picture(1.3, SPECTRALON, &truth, 0.0);
    for point in &mut white.points {
        point.reflectance_per_mm2 = 1.0;
    }
    assert_eq!(measure_beam(&white, None), Err(ProfileError::NoBeam));
    white.points.clear();
    assert_eq!(measure_beam(&white, None), Err(ProfileError::NoBeam));
}

/// Light that leaves ∝ e^(−s)/s: as steep toward the beam as what scattered once.
struct Steep;

impl ForwardModel for Steep {
    fn name(&self) -> &'static str {
        "steep"
    }

    fn eta(&self) -> f64 {
        1.0
    }

    fn diffuse_reflectance_gradient(&self, _: Coefficients, radius: &[f64], out: &mut [Gradient]) {
        for (out, s) in out.iter_mut().zip(radius) {
            out.value = (-s).exp() / (TAU * s);
        }
    }

    fn within(&self, at: Coefficients, radius: f64) -> Gradient {
        Gradient {
            value: 1.0 - self.beyond(at, radius),
            ..Gradient::default()
        }
    }

    fn beyond(&self, _: Coefficients, radius: f64) -> f64 {
        (-radius).exp()
    }
}

/// About the beam the parts together see what leaves within the last; from elsewhere a plain sum
/// over directions from the ring, along which the light that is met falls like e^(−s).
#[test]
fn a_glow_with_a_pole_is_counted_whole() {
    let edges: Vec<f64> = (0..=40).map(|k| 0.05 * f64::from(k)).collect();
    let at = Coefficients {
        sigma_a: 0.0,
        sigma_s_prime: 1.0,
    };
    let point = |inner: f64, outer: f64| ProfilePoint {
        ring_mm: Some((inner, outer)),
        ..points()[0]
    };
    let rings = Rings {
        points: vec![point(0.0, 1e-3), point(0.9999, 1.0001)],
        noise: vec![],
        u: vec![],
        half_mm: 0.1,
        reach_mm: 2.0,
        nodes_mm: vec![],
    };
    let means = glowing(&rings, &edges, Glow { model: &Steep, at });
    let all = |means: &[f64]| -> f64 {
        let parts = means.iter().zip(edges.windows(2));
        parts
            .map(|(m, e)| m * PI * (e[1] - e[0]) * (e[1] + e[0]))
            .sum()
    };
    let middle = 1.0 - (-2.0_f64).exp();
    assert!((all(&means[0]) - middle).abs() < 1e-5, "{}", all(&means[0]));
    // From r = 1 the way to the circle of radius 2 in the direction φ is known.
    let steps = 1000;
    let expected: f64 = (0..steps)
        .map(|i| TAU * (f64::from(i) + 0.5) / f64::from(steps))
        .map(|phi| (4.0 - phi.sin().powi(2)).sqrt() - phi.cos())
        .map(|way| 1.0 - (-way).exp())
        .sum::<f64>()
        / f64::from(steps);
    assert!(
        (all(&means[1]) - expected).abs() < 1e-5,
        "{} for {expected}",
        all(&means[1])
    );
}
