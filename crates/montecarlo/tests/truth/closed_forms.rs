//! What can be known without a random number.

use crate::chandrasekhar::{H, rule};
use montecarlo::{
    Beam, Direction, Estimate, Incidence, Layer, LayeredMedium, Phase, Side, Simulation,
    TabulatedPhase, Tally, TallySpec, Walk, solid_angle,
};
use physics::{Medium, PhaseFunction, fresnel};
use std::f64::consts::PI;

fn assert_near(what: &str, got: Estimate, expected: f64) {
    let z = (got.value - expected) / got.u;
    // Four standard errors, and rounding of single precision where the error is none.
    let off = (got.value - expected).abs() - 2e-7;
    assert!(
        off <= 4.0 * got.u,
        "{what}: {got:?} for {expected}, z = {z}"
    );
}

fn run(medium: LayeredMedium, incidence: Incidence, tally: &TallySpec, photons: u64) -> [Tally; 2] {
    let simulation = Simulation::new(medium, incidence, tally, 5).unwrap();
    let scalar = simulation.clone().with_walk(Walk::Scalar);
    [
        simulation.run_photons(photons).unwrap(),
        scalar.run_photons(photons / 4).unwrap(),
    ]
}

/// Light through a coloured pane, back and forth between its faces, summed as a geometric series.
#[test]
fn an_absorbing_pane() {
    let (sigma_a, eta, thickness, angle) = (0.4, 1.5, 2.0, 0.6_f64);
    // So little scattering that it shows nowhere, but enough to be a medium.
    let pane = Layer {
        sigma_a,
        sigma_s: 1e-8,
        phase: Phase::ISOTROPIC,
        eta,
        thickness_mm: Some(thickness),
    };
    let medium = LayeredMedium {
        layers: vec![pane],
        eta_above: 1.0,
        eta_below: 1.0,
    };
    let direction = Direction::Collimated { angle };
    let incidence = Incidence {
        direction,
        ..Incidence::PENCIL
    };

    let r = fresnel::reflectance(eta, angle.cos());
    let inside = fresnel::refracted_cos(eta, angle.cos()).unwrap();
    let pass = (-sigma_a * thickness / inside).exp();
    let bounces = 1.0 - (r * pass).powi(2);
    let transmitted = (1.0 - r).powi(2) * pass / bounces;
    let reflected = r + (1.0 - r).powi(2) * r * pass * pass / bounces;
    for tally in run(medium, incidence, &TallySpec::default(), 200_000) {
        assert_near("T", tally.transmittance(), transmitted);
        assert_near(
            "unscattered T",
            tally.unscattered_transmittance(),
            transmitted,
        );
        assert_near("specular R", tally.specular(), reflected);
        assert_near("A", tally.absorbed(), 1.0 - transmitted - reflected);
        assert_eq!(tally.reflectance().value, 0.0, "nothing scatters");
    }
}

/// The pane as two clear slides around an absorber: three layers, two of them without scattering.
#[test]
fn clear_slides_change_nothing_but_the_path() {
    let layer = |sigma_a, sigma_s, eta, thickness| Layer {
        sigma_a,
        sigma_s,
        phase: Phase::ISOTROPIC,
        eta,
        thickness_mm: Some(thickness),
    };
    let slides = |glass: f64| LayeredMedium {
        layers: vec![
            layer(0.0, 0.0, 1.5, glass),
            layer(0.1, 3.0, 1.33, 1.0),
            layer(0.0, 0.0, 1.5, glass),
        ],
        eta_above: 1.0,
        eta_below: 1.0,
    };
    // Lossless glass moves light sideways only: totals do not depend on its thickness.
    let spec = TallySpec::default();
    let [thin, scalar] = run(slides(0.01), Incidence::PENCIL, &spec, 400_000);
    let [thick, _] = run(slides(20.0), Incidence::PENCIL, &spec, 400_000);
    for (name, a, b) in [
        ("R", thin.reflectance(), thick.reflectance()),
        ("T", thin.transmittance(), thick.transmittance()),
        ("R scalar", scalar.reflectance(), thick.reflectance()),
        (
            "A in glass",
            thick.absorbed_by_layer()[0],
            Estimate { value: 0.0, u: 0.0 },
        ),
    ] {
        let u = a.u.hypot(b.u);
        assert!(
            (a.value - b.value).abs() <= 4.0 * u + 1e-12,
            "{name}: {a:?} and {b:?}"
        );
    }
}

