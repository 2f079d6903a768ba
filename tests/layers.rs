//! Three witnesses of layered media: first-order formulas, counted photons, adding and doubling.

use gauss_quad::GaussLegendre;
use montecarlo::{Direction, Incidence, Side, Simulation, Tally, TallySpec};
use physics::brdf::Directions;
use physics::{FirstOrder, Layer, LayeredMedium, Phase, Reflections};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::{FRAC_PI_2, PI};
use std::num::NonZeroUsize;

const ANGLES: usize = 9;
const AZIMUTHS: usize = 6;

/// Photons of every case; `BEAMSPOT_PHOTONS` sets another number.
fn photons(usual: u64) -> u64 {
    std::env::var("BEAMSPOT_PHOTONS").map_or(usual, |n| n.parse::<f64>().unwrap() as u64)
}

fn layer(albedo: f64, tau: f64, g: f64, eta: f64) -> Layer {
    Layer {
        sigma_a: 1.0 - albedo,
        sigma_s: albedo,
        phase: Phase::HenyeyGreenstein { g },
        eta,
        thickness_mm: tau.is_finite().then_some(tau),
    }
}

fn in_air(layers: Vec<Layer>) -> LayeredMedium {
    LayeredMedium {
        layers,
        eta_above: 1.0,
        eta_below: 1.0,
    }
}

fn simulate(
    medium: &LayeredMedium,
    angle: f64,
    spec: &TallySpec,
    seed: u64,
    photons: u64,
) -> Tally {
    let incidence = Incidence {
        direction: Direction::Collimated { angle },
        ..Incidence::PENCIL
    };
    Simulation::new(medium.clone(), incidence, spec, seed)
        .unwrap()
        .run_photons(photons)
        .unwrap()
}

/// ∫ f cos θ dω over a bin of the half-circle of azimuths, both halves counted.
fn share(rule: &GaussLegendre, bin: [f64; 4], f: impl Fn(&Directions) -> f64, cos_in: f64) -> f64 {
    let [low, high, from, to] = bin;
    rule.integrate(low, high, |angle: f64| {
        let ring = rule.integrate(from, to, |azimuth: f64| {
            f(&Directions {
                cos_in,
                cos_out: angle.cos(),
                cos_azimuth: azimuth.cos(),
            })
        });
        2.0 * angle.cos() * angle.sin() * ring
    })
}

/// One stack and one angle: χ² over directions, how many there are, and the totals in words.
fn once(
    label: &str,
    medium: &LayeredMedium,
    degrees: f64,
    seed: u64,
    photons: u64,
) -> (f64, usize, String) {
    let spec = TallySpec {
        angle_bins: ANGLES,
        azimuth_bins: AZIMUTHS,
        orders: 1,
        ..TallySpec::default()
    };
    let angle = degrees.to_radians();
    let tally = simulate(medium, angle, &spec, seed, photons);
    let model = FirstOrder::new(medium.clone(), Reflections::All).unwrap();
    let rule = GaussLegendre::new(NonZeroUsize::new(6).unwrap());
    let (mut chi2, mut cells, mut told) = (0.0, 0, String::new());
    for side in [Side::Above, Side::Below] {
        if side == Side::Below && medium.layers.last().unwrap().thickness_mm.is_none() {
            continue;
        }
        let counted = &tally.by_order_and_direction(side).unwrap()[1];
        let mut total = 0.0;
        for i in 0..ANGLES {
            for j in 0..AZIMUTHS {
                let bin = [
                    FRAC_PI_2 * i as f64 / ANGLES as f64,
                    FRAC_PI_2 * (i + 1) as f64 / ANGLES as f64,
                    PI * j as f64 / AZIMUTHS as f64,
                    PI * (j + 1) as f64 / AZIMUTHS as f64,
                ];
                let f = |d: &Directions| match side {
                    Side::Above => model.brdf(d),
                    Side::Below => model.btdf(d),
                };
                let expected = share(&rule, bin, f, angle.cos());
                total += expected;
                let got = counted.cells[i * (AZIMUTHS + 1) + j];
                if got.u < 0.1 * got.value {
                    chi2 += ((got.value - expected) / got.u).powi(2);
                    cells += 1;
                }
            }
        }
        let order = tally.by_order(side).bins[1];
        let off = order.value / total - 1.0;
        told += &format!("{label}, {degrees} deg, {side:?}: {total:.6}, photons {off:+.2e}\n");
        // Half a percent, or what the number of photons allows.
        assert!(
            off.abs() < 5e-3 || (order.value - total).abs() < 4.0 * order.u,
            "{label}, {degrees} deg, {side:?}: {order:?} for {total}"
        );
    }
    (chi2, cells, told)
}

