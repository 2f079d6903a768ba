//! A modified Bessel function: what a round Gaussian leaves on a circle about another point.

use std::f64::consts::{PI, SQRT_2};

/// e^(−x) I₀(x) for x ≥ 0, to 1e-13: the power series, then the asymptotic one.
pub fn scaled_bessel_i0(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    if x < 16.0 {
        let quarter = 0.25 * x * x;
        for k in 1..80 {
            term *= quarter / f64::from(k * k);
            sum += term;
            if term < 1e-16 * sum {
                break;
            }
        }
        sum * (-x).exp()
    } else {
        for k in 1..32 {
            let odd = f64::from(2 * k - 1);
            term *= odd * odd / (8.0 * f64::from(k) * x);
            sum += term;
            if term < 1e-16 {
                break;
            }
        }
        sum / (SQRT_2 * (PI * x).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_series_of_the_bessel_function_are_its_integral() {
        for x in [0.0_f64, 0.5, 3.0, 15.99, 16.01, 90.0] {
            // The trapezoidal rule over a period is exact to rounding.
            let steps = 400;
            let integral: f64 = (0..steps)
                .map(|i| (x * ((2.0 * PI * f64::from(i) / f64::from(steps)).cos() - 1.0)).exp())
                .sum::<f64>()
                / f64::from(steps);
            let got = scaled_bessel_i0(x);
            assert!((got / integral - 1.0).abs() < 1e-12, "{x}: {got}");
        }
    }
}
