//! Against `fixtures/monte-carlo/adding-doubling.csv`.

use gauss_quad::GaussLegendre;
use layers::{CannotSolve, solve};
use physics::layered::InvalidLayers;
use physics::{Layer, LayeredMedium, Phase};
use std::num::NonZeroUsize;

#[test]
fn every_row_of_the_table() {
    let table = include_str!("../../../fixtures/monte-carlo/adding-doubling.csv");
    for line in table.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |k: usize| fields[k].parse::<f64>().unwrap();
        let list = |k: usize| fields[k].split(';').map(|n| n.parse::<f64>().unwrap());
        let layers = list(1)
            .zip(list(2))
            .zip(list(3))
            .map(|((albedo, tau), g)| Layer {
                sigma_a: 1.0 - albedo,
                sigma_s: albedo,
                phase: Phase::HenyeyGreenstein { g },
                eta: number(4),
                thickness_mm: (tau < 1e5).then_some(tau),
            })
            .collect();
        let medium = LayeredMedium {
            layers,
            eta_above: 1.0,
            eta_below: 1.0,
        };
        let got = solve(&medium, &[number(7)], &[]).unwrap();
        let [r, t] = [
            got.reflectance[0] - number(8),
            got.transmittance[0] - number(9),
        ];
        println!("{:24} R {r:+.1e} T {t:+.1e}", fields[0]);
        assert!(r.abs() < 2e-5 && t.abs() < 2e-5, "{line}: {got:?}");
    }
}

fn half_space(albedo: f64, eta: f64, phase: Phase) -> LayeredMedium {
    LayeredMedium {
        layers: vec![Layer {
            sigma_a: 1.0 - albedo,
            sigma_s: albedo,
            phase,
            eta,
            thickness_mm: None,
        }],
        eta_above: 1.0,
        eta_below: 1.0,
    }
}

/// Chandrasekhar (1950), chapter V: 1/H = √(1 − α) + α/2 ∫ μ′H(μ′)/(μ + μ′) dμ′, by iteration; the
/// half-space reflects 1 − √(1 − α) H(μ₀), and its BRDF is α/(4π) H(μ)H(μ₀)/(μ + μ₀).
#[test]
fn the_matched_isotropic_half_space_is_chandrasekhars() {
    let rule = GaussLegendre::new(NonZeroUsize::new(100).unwrap());
    // Denser toward μ = 0, where H is steep.
    let nodes: Vec<(f64, f64)> = rule
        .iter()
        .map(|&(x, w)| (0.5 * (1.0 + x), 0.5 * w))
        .map(|(t, w)| (t * t, 2.0 * t * w))
        .collect();
    for albedo in [0.3, 0.9, 0.99, 0.9999] {
        let mut values = vec![1.0; nodes.len()];
        let at = |mu: f64, values: &[f64]| {
            let terms = nodes.iter().zip(values);
            let sum: f64 = terms.map(|(&(x, w), h)| w * x * h / (mu + x)).sum();
            1.0 / (f64::sqrt(1.0 - albedo) + 0.5 * albedo * sum)
        };
        for _ in 0..3000 {
            values = nodes
                .iter()
                .zip(&values)
                .map(|(&(mu, _), old)| 0.5 * (old + at(mu, &values)))
                .collect();
        }
        let (cos_in, cos_out) = ([1.0, 0.5, 0.1], [0.9, 0.3]);
        let medium = half_space(albedo, 1.0, Phase::ISOTROPIC);
        let got = solve(&medium, &cos_in, &cos_out).unwrap();
        for (i, mu) in cos_in.into_iter().enumerate() {
            let total = 1.0 - f64::sqrt(1.0 - albedo) * at(mu, &values);
            let off = got.reflectance[i] - total;
            assert!(off.abs() < 2e-5, "albedo {albedo}, cos {mu}: {off:e}");
            for (j, out) in cos_out.into_iter().enumerate() {
                let brdf =
                    albedo / (4.0 * std::f64::consts::PI) * at(mu, &values) * at(out, &values)
                        / (mu + out);
                let off = got.brdf[i][j] / brdf - 1.0;
                assert!(off.abs() < 3e-4, "albedo {albedo}, {mu} to {out}: {off:e}");
            }
        }
    }
}

