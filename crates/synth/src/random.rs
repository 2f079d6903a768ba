//! The distributions of a sensor's noise.

use physics::random::uniform;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::PI;

/// A draw from the standard normal distribution.
pub(crate) fn normal(rng: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(rng)
}

/// Where rejection becomes cheaper than a search; it needs at least 10.
const REJECTION_FROM: f64 = 12.0;

/// A draw from the Poisson distribution of this `mean`, exact at any mean from 0 to 1e9.
///
/// `rand_distr` has the same distribution, but sets it up anew for every mean, which for a
/// picture, where every pixel has its own, costs more than the draw.
pub(crate) fn poisson(rng: &mut Pcg64Mcg, mean: f64) -> f64 {
    if mean < REJECTION_FROM {
        poisson_by_search(rng, mean)
    } else {
        poisson_by_rejection(rng, mean)
    }
}

/// Most that a search counts to: beyond, at a mean of 12, lies less than a draw can resolve.
const SEARCH_TO: usize = 80;

/// 1/k, as a division in the loop would take longer than all else in it.
const RECIPROCALS: [f64; SEARCH_TO + 1] = {
    let mut table = [0.0; SEARCH_TO + 1];
    let mut k = 1;
    while k <= SEARCH_TO {
        table[k] = 1.0 / k as f64;
        k += 1;
    }
    table
};

/// Inversion: counts up from 0 until the cumulative probability passes one even draw.
fn poisson_by_search(rng: &mut Pcg64Mcg, mean: f64) -> f64 {
    let mut rest = uniform(rng);
    let mut probability = (-mean).exp();
    let mut count = 0;
    while rest >= probability && count < SEARCH_TO {
        rest -= probability;
        count += 1;
        probability *= mean * RECIPROCALS[count];
    }
    count as f64
}

/// Transformed rejection, algorithm PTRS of Hörmann (1993).
fn poisson_by_rejection(rng: &mut Pcg64Mcg, mean: f64) -> f64 {
    let b = 0.931 + 2.53 * mean.sqrt();
    let a = -0.059 + 0.02483 * b;
    let squeeze = 0.9277 - 3.6224 / (b - 2.0);
    loop {
        let u = uniform(rng) - 0.5;
        let v = uniform(rng);
        let us = 0.5 - u.abs();
        let real = (2.0 * a / us + b) * u + mean + 0.43;
        if real < 0.0 {
            continue;
        }
        // Rounds down like `floor`, which many processors' baseline leaves to a library call.
        let count = real as u64 as f64;
        if us >= 0.07 && v <= squeeze {
            return count;
        }
        if us < 0.013 && v > us {
            continue;
        }
        let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
        let density = (v * inverse_alpha / (a / (us * us) + b)).ln();
        if density <= count * mean.ln() - mean - ln_factorial(count) {
            return count;
        }
    }
}

/// ln `count`!, to 1e-9 (Stirling's series; the first few by multiplication).
fn ln_factorial(count: f64) -> f64 {
    if count < 12.0 {
        let factors = (2..=count as u64).map(|k| k as f64);
        return factors.product::<f64>().ln();
    }
    let inverse = 1.0 / count;
    let square = inverse * inverse;
    (count + 0.5) * count.ln() - count
        + 0.5 * (2.0 * PI).ln()
        + inverse * (1.0 / 12.0 - square * (1.0 / 360.0 - square / 1260.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::random::stream;

    #[test]
    fn factorials_are_sums_of_logarithms() {
        let mut sum = 0.0;
        for count in 1..=300 {
            sum += f64::from(count).ln();
            let got = ln_factorial(f64::from(count));
            assert!((got - sum).abs() < 2e-9, "{count}: {got} for {sum}");
        }
        assert_eq!(ln_factorial(0.0), 0.0);
    }

    /// Pearson's χ² of draws against the probabilities, in standard deviations from its mean.
    fn chi_square_excess(mean: f64, draws: usize) -> f64 {
        let mut rng = stream(7, &[mean.to_bits()]);
        let top = (mean + 12.0 * mean.sqrt() + 20.0) as usize;
        let mut counts = vec![0.0; top + 1];
        for _ in 0..draws {
            counts[(poisson(&mut rng, mean) as usize).min(top)] += 1.0;
        }
        let (mut chi2, mut cells) = (0.0, 0.0);
        let (mut pooled, mut pooled_expected) = (0.0, 0.0);
        let mut ln_count = 0.0;
        for (count, observed) in counts.iter().enumerate() {
            if count > 0 {
                ln_count += (count as f64).ln();
            }
            let expected = draws as f64 * (count as f64 * mean.ln() - mean - ln_count).exp();
            // Rare counts are pooled, as χ² wants some in every cell.
            if expected < 20.0 {
                pooled += observed;
                pooled_expected += expected;
            } else {
                chi2 += (observed - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        if pooled_expected > 5.0 {
            chi2 += (pooled - pooled_expected).powi(2) / pooled_expected;
            cells += 1.0;
        }
        let freedom: f64 = cells - 1.0;
        (chi2 - freedom) / (2.0 * freedom.max(1.0)).sqrt()
    }

    #[test]
    fn draws_follow_the_distribution() {
        for mean in [0.02, 0.7, 4.0, 11.9, 12.1, 30.0, 250.0, 3000.0] {
            let excess = chi_square_excess(mean, 1_000_000);
            assert!(excess.abs() < 4.5, "mean {mean}: {excess} sigma");
        }
    }

    #[test]
    fn mean_and_variance_are_the_mean() {
        for mean in [0.3, 11.0, 13.0, 900.0, 25_000.0, 4e6] {
            let mut rng = stream(11, &[mean as u64]);
            let draws = 2_000_000;
            let (mut first, mut second) = (0.0, 0.0);
            for _ in 0..draws {
                let d = poisson(&mut rng, mean) - mean;
                first += d;
                second += d * d;
            }
            let n = f64::from(draws);
            let (bias, variance) = (first / n, second / n);
            assert!(
                bias.abs() < 4.5 * (mean / n).sqrt(),
                "{mean}: off by {bias}"
            );
            // The variance of a squared deviation is 2·mean² + mean.
            let spread = ((2.0 + 1.0 / mean) / n).sqrt();
            assert!(
                (variance / mean - 1.0).abs() < 4.5 * spread,
                "{mean}: variance {variance}"
            );
        }
        assert_eq!(poisson(&mut stream(1, &[]), 0.0), 0.0);
    }
}
