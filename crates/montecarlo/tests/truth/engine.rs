//! Reproducibility, stopping, merging, the truth of standard errors, and bad input.

use crate::statistics::p_value;
use montecarlo::{
    CannotMerge, Estimate, Incidence, InvalidLayers, InvalidSimulation, Layer, LayeredMedium,
    PHOTONS_PER_BLOCK, Phase, Place, Side, SimdPath, Simulation, TallySpec, Walk,
};
use physics::Medium;
use physics::phase::InvalidPhase;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

const SKIN: Medium = Medium {
    sigma_a: 0.3,
    sigma_s: 7.4,
    g: 0.9,
    eta: 1.3,
};

fn spec() -> TallySpec {
    TallySpec {
        radius_mm: (0..=30).map(|k| 0.1 * f64::from(k)).collect(),
        depth_mm: vec![0.0, 0.5, 1.0, 2.0],
        ..TallySpec::default()
    }
}

fn simulation(seed: u64) -> Simulation {
    let medium = LayeredMedium::half_space(&SKIN);
    Simulation::new(medium, Incidence::PENCIL, &spec(), seed).unwrap()
}

const GO_ON: fn(&montecarlo::Tally) -> ControlFlow<()> = |_| ControlFlow::Continue(());

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    for walk in [Walk::Scalar, Walk::Lanes(SimdPath::best())] {
        let simulation = simulation(1).with_walk(walk);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| simulation.run(0..5, &AtomicBool::new(false), GO_ON).state())
        };
        assert_eq!(on(1), on(3), "{walk:?}");
    }
}

#[test]
fn continued_and_gathered_runs_give_the_same_bytes() {
    let simulation = simulation(2);
    let run = |blocks| simulation.run(blocks, &AtomicBool::new(false), GO_ON);
    let whole = run(0..6).state();
    // A run that is kept, taken up again and continued.
    let kept = simulation.restore(run(0..2).state()).unwrap();
    assert_eq!(kept.next_block(), 2);
    let continued = kept.merge(&run(2..6)).unwrap();
    assert_eq!(continued.state(), whole);
    // Runs gathered from three machines, out of order.
    let gathered = run(4..6)
        .merge(&run(0..1))
        .unwrap()
        .merge(&run(1..4))
        .unwrap();
    assert_eq!(gathered.state(), whole);
    assert_eq!(gathered.photons(), 6 * PHOTONS_PER_BLOCK);
}

#[test]
fn both_fused_paths_give_the_same_bytes() {
    if !SimdPath::Avx512.is_available() {
        return;
    }
    let sums = |path| {
        simulation(3)
            .with_walk(Walk::Lanes(path))
            .run_photons(1)
            .unwrap()
            .state()
            .sums
    };
    assert_eq!(sums(SimdPath::Avx2), sums(SimdPath::Avx512));
    assert_ne!(
        sums(SimdPath::Avx2),
        sums(SimdPath::Portable),
        "rounds twice"
    );
}

#[test]
fn another_seed_gives_other_photons() {
    let value = |seed| simulation(seed).run_photons(1).unwrap().reflectance().value;
    assert_ne!(value(1), value(2));
}

#[test]
fn what_does_not_belong_together_is_not_merged() {
    let run = |s: &Simulation, blocks| s.run(blocks, &AtomicBool::new(false), GO_ON);
    let (one, two) = (simulation(1), simulation(2));
    let (a, b) = (run(&one, 0..1), run(&two, 1..2));
    assert!(matches!(
        a.clone().merge(&b),
        Err(CannotMerge::OtherSimulation(..))
    ));
    let scalar = run(&one.clone().with_walk(Walk::Scalar), 1..2);
    assert!(matches!(
        a.clone().merge(&scalar),
        Err(CannotMerge::OtherSimulation(..))
    ));
    let same = a.clone().merge(&run(&one, 0..1)).unwrap_err();
    assert_eq!(same, CannotMerge::SamePhotons { block: 0 });
    let mut state = a.state();
    state.sums.pop();
    assert!(matches!(
        one.restore(state),
        Err(CannotMerge::Damaged { .. })
    ));
    let mut state = a.state();
    state.blocks = vec![(3, 2)];
    assert!(matches!(
        one.restore(state),
        Err(CannotMerge::Damaged { .. })
    ));
}