/// README of the references: totals under normal and under hemispherical light.
#[test]
fn totals_under_diffuse_light() {
    for (sigma_a, sigma_s_prime, g, eta, normal, hemispherical) in [
        (0.0041, 2.62, 0.0, 1.5, 0.8076, 0.8228),
        (0.0024, 3.21, 0.0, 1.3, 0.8897, 0.9004),
        (0.17, 0.88, 0.0, 1.3, 0.2267, 0.2743),
        (0.17, 0.88, 0.85, 1.3, 0.2071, 0.2610),
        (0.5, 0.5, 0.0, 1.5, 0.0843, 0.1360),
    ] {
        let medium = LayeredMedium {
            layers: vec![Layer {
                sigma_a,
                sigma_s: sigma_s_prime / (1.0 - g),
                phase: Phase::HenyeyGreenstein { g },
                eta,
                thickness_mm: None,
            }],
            eta_above: 1.0,
            eta_below: 1.0,
        };
        let got = solve(&medium, &[1.0], &[]).unwrap();
        let off = [
            got.reflectance[0] - normal,
            got.diffuse_reflectance - hemispherical,
        ];
        println!("{sigma_a} {sigma_s_prime} g {g}: {off:?}");
        // The reference has four digits, counted from photons.
        assert!(off.iter().all(|o| o.abs() < 5e-4), "{sigma_a}: {off:?}");
    }
}

#[test]
fn nothing_is_ever_nan() {
    let layer = |albedo: f64, tau: Option<f64>, eta: f64| Layer {
        sigma_a: 1.0 - albedo,
        sigma_s: albedo,
        phase: Phase::HenyeyGreenstein { g: 0.9 },
        eta,
        thickness_mm: tau,
    };
    let critical = f64::sqrt(1.0 - 1.0 / 2.25);
    let views = [1e-6, critical, 0.5, 1.0];
    let thirty = (0..30)
        .map(|k| layer(0.9, Some(0.1), 1.3 + 0.1 * f64::from(k % 3)))
        .collect();
    for layers in [
        vec![layer(1.0, None, 1.5)],
        vec![layer(0.0, None, 1.5)],
        vec![layer(1.0, Some(1e-9), 1.5)],
        vec![layer(1.0, Some(1e6), 1.5)],
        vec![layer(0.0, Some(1e6), 1.5)],
        vec![layer(0.5, Some(1.0), 1.5), layer(0.0, Some(1.0), 1.0)],
        thirty,
    ] {
        for eta_above in [1.0, 1.5] {
            let medium = LayeredMedium {
                layers: layers.clone(),
                eta_above,
                eta_below: 1.2,
            };
            let got = solve(&medium, &views, &views).unwrap();
            for (i, _) in views.iter().enumerate() {
                let (r, t) = (got.reflectance[i], got.transmittance[i]);
                assert!(
                    r >= 0.0 && t >= 0.0 && r + t < 1.0 + 1e-5,
                    "{r} {t} {medium:?}"
                );
                let by_angle = got.brdf[i].iter().chain(&got.btdf[i]);
                assert!(by_angle.clone().all(|f| *f >= 0.0), "{got:?}");
            }
        }
    }
    let medium = half_space(0.5, 1.3, Phase::Rayleigh);
    for cos in [0.0, -0.1, 1.1, f64::NAN] {
        let answer = solve(&medium, &[cos], &[]);
        assert!(matches!(answer, Err(CannotSolve::Cosine(_))), "{answer:?}");
    }
    let none = LayeredMedium {
        layers: vec![],
        ..medium
    };
    let answer = solve(&none, &[1.0], &[]);
    assert_eq!(answer, Err(CannotSolve::Layers(InvalidLayers::NoLayer)));
}
