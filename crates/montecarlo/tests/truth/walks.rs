//! The lanes against the walk that defines them: every tally, on every path.

use crate::statistics::p_value;
use montecarlo::{
    Beam, Direction, Estimate, Incidence, Layer, LayeredMedium, Phase, PhaseMixture, Side,
    SimdPath, Simulation, TabulatedPhase, Tally, TallySpec, Walk,
};

fn layer(sigma_a: f64, sigma_s: f64, phase: Phase, eta: f64, thickness: f64) -> Layer {
    let thickness_mm = thickness.is_finite().then_some(thickness);
    Layer {
        sigma_a,
        sigma_s,
        phase,
        eta,
        thickness_mm,
    }
}

fn hg(g: f64) -> Phase {
    Phase::HenyeyGreenstein { g }
}

/// Media that between them use every piece of the walk.
fn cases() -> Vec<(&'static str, Simulation)> {
    let spec = TallySpec {
        radius_mm: (0..=20).map(|k| 0.15 * f64::from(k)).collect(),
        angle_bins: 12,
        radius_and_angle: true,
        azimuth_bins: 4,
        depth_mm: (0..=16).map(|k| 0.2 * f64::from(k)).collect(),
        depth_and_radius: true,
        orders: 30,
        path_mm: (0..=30).map(|k| 0.5 * f64::from(k)).collect(),
        path_cutoff_mm: None,
    };
    let simulation = |layers, eta_below, beam, direction, spec: &TallySpec| {
        let medium = LayeredMedium {
            layers,
            eta_above: 1.0,
            eta_below,
        };
        Simulation::new(medium, Incidence { beam, direction }, spec, 8).unwrap()
    };
    let normal = Direction::Collimated { angle: 0.0 };
    let haze = TabulatedPhase::new(&[(-1.0, 0.5), (0.5, 0.3), (1.0, 6.0)]).unwrap();
    let parts = [(0.3, Phase::Tabulated(haze.clone())), (0.7, hg(0.8))];
    let mixture = Phase::Mixture(PhaseMixture::new(&parts).unwrap());
    let cut = TallySpec {
        path_cutoff_mm: Some(8.0),
        ..spec.clone()
    };
    vec![
        (
            "slide on two layers, oblique disk",
            simulation(
                vec![
                    layer(0.0, 0.0, hg(0.0), 1.5, 0.3),
                    layer(0.2, 3.0, hg(0.8), 1.4, 0.8),
                    layer(0.05, 2.0, hg(-0.3), 1.33, 2.0),
                ],
                1.2,
                Beam::Disk { fwhm_mm: 1.0 },
                Direction::Collimated { angle: 0.7 },
                &spec,
            ),
        ),
        (
            "isotropic half-space, diffuse Gaussian",
            simulation(
                vec![layer(0.1, 2.0, hg(0.0), 1.5, f64::INFINITY)],
                1.0,
                Beam::Gaussian { fwhm_mm: 0.5 },
                Direction::Diffuse,
                &spec,
            ),
        ),
        (
            "Rayleigh on haze on an absorber without end",
            simulation(
                vec![
                    layer(0.1, 2.0, Phase::Rayleigh, 1.3, 0.5),
                    layer(0.02, 4.0, Phase::Tabulated(haze.clone()), 1.4, 1.0),
                    layer(5.0, 0.0, hg(0.0), 1.4, f64::INFINITY),
                ],
                1.0,
                Beam::Point,
                normal,
                &spec,
            ),
        ),
        (
            "a mixture of haze and tissue over glass",
            simulation(
                vec![layer(0.1, 3.0, mixture, 1.4, 1.5)],
                1.4,
                Beam::Point,
                normal,
                &spec,
            ),
        ),
        (
            "white half-space, cut off",
            simulation(
                vec![layer(0.0, 2.0, hg(0.5), 1.4, f64::INFINITY)],
                1.0,
                Beam::Point,
                normal,
                &cut,
            ),
        ),
    ]
}

/// Every number of a result, by tally.
fn tallies(tally: &Tally) -> Vec<(String, Vec<Estimate>)> {
    let totals = vec![
        tally.specular(),
        tally.reflectance(),
        tally.transmittance(),
        tally.unscattered_transmittance(),
        tally.absorbed(),
        tally.cut_off(),
        tally.roulette(),
    ];
    let mut all = vec![
        ("totals".to_owned(), totals),
        ("by layer".to_owned(), tally.absorbed_by_layer()),
        (
            "by depth".to_owned(),
            tally.absorbed_by_depth().unwrap().bins,
        ),
        (
            "by depth and radius".to_owned(),
            tally.absorbed_by_depth_and_radius().unwrap().cells,
        ),
    ];
    for side in [Side::Above, Side::Below] {
        for (name, binned) in [
            ("radius", tally.by_radius(side)),
            ("angle", tally.by_angle(side)),
            ("path", tally.by_path(side)),
            ("order", tally.by_order(side)),
        ] {
            let mut estimates = binned.bins;
            estimates.push(binned.beyond);
            all.push((format!("{side:?} by {name}"), estimates));
        }
        let joint = tally.by_radius_and_angle(side).unwrap();
        all.push((format!("{side:?} by radius and angle"), joint.cells));
        let directions = tally.by_order_and_direction(side).unwrap();
        let cells = directions.into_iter().flat_map(|d| d.cells).collect();
        all.push((format!("{side:?} by order and direction"), cells));
    }
    all
}