#[test]
fn an_interrupted_run_is_a_valid_smaller_one() {
    let simulation = simulation(4);
    let stop = AtomicBool::new(false);
    let tally = simulation.run(0..1 << 20, &stop, |tally| {
        // The next batch is abandoned at once.
        stop.store(tally.photons() > 0, Ordering::Relaxed);
        ControlFlow::Continue(())
    });
    assert!(tally.photons() > 0 && tally.energy_error().abs() < 1e-6);
    assert_eq!(tally.blocks().len(), 1);
    let stopped = simulation.run(0..10, &AtomicBool::new(true), GO_ON);
    assert_eq!(stopped.photons(), 0);
    assert_eq!(stopped.u(), f64::INFINITY);
}

#[test]
fn a_run_can_stop_at_a_standard_error() {
    let tally = simulation(5).run(0..1 << 20, &AtomicBool::new(false), |tally| {
        if tally.u() > 2e-3 {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    assert!(tally.u() <= 2e-3 && tally.u() > 2e-4, "{}", tally.u());
}

/// Twenty-four runs scatter about their mean as their standard errors say, also in far rings and for
/// absorption, to which a photon contributes many times.
#[test]
fn standard_errors_are_true() {
    let runs: Vec<_> = (100..140)
        .map(|seed| simulation(seed).run_photons(100_000).unwrap())
        .collect();
    let check = |what: &str, pick: &dyn Fn(&montecarlo::Tally) -> Estimate| {
        let all: Vec<Estimate> = runs.iter().map(pick).collect();
        let mean = all.iter().map(|e| e.value).sum::<f64>() / all.len() as f64;
        let scatter = all.iter().map(|e| (e.value - mean).powi(2)).sum::<f64>();
        let stated = all.iter().map(|e| e.u * e.u).sum::<f64>() / all.len() as f64;
        let p = p_value(scatter / stated, all.len() - 1);
        assert!(
            (1e-3..=0.999).contains(&p),
            "{what}: χ² = {}, p = {p}",
            scatter / stated
        );
    };
    check("R", &|t| t.reflectance());
    check("A", &|t| t.absorbed());
    for ring in [0, 5, 29] {
        check(&format!("ring {ring}"), &|t| {
            t.by_radius(Side::Above).bins[ring]
        });
    }
    for bin in 0..3 {
        check(&format!("depth {bin}"), &|t| {
            t.absorbed_by_depth().unwrap().bins[bin]
        });
    }
    check("roulette", &|t| t.roulette());
}

/// Light that the medium keeps for long is not cut short: with next to no absorption next to all
/// of it comes back, from slabs thousands of scatterings thick.
#[test]
fn survival_is_not_capped() {
    let layer = Layer {
        sigma_a: 0.0,
        sigma_s: 100.0,
        phase: Phase::ISOTROPIC,
        eta: 1.5,
        thickness_mm: Some(1.0),
    };
    let medium = LayeredMedium {
        layers: vec![layer],
        eta_above: 1.0,
        eta_below: 1.0,
    };
    let simulation = Simulation::new(medium, Incidence::PENCIL, &TallySpec::default(), 1).unwrap();
    let tally = simulation.run_photons(20_000).unwrap();
    let out = tally.specular().value + tally.reflectance().value + tally.transmittance().value;
    assert!((out - 1.0).abs() < 1e-8, "{out}");
}

#[test]
fn bad_input_is_named() {
    use InvalidLayers as Layers;
    use InvalidSimulation as Bad;
    let good = Layer {
        sigma_a: 0.1,
        sigma_s: 1.0,
        phase: Phase::ISOTROPIC,
        eta: 1.4,
        thickness_mm: Some(1.0),
    };
    let new = |layers: Vec<Layer>, spec: &TallySpec| {
        let medium = LayeredMedium {
            layers,
            eta_above: 1.0,
            eta_below: 1.0,
        };
        Simulation::new(medium, Incidence::PENCIL, spec, 1).map(|_| ())
    };
    let refused = |layer: Layer| new(vec![layer], &TallySpec::default()).unwrap_err();
    let no_medium = |layer: Layer| match refused(layer) {
        Bad::Layers(invalid) => invalid,
        other => panic!("{other:?}"),
    };
    let g = |g| Layer {
        phase: Phase::HenyeyGreenstein { g },
        ..good.clone()
    };
    let place = Place::Layer(1);
    assert_eq!(new(vec![good.clone()], &TallySpec::default()), Ok(()));
    assert_eq!(
        new(vec![], &TallySpec::default()),
        Err(Layers::NoLayer.into())
    );
    assert_eq!(
        no_medium(Layer {
            eta: 0.9,
            ..good.clone()
        }),
        Layers::Eta { place, eta: 0.9 }
    );
    assert_eq!(
        no_medium(g(1.0)),
        Layers::Phase {
            layer: 1,
            invalid: InvalidPhase::G(1.0)
        }
    );
    assert_eq!(
        no_medium(g(-1.0)),
        Layers::Phase {
            layer: 1,
            invalid: InvalidPhase::G(-1.0)
        }
    );
    let negative = Layer {
        sigma_a: -1.0,
        ..good.clone()
    };
    assert_eq!(
        no_medium(negative),
        Layers::SigmaA {
            layer: 1,
            sigma_a: -1.0
        }
    );
    let infinite = Layer {
        sigma_s: f64::INFINITY,
        ..good.clone()
    };
    assert_eq!(
        no_medium(infinite),
        Layers::SigmaS {
            layer: 1,
            sigma_s: f64::INFINITY
        }
    );
    let endless = Layer {
        thickness_mm: None,
        ..good.clone()
    };
    let clear = Layer {
        sigma_a: 0.0,
        sigma_s: 0.0,
        ..endless.clone()
    };
    assert_eq!(no_medium(clear), Layers::ClearEndless { layer: 1 });
    let white = Layer {
        sigma_a: 0.0,
        ..endless.clone()
    };
    assert_eq!(refused(white), Bad::LosslessEndless { layer: 1 });
    let flat = Layer {
        thickness_mm: Some(0.0),
        ..good.clone()
    };
    assert_eq!(
        no_medium(flat),
        Layers::Thickness {
            layer: 1,
            thickness_mm: 0.0
        }
    );
    let thin = Layer {
        thickness_mm: Some(1e-12),
        ..good.clone()
    };
    assert_eq!(
        refused(thin),
        Bad::TooThin {
            optical_thickness: 1e-12
        }
    );
    let dense = Layer {
        sigma_s: 1e9,
        ..good.clone()
    };
    assert!(matches!(refused(dense), Bad::TooDense { layer: 1, .. }));
    let below = new(vec![endless, good.clone()], &TallySpec::default());
    assert_eq!(
        below,
        Err(Layers::EndlessAbove {
            layer: 1,
            layers: 2
        }
        .into())
    );

    let bins = |radius_mm: Vec<f64>| {
        new(
            vec![good.clone()],
            &TallySpec {
                radius_mm,
                ..TallySpec::default()
            },
        )
    };
    assert!(matches!(
        bins(vec![0.0, 1.0, 1.0]),
        Err(Bad::Bins { bin: 2, .. })
    ));
    assert!(matches!(
        bins(vec![0.5, 1.0]),
        Err(Bad::Bins { bin: 1, .. })
    ));
    let huge = TallySpec {
        orders: usize::MAX,
        ..TallySpec::default()
    };
    assert!(matches!(
        new(vec![good], &huge),
        Err(Bad::TooManyCells { .. })
    ));

    assert_eq!(Simulation::blocks_for(0), Err(Bad::NoPhotons));
    assert!(matches!(
        Simulation::blocks_for(u64::MAX),
        Err(Bad::TooManyPhotons { .. })
    ));
    assert_eq!(Simulation::blocks_for(PHOTONS_PER_BLOCK + 1), Ok(0..2));
}
