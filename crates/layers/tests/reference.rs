//! Against `fixtures/monte-carlo/adding-doubling.csv`.

use layers::solve;
use physics::{Layer, LayeredMedium, Phase};

#[test]
fn every_row_of_the_table() {
    let table = include_str!("../../../fixtures/monte-carlo/adding-doubling.csv");
    for line in table.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |k: usize| fields[k].parse::<f64>().unwrap();
        let list = |k: usize| fields[k].split(';').map(|n| n.parse::<f64>().unwrap());
        let layers = list(1)
            .zip(list(2))
            .zip(list(3))
            .map(|((albedo, tau), g)| Layer {
                sigma_a: 1.0 - albedo,
                sigma_s: albedo,
                phase: Phase::HenyeyGreenstein { g },
                eta: number(4),
                thickness_mm: (tau < 1e5).then_some(tau),
            })
            .collect();
        let medium = LayeredMedium {
            layers,
            eta_above: 1.0,
            eta_below: 1.0,
        };
        let clock = std::time::Instant::now();
        let got = solve(&medium, &[number(7)], &[]).unwrap();
        let ms = clock.elapsed().as_secs_f64() * 1e3;
        let [r, t] = [
            got.reflectance[0] - number(8),
            got.transmittance[0] - number(9),
        ];
        println!("{:24} R {r:+.1e} T {t:+.1e}  {ms:.1} ms", fields[0]);
        assert!(r.abs() < 2e-5 && t.abs() < 2e-5, "{line}: {got:?}");
    }
}
