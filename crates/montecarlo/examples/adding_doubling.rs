//! The long check: every value of `fixtures/monte-carlo/adding-doubling.csv`, at the standard error
//! given, and the matched isotropic half-space against Chandrasekhar's H.
//!
//! `cargo run --release -p beamspot-montecarlo --example adding_doubling -- 5e-5 [PATH] [SEED]`
#![expect(clippy::print_stdout, reason = "an example prints")]

#[path = "../tests/truth/chandrasekhar.rs"]
mod chandrasekhar;
#[path = "../tests/truth/reference.rs"]
mod reference;
#[path = "../tests/truth/statistics.rs"]
mod statistics;

use montecarlo::{
    Direction, Incidence, InvalidSimulation, LayeredMedium, SimdPath, Simulation, TallySpec, Walk,
};
use physics::Medium;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let u: f64 = arguments.next().map_or(Ok(5e-5), |u| u.parse())?;
    let walk = match arguments.next().as_deref() {
        None => Walk::Lanes(SimdPath::best()),
        Some("scalar") => Walk::Scalar,
        Some(name) => Walk::Lanes(SimdPath::from_name(name).ok_or("no such path")?),
    };
    let seed: u64 = arguments.next().map_or(Ok(1), |seed| seed.parse())?;

    println!("walk {walk:?}, seed {seed}");
    for (albedo, angle) in [(0.9, 0.0), (0.9, 1.0), (0.99, 0.0), (0.99, 1.4)] {
        half_space(albedo, angle, u, walk, seed)?;
    }
    let (mut chi_square, mut values) = (0.0, 0);
    for (row, seed) in reference::adding_doubling().into_iter().zip(seed..) {
        // A seed of its own, or one run of luck would show in every row.
        let clock = Instant::now();
        let simulation = row.simulation(&TallySpec::default(), seed)?.with_walk(walk);
        let tally = simulation.run(0..1 << 24, &AtomicBool::new(false), |tally| {
            if tally.u() > u {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
        let seconds = clock.elapsed().as_secs_f64();
        println!(
            "{:22} {:10} photons {:7.1} s {:6.2} ns/scattering, energy {:+.1e}",
            row.name,
            tally.photons(),
            seconds,
            seconds * 1e9 / tally.events() as f64,
            tally.energy_error(),
        );
        let reflected = tally.specular().value + tally.reflectance().value;
        let pairs = [
            ("R", reflected, tally.reflectance().u, row.reflectance),
            (
                "T",
                tally.transmittance().value,
                tally.transmittance().u,
                row.transmittance,
            ),
        ];
        for (name, got, u, [expected, u_expected]) in pairs {
            if expected > 0.0 {
                let z = (got - expected) / u.hypot(u_expected);
                println!(
                    "{:22}   {name} {got:.6} ± {u:.6} for {expected:.6}: z = {z:+.2}",
                    ""
                );
                chi_square += z * z;
                values += 1;
            }
        }
    }
    let p = statistics::p_value(chi_square, values);
    println!("Σz² = {chi_square:.2} over {values} values, p = {p:.3}");
    Ok(())
}

/// Total reflectance 1 − √(1 − α) H(μ₀).
fn half_space(
    albedo: f64,
    angle: f64,
    u: f64,
    walk: Walk,
    seed: u64,
) -> Result<(), InvalidSimulation> {
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
    let medium = LayeredMedium::half_space(&medium);
    let simulation = Simulation::new(medium, incidence, &TallySpec::default(), seed)?;
    let tally = simulation
        .with_walk(walk)
        .run(0..1 << 24, &AtomicBool::new(false), |tally| {
            if tally.u() > u {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
    let expected = 1.0 - (1.0 - albedo).sqrt() * chandrasekhar::H::new(albedo).at(angle.cos());
    let got = tally.reflectance();
    let z = (got.value - expected) / got.u;
    println!(
        "H, albedo {albedo}, {angle} rad: {:.6} ± {:.6} for {expected:.6}: z = {z:+.2}",
        got.value, got.u
    );
    Ok(())
}
