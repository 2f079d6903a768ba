//! The table against programs that share no line with it: MCML, beamspot's own random walk, and
//! adding-doubling.

use physics::{Blur, Coefficients, Footprints, ForwardModel, ProfilePoint, fresnel};
use transport::TransportModel;

const ADDING_DOUBLING: &str = include_str!("../../../fixtures/adding_doubling_half_spaces.csv");
const WALKS: &str = include_str!("../../../fixtures/transport_monte_carlo.csv");

fn numbers(line: &str) -> Vec<f64> {
    line.split(',')
        .map(|cell| cell.parse().unwrap_or(f64::NAN))
        .collect()
}

/// A ring of a simulation, per incident power.
struct Ring {
    edges: (f64, f64),
    value: f64,
    u: f64,
}

/// Deviations of the model from rings, relative, with the simulation's standard errors.
struct Comparison {
    /// Mean radius in 1/σₜ′, relative deviation, relative u of the simulation, that of the model.
    rings: Vec<[f64; 4]>,
}

impl Comparison {
    fn new(model: &TransportModel, medium: Coefficients, rings: &[Ring]) -> Self {
        let points: Vec<ProfilePoint> = rings
            .iter()
            .map(|ring| ProfilePoint {
                ring_mm: Some(ring.edges),
                radius_mm: 0.5 * (ring.edges.0 + ring.edges.1),
                reflectance_per_mm2: ring.value,
                u_reflectance_per_mm2: ring.u,
                pixels: None,
            })
            .collect();
        let mut means = vec![0.0; rings.len()];
        Footprints::new(&points, &Blur::NONE).reflectance(model, medium, &mut means);
        let entry = fresnel::entry_factor(model.eta(), 1.0);
        let rings = points
            .iter()
            .zip(means)
            .map(|(point, mean)| {
                let value = point.reflectance_per_mm2;
                [
                    point.radius_mm * medium.sigma_t_prime(),
                    entry * mean / value - 1.0,
                    point.u_reflectance_per_mm2 / value,
                    model.relative_error(medium, point.radius_mm),
                ]
            })
            .collect();
        Self { rings }
    }

    /// χ² over its expectation in units of its standard deviation, and the worst ring.
    fn excess(&self) -> (f64, f64) {
        let z2 = self
            .rings
            .iter()
            .map(|[_, d, u, m]| d * d / (u * u + m * m));
        let n = self.rings.len() as f64;
        let worst = z2.clone().fold(0.0, f64::max).sqrt();
        ((z2.sum::<f64>() - n) / (2.0 * n).sqrt(), worst)
    }

    /// Weighted mean deviation of the rings between two radii in 1/σₜ′, and its standard error.
    fn mean(&self, from: f64, to: f64) -> Option<(f64, f64)> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for [rho, d, u, _] in &self.rings {
            if (from..to).contains(rho) {
                sum += d / (u * u);
                weight += 1.0 / (u * u);
            }
        }
        (weight > 0.0).then(|| (sum / weight, weight.sqrt().recip()))
    }
}

#[test]
fn totals_are_those_of_adding_doubling() {
    let mut rows = 0;
    for line in ADDING_DOUBLING.lines().skip(1) {
        let (name, rest) = line.split_once(',').unwrap();
        let [albedo, g, eta, expected, _] = numbers(rest)[..] else {
            panic!("{line}")
        };
        let medium = Coefficients {
            sigma_a: 1.0 - albedo,
            sigma_s_prime: albedo * (1.0 - g),
        };
        let total = TransportModel::new(eta, g)
            .unwrap()
            .within(medium, f64::INFINITY)
            .value;
        let entry = fresnel::entry_factor(eta, 1.0);
        let got = 1.0 - entry + entry * total;
        println!(
            "{name}: {got:.6} for {expected:.6}, {:+.1e}",
            got / expected - 1.0
        );
        assert!(
            (got / expected - 1.0).abs() < 1e-4,
            "{name}: {got} for {expected}"
        );
        rows += 1;
    }
    assert_eq!(rows, 5);
}