/// χ² of every tally, over the cells that both know to 10 %.
fn compare(what: &str, a: &Tally, b: &Tally) {
    let mut compared = 0;
    for ((name, a), (_, b)) in tallies(a).iter().zip(&tallies(b)) {
        let known = |e: &Estimate| e.u > 0.0 && e.u < 0.1 * e.value.abs();
        let pairs = a.iter().zip(b).filter(|(a, b)| known(a) && known(b));
        let z: Vec<f64> = pairs
            .map(|(a, b)| (a.value - b.value) / a.u.hypot(b.u))
            .collect();
        if z.is_empty() {
            continue;
        }
        let chi_square = z.iter().map(|z| z * z).sum();
        let p = p_value(chi_square, z.len());
        // Seventy tallies are compared in all: one p below 1e-4 would be a surprise.
        assert!(
            p > 1e-4,
            "{what}, {name}: χ² = {chi_square} of {}, p = {p}",
            z.len()
        );
        compared += z.len();
    }
    assert!(compared > 60, "{what}: only {compared} cells");
}

#[test]
fn every_path_has_the_distributions_of_the_scalar_walk() {
    for (name, simulation) in cases() {
        let photons = 150_000;
        let scalar = simulation
            .clone()
            .with_walk(Walk::Scalar)
            .run_photons(photons)
            .unwrap();
        assert!(
            scalar.energy_error().abs() < 1e-12,
            "{name}: {}",
            scalar.energy_error()
        );
        for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
            let lanes = simulation.clone().with_walk(Walk::Lanes(path));
            let lanes = lanes.run_photons(2 * photons).unwrap();
            assert!(
                lanes.energy_error().abs() < 1e-6,
                "{name}: {}",
                lanes.energy_error()
            );
            // Roulette gives what it takes.
            let roulette = lanes.roulette();
            assert!(
                roulette.value.abs() <= 4.5 * roulette.u,
                "{name}, {path:?}: {roulette:?}"
            );
            compare(&format!("{name}, {path:?}"), &lanes, &scalar);
        }
    }
}

/// Absorption booked along every flight is absorption booked at boundaries.
#[test]
fn depth_bins_add_up_to_what_is_absorbed() {
    for (name, simulation) in cases() {
        for walk in [Walk::Scalar, Walk::Lanes(SimdPath::best())] {
            let tally = simulation
                .clone()
                .with_walk(walk)
                .run_photons(20_000)
                .unwrap();
            let by_depth = tally.absorbed_by_depth().unwrap();
            let sum = by_depth.sum() + by_depth.beyond.value;
            let joint = tally.absorbed_by_depth_and_radius().unwrap();
            let joint: f64 = joint.cells.iter().map(|cell| cell.value).sum();
            let layers: f64 = tally
                .absorbed_by_layer()
                .iter()
                .map(|layer| layer.value)
                .sum();
            let absorbed = tally.absorbed().value;
            // Flights are booked from single precision twice rounded, boundaries from the sum.
            for (what, got) in [
                ("depth", sum),
                ("depth and radius", joint),
                ("layers", layers),
            ] {
                assert!(
                    (got - absorbed).abs() < 1e-9,
                    "{name}, {walk:?}, {what}: {got}, {absorbed}"
                );
            }
        }
    }
}

/// Each photon leaves once: every tally of what leaves adds up to the total.
#[test]
fn bins_and_beyond_add_up_to_the_total() {
    for (name, simulation) in cases() {
        let tally = simulation.run_photons(20_000).unwrap();
        for (side, total) in [
            (Side::Above, tally.reflectance().value),
            (Side::Below, tally.transmittance().value),
        ] {
            for binned in [
                tally.by_radius(side),
                tally.by_angle(side),
                tally.by_path(side),
            ] {
                let sum = binned.sum() + binned.beyond.value;
                assert!(
                    (sum - total).abs() < 1e-13,
                    "{name}, {side:?}: {sum}, {total}"
                );
            }
            let directions = tally.by_order_and_direction(side).unwrap();
            let cells = directions.iter().flat_map(|d| &d.cells);
            let sum: f64 = cells.map(|cell| cell.value).sum();
            assert!(
                (sum - total).abs() < 1e-13,
                "{name}, {side:?}: {sum}, {total}"
            );
            let orders = tally.by_order(side);
            let specular = if side == Side::Above {
                tally.specular().value
            } else {
                0.0
            };
            let sum = orders.sum() + orders.beyond.value - specular;
            assert!(
                (sum - total).abs() < 1e-13,
                "{name}, {side:?}: {sum}, {total}"
            );
        }
    }
}