/// Snell's law through two clear panes: where the straight beam comes out, at which angle, and how
/// much of it.
#[test]
fn a_straight_beam_through_two_panes() {
    let panes = [(1.2, 1.0), (1.6, 2.0)];
    let layers = panes.map(|(eta, thickness)| Layer {
        sigma_a: 0.0,
        sigma_s: 1e-8,
        phase: Phase::ISOTROPIC,
        eta,
        thickness_mm: Some(thickness),
    });
    let medium = LayeredMedium {
        layers: layers.to_vec(),
        eta_above: 1.0,
        eta_below: 1.1,
    };
    let angle = 0.9_f64;
    let sine = |eta: f64| angle.sin() / eta;
    let cos = |eta: f64| (1.0 - sine(eta).powi(2)).sqrt();
    let radius: f64 = panes.iter().map(|&(eta, t)| t * sine(eta) / cos(eta)).sum();
    let pass = |near: f64, far: f64| 1.0 - fresnel::reflectance(far / near, cos(near));
    let through = pass(1.0, 1.2) * pass(1.2, 1.6) * pass(1.6, 1.1);
    let below = sine(1.1).asin();

    let spec = TallySpec {
        radius_mm: vec![0.0, radius - 1e-5, radius + 1e-5],
        angle_bins: 180,
        radius_and_angle: true,
        ..TallySpec::default()
    };
    let direction = Direction::Collimated { angle };
    let incidence = Incidence {
        direction,
        ..Incidence::PENCIL
    };
    for tally in run(medium, incidence, &spec, 200_000) {
        let radii = tally.by_radius(Side::Below);
        assert_near("within", radii.bins[0], 0.0);
        assert_near("at the place", radii.bins[1], through);
        let angles = tally.by_angle(Side::Below);
        let bin = angles.edges.partition_point(|&edge| edge <= below) - 1;
        let all = tally.transmittance().value;
        assert!(
            (angles.bins[bin].value - all).abs() < 1e-9,
            "one angle for all: {below}"
        );
    }
}

/// Light that scatters once in a matched half-space: α ∫ p(−μ) 2π μ/(1 + μ) dμ, for every phase
/// function. Hanrahan and Krueger (1993), section 5.1, integrated over depth and hemisphere.
#[test]
fn single_scattering_of_every_phase_function() {
    let (sigma_a, sigma_s) = (0.5, 1.5);
    let haze = [(-1.0, 0.5), (-0.2, 0.1), (0.7, 0.4), (1.0, 8.0)];
    let phases = [
        Phase::ISOTROPIC,
        Phase::HenyeyGreenstein { g: 0.8 },
        Phase::HenyeyGreenstein { g: -0.4 },
        Phase::Rayleigh,
        Phase::Tabulated(TabulatedPhase::new(&haze).unwrap()),
    ];
    for phase in phases {
        let integrand = |mu: f64| 2.0 * PI * phase.density(-mu) * mu / (1.0 + mu);
        // Panels that end at the kinks of the table.
        let expected = sigma_s / (sigma_a + sigma_s)
            * (rule(40).integrate(0.0, 0.2, integrand) + rule(40).integrate(0.2, 1.0, integrand));
        let layer = Layer {
            sigma_a,
            sigma_s,
            phase: phase.clone(),
            eta: 1.0,
            thickness_mm: None,
        };
        let medium = LayeredMedium {
            layers: vec![layer],
            eta_above: 1.0,
            eta_below: 1.0,
        };
        let spec = TallySpec {
            orders: 3,
            ..TallySpec::default()
        };
        for tally in run(medium, Incidence::PENCIL, &spec, 800_000) {
            let once = tally.by_order(Side::Above).bins[1];
            assert_near(&format!("{phase:?}"), once, expected);
        }
    }
}