#[test]
fn profiles_are_those_of_mcml() {
    for (name, text, eta, sigma_a, sigma_s_prime, g) in [
        (
            "marble_g",
            include_str!("../../../fixtures/monte-carlo/marble_g.reflectance_r.csv"),
            1.5,
            0.0041,
            2.62,
            0.0,
        ),
        (
            "marble_g_g09",
            include_str!("../../../fixtures/monte-carlo/marble_g_g09.reflectance_r.csv"),
            1.5,
            0.0041,
            2.62,
            0.9,
        ),
        (
            "skin1_r",
            include_str!("../../../fixtures/monte-carlo/skin1_r.reflectance_r.csv"),
            1.3,
            0.032,
            0.74,
            0.0,
        ),
        (
            "skin1_r_matched",
            include_str!("../../../fixtures/monte-carlo/skin1_r_matched.reflectance_r.csv"),
            1.0,
            0.032,
            0.74,
            0.0,
        ),
    ] {
        let rings: Vec<Ring> = text
            .lines()
            .skip(1)
            .map(numbers)
            .filter(|row| row[4] < 0.1)
            .map(|row| Ring {
                edges: (row[0], row[1]),
                value: row[2],
                u: row[3],
            })
            .collect();
        assert!(rings.len() > 40, "{name}: {} rings", rings.len());
        let model = TransportModel::new(eta, g).unwrap();
        let medium = Coefficients {
            sigma_a,
            sigma_s_prime,
        };
        let (excess, worst) = Comparison::new(&model, medium, &rings).excess();
        println!("{name}: chi2 excess {excess:.2} sigma, worst ring {worst:.2}");
        assert!(
            excess.abs() < 3.1 && worst < 4.5,
            "{name}: {excess}, worst {worst}"
        );
    }
}

#[test]
fn profiles_and_totals_are_those_of_random_walks() {
    let rows: Vec<Vec<f64>> = WALKS.lines().skip(1).map(numbers).collect();
    let mut all: Vec<Comparison> = Vec::new();
    for walk in rows.chunk_by(|a, b| a[..5] == b[..5]) {
        let [eta, sigma_a, sigma_s_prime, g, _, total, u_total, ..] = walk[0][..] else {
            panic!("short row")
        };
        let rings: Vec<Ring> = walk
            .iter()
            .map(|row| Ring {
                edges: (row[7], row[8]),
                value: row[9],
                u: row[10],
            })
            .collect();
        let model = TransportModel::new(eta, g).unwrap();
        let medium = Coefficients {
            sigma_a,
            sigma_s_prime,
        };
        let got = fresnel::entry_factor(eta, 1.0) * model.within(medium, f64::INFINITY).value;
        // The harmonics that are cut off cost something where little light comes back.
        let dark = sigma_a / (sigma_a + sigma_s_prime);
        let u_model = 1e-4 + 3e-3 * dark * dark * g.powi(4);
        let z = (got - total) / u_total.hypot(u_model * total);
        let comparison = Comparison::new(&model, medium, &rings);
        let (excess, worst) = comparison.excess();
        print!(
            "eta {eta} g {g} a' {sigma_s_prime}: total {:+.1e}, z {z:+.1}; chi2 excess {excess:+.1}, worst {worst:.1}; permille",
            got / total - 1.0
        );
        for (from, to) in [
            (0.01, 0.1),
            (0.1, 0.4),
            (0.4, 1.0),
            (1.0, 4.0),
            (4.0, 10.0),
            (10.0, 100.0),
        ] {
            if let Some((d, u)) = comparison.mean(from, to) {
                print!(" {:+.2}±{:.2}", 1e3 * d, 1e3 * u);
            }
        }
        println!();
        assert!(
            z.abs() < 3.5,
            "eta {eta} g {g}: total {got} for {total} ± {u_total}"
        );
        assert!(
            excess < 3.1 && worst < 4.5,
            "eta {eta} g {g}: {excess}, worst {worst}"
        );
        all.push(comparison);
    }
    assert!(all.len() >= 10, "{} walks", all.len());
}