#[test]
fn photons_that_scatter_once_go_where_the_formulas_say() {
    let n = photons(100_000);
    let (mut chi2, mut cells, mut seed) = (0.0, 0, 0);
    for g in [-0.3, 0.0, 0.6] {
        for tau in [0.5, 1.0, 2.0] {
            for eta in [1.0, 1.5] {
                let one = in_air(vec![layer(0.8, tau, g, eta)]);
                let glass = if eta == 1.0 { 1.0 } else { 1.33 };
                let three = in_air(vec![
                    layer(0.5, 0.3 * tau, g, eta),
                    layer(0.9, 0.3 * tau, 0.5 * g, glass),
                    layer(0.8, 0.4 * tau, -g, eta),
                ]);
                for (count, medium) in [(1, one), (3, three)] {
                    for degrees in [10.0, 40.0, 65.0] {
                        seed += 1;
                        let label = format!("g {g}, tau {tau}, eta {eta}, {count} layers");
                        let (more, of, told) = once(&label, &medium, degrees, seed, n);
                        print!("{told}");
                        chi2 += more;
                        cells += of;
                    }
                }
            }
        }
    }
    let p = ChiSquared::new(cells as f64).unwrap().sf(chi2);
    println!("chi-squared {chi2:.1} over {cells} directions, p = {p:.4}");
    assert!(cells > 5000 && p > 1e-3, "{chi2} over {cells}: p = {p}");
}

/// FIELD: the paper's literal form beside what photons do, in four half-spaces.
#[test]
fn what_half_spaces_return_after_one_scattering() {
    let n = photons(400_000);
    let (mut chi2, mut cells) = (0.0, 0);
    for (name, albedo, g, eta) in [
        ("marble", 2.62 / 2.6241, 0.0, 1.5),
        ("skin1", 0.88 / 1.13, 0.0, 1.3),
        ("forward skin", 5.87 / 6.12, 0.85, 1.3),
        ("dark", 0.5, 0.3, 1.0),
    ] {
        let medium = in_air(vec![layer(albedo, f64::INFINITY, g, eta)]);
        for degrees in [0.0, 50.0] {
            let (more, of, told) = once(name, &medium, degrees, 7, n);
            print!("{told}");
            chi2 += more;
            cells += of;
        }
    }
    let p = ChiSquared::new(cells as f64).unwrap().sf(chi2);
    assert!(p > 1e-3, "{chi2} over {cells}: p = {p}");
}

/// Numbers in [0, 1) that are the same on every run.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[test]
fn fifty_random_stacks_reflect_and_transmit_as_counted() {
    let n = photons(30_000);
    let (mut chi2, mut values) = (0.0, 0);
    for seed in 0..50 {
        let mut draw = random(1000 + seed);
        let count = 1 + (4.0 * draw()) as usize;
        let layers = (0..count)
            .map(|k| Layer {
                sigma_a: 0.3 * draw().powi(3),
                // One layer in eight is clear.
                sigma_s: if draw() < 0.125 { 0.0 } else { 4.0 * draw() },
                phase: Phase::HenyeyGreenstein {
                    g: -0.5 + 1.45 * draw(),
                },
                eta: 1.0 + 0.6 * draw(),
                thickness_mm: Some(0.02 + 1.5 * draw() / (1 + k) as f64),
            })
            .collect();
        let medium = LayeredMedium {
            layers,
            eta_above: if draw() < 0.5 {
                1.0
            } else {
                1.0 + 0.4 * draw()
            },
            eta_below: 1.0 + 0.5 * draw(),
        };
        let angle = 1.4 * draw();
        if medium.layers.iter().all(|l| l.sigma_s == 0.0) {
            continue;
        }
        let solved = layers::solve(&medium, &[angle.cos()], &[]).unwrap();
        let tally = simulate(&medium, angle, &TallySpec::default(), seed, n);
        let (back, through) = (tally.reflectance(), tally.transmittance());
        let (unscattered, _) = physics::first_order::unscattered(&medium, angle.cos());
        for (what, got, u, expected) in [
            ("R", back.value, back.u, solved.reflectance[0] - unscattered),
            ("T", through.value, through.u, solved.transmittance[0]),
        ] {
            // Single precision in the lanes, and what adding-doubling leaves.
            let u = u.hypot(3e-6);
            if u < 0.1 * expected {
                let z = (got - expected) / u;
                assert!(
                    z.abs() < 4.5,
                    "{seed} {what}: {got} ± {u} for {expected}, {medium:?}"
                );
                chi2 += z * z;
                values += 1;
            }
        }
    }
    let p = ChiSquared::new(f64::from(values)).unwrap().sf(chi2);
    println!("chi-squared {chi2:.1} over {values}, p = {p:.3}");
    assert!(values > 80 && p > 1e-3, "{chi2} over {values}: p = {p}");
}

#[test]
fn the_colour_of_renderers_is_the_albedo_without_a_surface() {
    let mut worst: f64 = 0.0;
    for albedo in [0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999] {
        let solved = layers::solve(
            &in_air(vec![layer(albedo, f64::INFINITY, 0.0, 1.0)]),
            &[],
            &[],
        );
        let exact = solved.unwrap().diffuse_reflectance;
        worst = worst.max((tables::albedo_without_surface(albedo) - exact).abs());
    }
    println!("worst difference {worst:.5}");
    assert!(worst < 2.1e-3, "{worst}");
}
