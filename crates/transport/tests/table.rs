//! The table against the solver that filled it, its gradients, its consistency, its refusals.

use physics::{Coefficients, ForwardModel, Gradient};
use transport::{Interior, OutOfTable, Surface, TransportFamily, TransportModel};

/// Numbers in [0, 1) that are the same on every run.
fn random() -> impl FnMut() -> f64 {
    let mut state = 20_260_u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Half of the media are bright.
fn medium(i: usize, mut draw: impl FnMut() -> f64) -> (f64, f64, f64) {
    let (eta, g) = (1.0 + 0.6 * draw(), -0.3 + 1.25 * draw());
    let dark = if i.is_multiple_of(2) {
        0.98 * draw()
    } else {
        10.0_f64.powf(-4.0 * draw())
    };
    (eta, g, dark.min(0.97))
}

#[test]
fn interpolation_is_exact_between_the_nodes() {
    let mut draw = random();
    for i in 0..10 {
        let (eta, g, sigma_a) = medium(i, &mut draw);
        let at = Coefficients {
            sigma_a,
            sigma_s_prime: 1.0 - sigma_a,
        };
        let solution = Surface::new(eta).solve(&Interior::new(sigma_a, g));
        let model = TransportModel::new(eta, g).unwrap();
        let label = format!("eta {eta:.3}, g {g:.3}, 1 - a' {sigma_a:.4}");
        let total = model.within(at, f64::INFINITY).value / solution.total() - 1.0;
        // The radii that hold all but 0.1 % of the light, and those where the table is continued.
        let radii: Vec<f64> = (-28..80)
            .map(|i| (-5.29 + 0.137 * f64::from(i)).exp())
            .take_while(|&r| r < solution.farthest_radius())
            .take_while(|&r| solution.beyond(r) > 1e-3 * solution.total())
            .collect();
        let mut worst = [[0.0_f64; 3]; 2];
        for (&r, exact) in radii.iter().zip(solution.profile(&radii)) {
            let mut value = [0.0];
            model.diffuse_reflectance(at, &[r], &mut value);
            let u = model.relative_error(at, r);
            let deviation = (value[0].ln() - exact.ln_reflectance).abs();
            assert!(deviation < 3.0 * u, "{label}, r {r}: {deviation} for u {u}");
            let worst = &mut worst[usize::from(r > 1.0)];
            for (worst, (got, exact)) in worst.iter_mut().zip([
                (value[0], exact.ln_reflectance),
                (model.within(at, r).value, exact.ln_within),
                (model.beyond(at, r), exact.ln_beyond),
            ]) {
                *worst = worst.max((got.ln() - exact).abs());
            }
        }
        println!(
            "{label}: total {total:.1e}, near {:.5?}, far {:.5?}",
            worst[0], worst[1]
        );
        assert!(
            total.abs() < 1e-4 + 2e-3 * sigma_a * sigma_a,
            "{label}: total {total}"
        );
        let far = 3e-3 + 1e-2 * sigma_a * sigma_a;
        assert!(
            worst[1][1] < 1e-3 && worst[1][2] < far,
            "{label}: {worst:?}"
        );
    }
}

/// Central differences of fourth order.
fn slope(f: impl Fn(f64) -> f64, x: f64) -> f64 {
    let h = 2e-3 * x;
    (8.0 * (f(x + h) - f(x - h)) - (f(x + 2.0 * h) - f(x - 2.0 * h))) / (12.0 * h)
}

#[test]
fn gradients_are_slopes() {
    for (eta, g, sigma_a, sigma_s_prime) in [
        (1.5, 0.0, 0.0041, 2.62),
        (1.3, 0.8, 0.97, 0.07),
        (1.0, 0.9, 0.2, 0.8),
        (1.33, 0.6, 1e-3, 20.0),
    ] {
        let model = TransportModel::new(eta, g).unwrap();
        let reflectance = |sigma_a, sigma_s_prime, r| {
            let mut out = [Gradient::default()];
            let at = Coefficients {
                sigma_a,
                sigma_s_prime,
            };
            model.diffuse_reflectance_gradient(at, &[r], &mut out);
            out[0]
        };
        let within = |sigma_a, sigma_s_prime, r| {
            model.within(
                Coefficients {
                    sigma_a,
                    sigma_s_prime,
                },
                r,
            )
        };
        let check = |name: &str, r: f64, f: &dyn Fn(f64, f64, f64) -> Gradient| {
            let got = f(sigma_a, sigma_s_prime, r);
            let in_a = slope(|x| f(x, sigma_s_prime, r).value, sigma_a);
            let in_s = slope(|x| f(sigma_a, x, r).value, sigma_s_prime);
            let size = got.value / sigma_a.hypot(sigma_s_prime);
            for (got, expected) in [(got.in_sigma_a, in_a), (got.in_sigma_s_prime, in_s)] {
                // A spline's third derivative jumps at its knots, which differences feel.
                assert!(
                    (got - expected).abs() < 2e-5 * (expected.abs() + size),
                    "{name} at {r}, eta {eta}, g {g}, {sigma_a}, {sigma_s_prime}: {got} for {expected}"
                );
            }
        };
        for r in [1e-4, 0.013, 0.21, 1.1, 5.7, 40.0] {
            check("R_d", r, &reflectance);
            check("within", r, &within);
        }
        check("total", f64::INFINITY, &within);
    }
}

#[test]
fn a_family_has_the_models_at_every_g() {
    let family = TransportFamily::new(1.37).unwrap();
    let at = Coefficients {
        sigma_a: 0.05,
        sigma_s_prime: 1.3,
    };
    let radii = [0.01, 0.2, 3.0, 20.0];
    for g in [-0.3, 0.0, 0.61, 0.95] {
        let (mut one, mut other) = ([0.0; 4], [0.0; 4]);
        let alone = TransportModel::new(1.37, g).unwrap();
        let of_family = family.at(g).unwrap();
        alone.diffuse_reflectance(at, &radii, &mut one);
        of_family.diffuse_reflectance(at, &radii, &mut other);
        for (a, b) in one.iter().zip(other) {
            assert!((a / b - 1.0).abs() < 1e-10, "g {g}: {a} and {b}");
        }
    }
    assert!(family.at(0.96).is_err() && TransportFamily::new(1.7).is_err());
}

#[test]
fn parts_add_up() {
    for (eta, g, sigma_a) in [(1.5, 0.0, 0.002), (1.3, 0.85, 0.1), (1.0, 0.5, 0.6)] {
        let model = TransportModel::new(eta, g).unwrap();
        let at = Coefficients {
            sigma_a,
            sigma_s_prime: 1.0 - sigma_a,
        };
        let total = model.beyond(at, 0.0);
        for r in [0.002, 0.05, 0.7, 3.0, 20.0] {
            let sum = model.within(at, r).value + model.beyond(at, r);
            assert!(
                (sum / total - 1.0).abs() < 2e-3,
                "eta {eta}, g {g}, r {r}: {sum} of {total}"
            );
        }
    }
}

#[test]
fn no_absorption_is_a_limit() {
    let model = TransportModel::new(1.4, 0.8).unwrap();
    let at = |sigma_a| {
        let mut out = [Gradient::default(); 2];
        let c = Coefficients {
            sigma_a,
            sigma_s_prime: 1.0,
        };
        model.diffuse_reflectance_gradient(c, &[0.5, 5.0], &mut out);
        out
    };
    for (zero, near) in at(0.0).iter().zip(at(1e-9)) {
        assert!(
            (zero.value / near.value - 1.0).abs() < 1e-6,
            "{zero:?} {near:?}"
        );
        assert!(
            zero.in_sigma_a.is_finite() && zero.in_sigma_a < 0.0,
            "{zero:?}"
        );
    }
    let white = Coefficients {
        sigma_a: 0.0,
        sigma_s_prime: 1.0,
    };
    assert!((model.beyond(white, 0.0) - 1.0).abs() < 3e-3);
    assert_eq!(model.within(white, 0.0), Gradient::default());
}

#[test]
fn what_the_table_lacks_is_refused() {
    for (eta, g) in [(0.99, 0.0), (1.7, 0.0), (f64::NAN, 0.0)] {
        assert!(
            matches!(TransportModel::new(eta, g), Err(OutOfTable::Eta { .. })),
            "{eta}"
        );
    }
    for g in [-0.31, 0.96, 1.0, f64::NAN] {
        assert!(
            matches!(TransportModel::new(1.3, g), Err(OutOfTable::G { .. })),
            "{g}"
        );
    }
    for bytes in [&b""[..], b"BSTRANS2", b"another file"] {
        let answer = TransportModel::from_table(bytes, 1.3, 0.0);
        assert!(matches!(answer, Err(OutOfTable::Bytes(_))), "{answer:?}");
    }
}
