//! Nanoseconds per scattering: the scalar walk and every instruction path, in one process, and what
//! the pieces of a scattering cost in lanes.
//!
//! `cargo bench -p beamspot-montecarlo`. One thread. Each figure is the best of three runs. Where
//! there is a C compiler, `plain_walk.c` runs beside the scalar walk.
#![expect(clippy::print_stdout, reason = "a bench prints")]

use montecarlo::pieces::{Piece, Pieces};
use montecarlo::{Incidence, Layer, LayeredMedium, Phase, SimdPath, Simulation, TallySpec, Walk};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// `plain_walk.c`, compiled with all that the compiler has for this machine.
fn plain_c() -> Option<PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/plain_walk.c");
    let program = std::env::temp_dir().join(format!("plain_walk_{}", std::process::id()));
    let compiled = Command::new("cc")
        .args(["-O3", "-march=native", "-o"])
        .args([&program, &source])
        .arg("-lm")
        .status();
    compiled
        .is_ok_and(|status| status.success())
        .then_some(program)
}

/// Its nanoseconds per scattering in the half-space `layer`.
fn plain_cost(program: &Path, layer: &Layer, photons: u64) -> Option<f64> {
    let Phase::HenyeyGreenstein { g } = layer.phase else {
        return None;
    };
    let numbers = [layer.sigma_a, layer.sigma_s, g, layer.eta, photons as f64];
    let output = Command::new(program)
        .args(numbers.map(|x| x.to_string()))
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    text.split_whitespace().next()?.parse().ok()
}

/// Nanoseconds of one piece in one lane.
fn cost(piece: Piece, path: SimdPath) -> f64 {
    let mut pool = Pieces::default();
    let passes = 200_000;
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let clock = Instant::now();
        for _ in 0..passes {
            black_box(&mut pool).pass(piece, path);
        }
        let lanes = f64::from(passes) * Pieces::LANES as f64;
        best = best.min(clock.elapsed().as_secs_f64() * 1e9 / lanes);
    }
    best
}

fn layer(sigma_a: f64, sigma_s: f64, g: f64, eta: f64, thickness_mm: Option<f64>) -> Layer {
    Layer {
        sigma_a,
        sigma_s,
        phase: Phase::HenyeyGreenstein { g },
        eta,
        thickness_mm,
    }
}

fn media() -> [(&'static str, u64, Vec<Layer>); 3] {
    [
        (
            "marble green, g = 0",
            200_000,
            vec![layer(0.0041, 2.62, 0.0, 1.5, None)],
        ),
        (
            "skin, g = 0.9",
            200_000,
            vec![layer(0.032, 7.4, 0.9, 1.3, None)],
        ),
        (
            "three layers",
            200_000,
            vec![
                layer(0.3, 12.0, 0.8, 1.4, Some(0.1)),
                layer(0.05, 9.0, 0.8, 1.4, Some(1.5)),
                layer(0.01, 6.0, 0.75, 1.4, Some(5.0)),
            ],
        ),
    ]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let tally = TallySpec {
        radius_mm: (0..=200).map(|k| 0.05 * f64::from(k)).collect(),
        ..TallySpec::default()
    };
    let plain = plain_c();
    for (name, photons, layers) in media() {
        let half_space = match &layers[..] {
            [layer] => Some(layer.clone()),
            _ => None,
        };
        let medium = LayeredMedium {
            layers,
            eta_above: 1.0,
            eta_below: 1.0,
        };
        let simulation = Simulation::new(medium, Incidence::PENCIL, &tally, 1)?;
        println!("{name}");
        let mut scalar = None;
        for walk in [Walk::Scalar]
            .into_iter()
            .chain(SimdPath::ALL.map(Walk::Lanes))
        {
            let simulation = simulation.clone().with_walk(walk);
            if simulation.walk() != walk {
                continue;
            }
            let photons = if walk == Walk::Scalar {
                photons / 8
            } else {
                photons
            };
            let mut best = f64::INFINITY;
            let mut rate = 0.0;
            let mut in_c = f64::INFINITY;
            for _ in 0..3 {
                if let (Walk::Scalar, Some(program), Some(layer)) = (walk, &plain, &half_space) {
                    in_c = plain_cost(program, layer, photons).map_or(in_c, |ns| in_c.min(ns));
                }
                let clock = Instant::now();
                let tally = pool.install(|| simulation.run_photons(photons))?;
                let seconds = clock.elapsed().as_secs_f64();
                let event = seconds * 1e9 / tally.events() as f64;
                if event < best {
                    best = event;
                    rate = tally.photons() as f64 / seconds;
                }
            }
            let reference = *scalar.get_or_insert(best);
            println!(
                "  {:24} {best:7.2} ns/scattering {rate:10.0} photons/s {:6.1} × scalar",
                format!("{walk:?}"),
                reference / best,
            );
            if in_c.is_finite() {
                println!("  {:24} {in_c:7.2} ns/scattering", "plain C");
            }
        }
    }
    if let Some(program) = plain {
        std::fs::remove_file(program)?;
    }
    println!("pieces of a scattering, ns per lane");
    use Piece::{Division, Logarithm, SineAndCosine, SquareRoot};
    for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
        print!("  {:10}", path.name());
        for piece in [Logarithm, SineAndCosine, SquareRoot, Division] {
            print!(" {piece:?} {:.2}", cost(piece, path));
        }
        println!();
    }
    Ok(())
}
