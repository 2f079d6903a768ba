//! Scatterings a second, on one thread: in the block of Figure 8 and in the bust of Figure 9 filled
//! with the same green marble, beside photons in plane layers (`montecarlo`), in one run:
//!
//! `cargo run --release -p beamspot-tests --example scatterings`
//!
//! Every scattering is walked to (`paths` of the renderer asks the surface for its distance at each
//! flight that may reach it) or, with leaps, counted where a leap stands for many.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a study that prints what it finds"
)]

use montecarlo::{Incidence, Layer, LayeredMedium, Phase, SimdPath, Simulation, TallySpec, Walk};
use physics::Medium;
use physics::random::{Stream, stream, uniform};
use pipeline::rendering::load;
use render::Vec3;
use render::boundary::part;
use render::leap::Leaps;
use render::walk::{Ground, Photon, Visitor, wander};
use std::ops::ControlFlow;
use std::time::Instant;

const MARBLE: Medium = Medium {
    sigma_a: 0.0041,
    sigma_s: 2.62,
    g: 0.0,
    eta: 1.5,
};
/// Each figure is the best of so many runs.
const RUNS: usize = 3;

struct Counter {
    leaps: bool,
    scatterings: u64,
}

impl Visitor for Counter {
    fn scatters(&mut self, _: &mut Photon, _: bool, _: &mut Stream) -> ControlFlow<()> {
        self.scatterings += 1;
        ControlFlow::Continue(())
    }

    fn leapt(&mut self, scatterings: u32) {
        self.scatterings += u64::from(scatterings);
    }

    fn unseen(&self, _: Vec3) -> f64 {
        if self.leaps { f64::INFINITY } else { 0.0 }
    }
}

/// Scatterings a second of photons that enter a scene's solid where its camera sees it.
fn in_solid(scene: &str, photons: u32, leaps: bool) -> f64 {
    let path = format!("{}/../scenes/{scene}", env!("CARGO_MANIFEST_DIR"));
    let scene = load(path.as_ref()).unwrap().scene;
    let [width, height] = scene.camera.size().map(|n| n as f64);
    let mut best = 0.0_f64;
    for run in 0..RUNS {
        let mut rng = stream(1, &[run as u64]);
        let mut walks = Leaps::new(MARBLE, 1, [run as u64, 0]);
        let mut counter = Counter {
            leaps,
            scatterings: 0,
        };
        let clock = Instant::now();
        for _ in 0..photons {
            let (origin, direction) = loop {
                let [x, y] = [width, height].map(|n| n * uniform(&mut rng));
                let (origin, direction) = scene.camera.ray(x, y);
                if let Some((_, hit)) = scene.enter(origin, direction) {
                    let inside = part(direction, hit.normal, MARBLE.eta).refracted;
                    break (origin + hit.distance * direction, inside);
                }
            };
            let mut photon = Photon {
                at: origin,
                direction,
                depth: 0.0,
            };
            let ground = Ground {
                shape: &scene.objects[0].shape,
                medium: &MARBLE,
                leaps: &mut walks,
                roulette: render::walk::ROULETTE_DEPTH,
            };
            wander(ground, &mut photon, &mut rng, &mut counter);
        }
        best = best.max(counter.scatterings as f64 / clock.elapsed().as_secs_f64());
    }
    best
}

/// Scatterings a second of `simulate` in a half-space.
fn in_layers(walk: Walk, photons: u64) -> Option<f64> {
    let layer = Layer {
        sigma_a: MARBLE.sigma_a,
        sigma_s: MARBLE.sigma_s,
        phase: Phase::HenyeyGreenstein { g: MARBLE.g },
        eta: MARBLE.eta,
        thickness_mm: None,
    };
    let medium = LayeredMedium {
        layers: vec![layer],
        eta_above: 1.0,
        eta_below: 1.0,
    };
    let simulation = Simulation::new(medium, Incidence::PENCIL, &TallySpec::default(), 1).unwrap();
    let simulation = simulation.with_walk(walk);
    if simulation.walk() != walk {
        return None;
    }
    let rate = |_| {
        let clock = Instant::now();
        let tally = simulation.run_photons(photons).unwrap();
        tally.events() as f64 / clock.elapsed().as_secs_f64()
    };
    Some((0..RUNS).map(rate).fold(0.0, f64::max))
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    pool.install(|| {
        let millions = |rate: f64| rate * 1e-6;
        println!("million scatterings a second, one thread, green marble (g = 0)");
        let plain = in_layers(Walk::Scalar, 20_000).unwrap();
        println!("plane layers, scalar: {:.1}", millions(plain));
        for path in SimdPath::ALL {
            if let Some(rate) = in_layers(Walk::Lanes(path), 100_000) {
                println!(
                    "plane layers, {path:?}: {:.1}, {:.2} of scalar",
                    millions(rate),
                    rate / plain
                );
            }
        }
        for leaps in [false, true] {
            let solids = [
                ("jensen8.toml", "box"),
                ("jensen9.toml", "bust, 60,000 triangles"),
            ];
            let rates = solids.map(|(scene, _)| in_solid(scene, 20_000, leaps));
            let how = if leaps { "with leaps" } else { "step by step" };
            for ((_, name), rate) in solids.iter().zip(rates) {
                println!(
                    "{name}, {how}: {:.1}, {:.2} of scalar layers",
                    millions(rate),
                    rate / plain
                );
            }
            println!("bust over box, {how}: {:.2}", rates[1] / rates[0]);
        }
    });
}