#[test]
fn the_matched_isotropic_half_space_is_chandrasekhars() {
    // The conservative value of his table XI.
    let conservative = H::new(1.0 - 1e-12).at(1.0);
    assert!((conservative - 2.9078).abs() < 2e-4, "{conservative}");

    let (albedo, angle) = (0.9, 1.0_f64);
    let h = H::new(albedo);
    let mu0 = angle.cos();
    let medium = Medium {
        sigma_a: 1.0 - albedo,
        sigma_s: albedo,
        g: 0.0,
        eta: 1.0,
    };
    let direction = Direction::Collimated { angle };
    let incidence = Incidence {
        direction,
        ..Incidence::PENCIL
    };
    let spec = TallySpec {
        angle_bins: 10,
        ..TallySpec::default()
    };
    for tally in run(
        LayeredMedium::half_space(&medium),
        incidence,
        &spec,
        2_000_000,
    ) {
        let expected = 1.0 - (1.0 - albedo).sqrt() * h.at(mu0);
        assert_near("total", tally.reflectance(), expected);
        // Radiance α/4 · H(μ) H(μ₀)/(μ + μ₀) per unit of irradiance π: times μ, over each bin.
        let by_angle = tally.by_angle(Side::Above);
        let intensity = by_angle.density(solid_angle);
        for (edge, got) in by_angle.edges.windows(2).zip(intensity) {
            let power = rule(20).integrate(edge[0], edge[1], |theta| {
                let mu = theta.cos();
                let radiance = albedo / (4.0 * PI) * h.at(mu) * h.at(mu0) / (mu + mu0);
                2.0 * PI * theta.sin() * mu * radiance
            });
            assert_near("angle", got, power / solid_angle(edge[0], edge[1]));
        }
    }
}

/// What passes a nearly clear, thin film has the beam's own footprint.
#[test]
fn the_footprint_is_the_beams() {
    let film = Layer {
        sigma_a: 0.0,
        sigma_s: 1e-5,
        phase: Phase::ISOTROPIC,
        eta: 1.0,
        thickness_mm: Some(1e-3),
    };
    let medium = LayeredMedium {
        layers: vec![film],
        eta_above: 1.0,
        eta_below: 1.0,
    };
    let spec = TallySpec {
        radius_mm: vec![0.0, 0.3, 0.5, 0.8],
        ..TallySpec::default()
    };
    let incidence = |beam, angle| {
        let direction = Direction::Collimated { angle };
        Incidence { beam, direction }
    };
    let gaussian = Beam::Gaussian { fwhm_mm: 1.0 };
    for tally in run(medium.clone(), incidence(gaussian, 0.0), &spec, 200_000) {
        let bins = tally.by_radius(Side::Below).bins;
        let within = |r: f64| 1.0 - (-4.0 * 2.0_f64.ln() * r * r).exp();
        assert_near("core", bins[0], within(0.3));
        assert_near("flank", bins[2], within(0.8) - within(0.5));
    }
    // At 60° the disk's footprint is an ellipse twice as long, which holds the disk's circle.
    let disk = Beam::Disk { fwhm_mm: 1.0 };
    for tally in run(medium, incidence(disk, PI / 3.0), &spec, 200_000) {
        let within = tally.by_radius(Side::Below);
        let share = within.bins[0].value + within.bins[1].value;
        // Five standard errors. The film is 1 µm thick: light moves 2 µm sideways.
        assert!((share - 0.5).abs() < 0.01, "{share}");
    }
}
