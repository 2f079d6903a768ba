//! All 36 channels of Jensen's table, photographed, measured and compared with what made them.

use fit::{Fit, Termination};
use physics::Coefficients;
use pipeline::measure::{Choices, measure};
use pipeline::{Silent, capture, library, synthesis};

/// One measured number beside the truth.
struct Recovered {
    label: String,
    truth: f64,
    value: f64,
    u: f64,
}

impl Recovered {
    fn in_u(&self) -> f64 {
        (self.value - self.truth) / self.u
    }

    fn relative(&self) -> f64 {
        (self.value / self.truth - 1.0).abs()
    }
}

fn photograph_and_measure(material: &str, seed: u64) -> Vec<(Coefficients, Fit)> {
    let folder = tempfile::tempdir().unwrap();
    let sample = synthesis::sample_of(material).unwrap();
    let camera = synth::Camera::default();
    let target = folder.path().join("capture");
    let manifest = synthesis::write(
        &sample,
        camera,
        &library::ModelChoice::default(),
        seed,
        &target,
        false,
        &Silent,
    )
    .unwrap();
    let loaded = capture::load(&manifest).unwrap();
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    let measurement = measure(&loaded, &choices, &Silent).unwrap();
    sample
        .channels
        .iter()
        .map(|(_, c)| *c)
        .zip(measurement.fits)
        .collect()
}

#[test]
fn all_36_channels_come_back_with_true_uncertainties() {
    let seed = std::env::var("BEAMSPOT_SEED").map_or(1, |s| s.parse().unwrap());
    let mut names: Vec<String> = library::materials()
        .iter()
        .map(|m| m.material.clone())
        .collect();
    names.dedup();
    assert_eq!(names.len(), 12);
    let mut numbers = vec![];
    for (index, name) in names.iter().enumerate() {
        for (truth, fit) in photograph_and_measure(name, 100 * seed + index as u64) {
            let label = format!("{name} {}", fit.channel);
            if truth.sigma_a == 0.0 {
                let limit = fit
                    .upper_limit
                    .expect("absorption that is not there has a limit");
                println!("{label:14} sigma_a  < {limit:.1e}  {:?}", fit.termination);
                assert!(
                    fit.sigma_a.ci95.0 == 0.0 && limit < 1e-3,
                    "{label}: {fit:?}"
                );
            } else {
                let (value, u) = (fit.sigma_a.value, fit.sigma_a.u);
                let label = format!("{label:14} sigma_a ");
                numbers.push(Recovered {
                    label,
                    truth: truth.sigma_a,
                    value,
                    u,
                });
                assert_eq!(fit.termination, Termination::Converged, "{fit:?}");
            }
            let (value, u) = (fit.sigma_s_prime.value, fit.sigma_s_prime.u);
            let label = format!("{label:14} sigma_s'");
            numbers.push(Recovered {
                label,
                truth: truth.sigma_s_prime,
                value,
                u,
            });
        }
    }
    assert_eq!(numbers.len(), 69);
    for n in &numbers {
        println!(
            "{} true {:<8} found {:.6} u {:.1e}  {:+.3} %  {:+.2} u",
            n.label,
            n.truth,
            n.value,
            n.u,
            100.0 * (n.value / n.truth - 1.0),
            n.in_u()
        );
    }
    let within = |limit: f64| numbers.iter().filter(|n| n.in_u().abs() <= limit).count();
    let mut errors: Vec<f64> = numbers.iter().map(Recovered::relative).collect();
    errors.sort_by(f64::total_cmp);
    let (one, three, median) = (within(1.0), within(3.0), errors[34]);
    println!("within 1 u: {one}, within 3 u: {three}, median relative error {median:.2e}");
    assert!(three >= 67, "{three} of 69 within 3 u");
    // 47 are expected; two numbers of a channel err together (their correlation is 0.6 in the mean),
    // so that the count scatters by 4.4 and not by 3.9. Two and a half of those.
    assert!((36..=58).contains(&one), "{one} of 69 within 1 u");
    assert!(median < 0.01, "median relative error {median}");
}
