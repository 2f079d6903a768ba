//! Profiles by radius and angle against MCML (`fixtures/monte-carlo`).

use crate::statistics::p_value;
use montecarlo::{
    Estimate, Incidence, Layer, LayeredMedium, Phase, Side, Simulation, TallySpec, ring_area,
    solid_angle,
};

/// The columns of one file.
struct Table(Vec<Vec<f64>>);

impl Table {
    fn new(text: &str) -> Self {
        let numbers = |line: &str| line.split(',').map(|n| n.parse().unwrap()).collect();
        Self(text.lines().skip(1).map(numbers).collect())
    }

    fn edges(&self) -> Vec<f64> {
        let first = self.0[0][0];
        std::iter::once(first)
            .chain(self.0.iter().map(|row| row[1]))
            .collect()
    }

    fn estimates(&self, value: usize, u: usize) -> Vec<Estimate> {
        self.0
            .iter()
            .map(|row| Estimate {
                value: row[value],
                u: row[u],
            })
            .collect()
    }
}

/// χ² over the rings that both know to 10 %, the variances added.
fn compare(what: &str, ours: &[Estimate], theirs: &[Estimate]) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let known = |e: &Estimate| e.value > 0.0 && e.u < 0.1 * e.value;
    let (mut chi_square, mut count) = (0.0, 0);
    for (k, (a, b)) in ours.iter().zip(theirs).enumerate() {
        if known(a) && known(b) {
            let z = (a.value - b.value) / a.u.hypot(b.u);
            assert!(z.abs() < 4.5, "{what}, ring {k}: {a:?} for {b:?}, z = {z}");
            chi_square += z * z;
            count += 1;
        }
    }
    let p = p_value(chi_square, count);
    assert!(count >= 20, "{what}: only {count} rings");
    assert!(
        (0.001..=0.999).contains(&p),
        "{what}: χ² = {chi_square} of {count}, p = {p}"
    );
}

fn check(name: &str, photons: u64, layers: &[[f64; 5]], radius: &str, angle: &str) {
    let (radius, angle) = (Table::new(radius), Table::new(angle));
    let layers = layers
        .iter()
        .map(|&[eta, sigma_a, sigma_s, g, thickness]| Layer {
            sigma_a,
            sigma_s,
            phase: Phase::HenyeyGreenstein { g },
            eta,
            thickness_mm: thickness.is_finite().then_some(thickness),
        });
    let medium = LayeredMedium {
        layers: layers.collect(),
        eta_above: 1.0,
        eta_below: 1.0,
    };
    let tally = TallySpec {
        radius_mm: radius.edges(),
        angle_bins: angle.0.len(),
        ..TallySpec::default()
    };
    let simulation = Simulation::new(medium, Incidence::PENCIL, &tally, 3).unwrap();
    let result = simulation.run_photons(photons).unwrap();

    let exitance = |side| result.by_radius(side).density(ring_area);
    let intensity = |side| result.by_angle(side).density(solid_angle);
    compare(
        &format!("{name} R(r)"),
        &exitance(Side::Above),
        &radius.estimates(2, 3),
    );
    compare(
        &format!("{name} R(α)"),
        &intensity(Side::Above),
        &angle.estimates(2, 3),
    );
    if radius.0[0].len() > 5 {
        compare(
            &format!("{name} T(r)"),
            &exitance(Side::Below),
            &radius.estimates(5, 6),
        );
        compare(
            &format!("{name} T(α)"),
            &intensity(Side::Below),
            &angle.estimates(4, 5),
        );
    }
}

macro_rules! mcml {
    ($($name:ident: $photons:expr, $layers:expr;)*) => {$(
        #[test]
        fn $name() {
            let name = stringify!($name);
            let radius = include_str!(concat!(
                "../../../../fixtures/monte-carlo/", stringify!($name), ".reflectance_r.csv"
            ));
            let angle = include_str!(concat!(
                "../../../../fixtures/monte-carlo/", stringify!($name), ".reflectance_angle.csv"
            ));
            check(name, $photons, &$layers, radius, angle);
        }
    )*};
}

const ENDLESS: f64 = f64::INFINITY;

// Layers as `totals.csv` gives them: η, σₐ, σₛ, g, thickness. Photons for a few seconds each.
mcml! {
    marble_g: 2_000_000, [[1.5, 0.0041, 2.62, 0.0, ENDLESS]];
    marble_g_g09: 300_000, [[1.5, 0.0041, 26.2, 0.9, ENDLESS]];
    skin1_r: 4_000_000, [[1.3, 0.032, 0.74, 0.0, ENDLESS]];
    skin1_r_matched: 4_000_000, [[1.0, 0.032, 0.74, 0.0, ENDLESS]];
    slab_1mm: 4_000_000, [[1.43, 0.021, 6.85, 0.8, 1.0]];
    layers3_same_n14: 1_000_000,
        [[1.4, 0.3, 12.0, 0.8, 0.1], [1.4, 0.05, 9.0, 0.8, 1.5], [1.4, 0.01, 6.0, 0.75, 5.0]];
}
