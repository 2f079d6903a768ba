//! What a camera sees, against photons tallied by radius and angle.

use montecarlo::{Incidence, LayeredMedium, Side, Simulation, TallySpec, ring_area};
use physics::{Coefficients, ForwardModel, Medium, fresnel};
use std::f64::consts::PI;
use transport::TransportModel;

/// Rings of 0.3 to 6 transport lengths, where 2·10⁶ photons leave half a percent of noise.
const EDGES: [f64; 6] = [0.0, 0.3, 0.7, 1.5, 3.0, 6.0];
const ANGLES: usize = 9;

#[test]
fn the_exit_factor_is_that_of_photons() {
    for (eta, g, sigma_a, bins) in [
        (1.5, 0.0, 0.002, &[1, 5][..]),
        (1.33, 0.8, 0.1, &[3]),
        (1.0, 0.5, 0.4, &[1, 5]),
    ] {
        let sigma_s_prime = 1.0 - sigma_a;
        let medium = LayeredMedium::half_space(&Medium {
            sigma_a,
            sigma_s: sigma_s_prime / (1.0 - g),
            g,
            eta,
        });
        let spec = TallySpec {
            radius_mm: EDGES.to_vec(),
            angle_bins: ANGLES,
            radius_and_angle: true,
            ..TallySpec::default()
        };
        let tally = Simulation::new(medium, Incidence::PENCIL, &spec, 7)
            .unwrap()
            .run_photons(2_000_000)
            .unwrap();
        let model = TransportModel::new(eta, g).unwrap();
        let at = Coefficients {
            sigma_a,
            sigma_s_prime,
        };
        let entry = fresnel::entry_factor(eta, 1.0);
        let by_both = tally.by_radius_and_angle(Side::Above).unwrap();
        let by_angle = tally.by_angle(Side::Above);
        for &bin in bins {
            let (low, high) = (by_angle.edges[bin], by_angle.edges[bin + 1]);
            // The projected solid angle, and the cosine that halves it.
            let (low2, high2) = (low.sin().powi(2), high.sin().powi(2));
            let projected = PI * (high2 - low2);
            let factor = model.exit_factor(at, (1.0 - 0.5 * (low2 + high2)).sqrt());
            let seen = by_angle.bins[bin];
            let mean = PI * seen.value / projected / tally.reflectance().value;
            let u = seen.u / seen.value;
            println!(
                "eta {eta} g {g} sigma_a {sigma_a} bin {bin}: mean {mean:.4} for {:.4} (diffuse {:.4}), u {u:.4}",
                factor.mean,
                fresnel::exit_factor(eta, (0.5 * (low + high)).cos()),
            );
            // Curvature over the bin's ten degrees is left.
            assert!(
                (mean / factor.mean - 1.0).abs() < 3.5 * u + 2e-3,
                "eta {eta} g {g}: {mean} for {}",
                factor.mean
            );
            for (ring, edges) in EDGES.windows(2).enumerate().skip(1) {
                let cell = by_both.cells[ring * (ANGLES + 1) + bin];
                let expected = mean_over(edges[0], edges[1], |r| {
                    let mut out = [0.0];
                    model.diffuse_reflectance(at, &[r], &mut out);
                    entry * out[0] * factor.at(r) * projected / PI
                }) * ring_area(edges[0], edges[1]);
                let deviation = cell.value / expected - 1.0;
                let u = cell.u / cell.value;
                println!(
                    "  ring {edges:?}: {deviation:+.4} ± {u:.4}, factor {:.4}",
                    factor.at(edges[1])
                );
                assert!(
                    deviation.abs() < 3.5 * u + 5e-3,
                    "eta {eta} g {g} bin {bin} ring {edges:?}: {} for {expected}",
                    cell.value
                );
            }
        }
    }
}

/// Mean over a ring, weighted with the radius.
fn mean_over(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let steps = 60;
    let ratio = (high / low).powf(1.0 / f64::from(steps));
    let (mut sum, mut weight) = (0.0, 0.0);
    for i in 0..steps {
        let r = low * ratio.powf(f64::from(i) + 0.5);
        sum += r * r * f(r);
        weight += r * r;
    }
    sum / weight
}

/// The factor by radius, the point at the beam included, adds up to the mean over the plane.
#[test]
fn radii_add_up_to_the_mean() {
    for (eta, g, sigma_a, cos_view) in [
        (1.3, 0.8, 0.33, 1.0),
        (1.3, 0.8, 0.33, 0.9),
        (1.5, 0.0, 0.01, 1.0),
    ] {
        let model = TransportModel::new(eta, g).unwrap();
        let at = Coefficients {
            sigma_a,
            sigma_s_prime: 1.0 - sigma_a,
        };
        let factor = model.exit_factor(at, cos_view);
        let edges: Vec<f64> = (0..=400).map(|i| 1e-4 * 1.04_f64.powi(i)).collect();
        let within: Vec<f64> = edges.iter().map(|&r| model.within(at, r).value).collect();
        let mut sum = factor.at_beam + factor.at(edges[0]) * within[0];
        for (edges, within) in edges.windows(2).zip(within.windows(2)) {
            sum += factor.at((edges[0] * edges[1]).sqrt()) * (within[1] - within[0]);
        }
        let mean = sum / model.within(at, f64::INFINITY).value;
        println!(
            "eta {eta} g {g} sigma_a {sigma_a} cos {cos_view}: {mean:.4} for {:.4}, at the beam {:.4}",
            factor.mean, factor.at_beam
        );
        assert!(
            (mean / factor.mean - 1.0).abs() < 6e-3,
            "{mean} for {}",
            factor.mean
        );
    }
}
