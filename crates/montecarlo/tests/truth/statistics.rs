//! Small statistics for comparisons.

/// Probability of a χ² at least as large with `degrees` degrees of freedom.
///
/// Wilson and Hilferty's cube root, good to a few per cent of p where p is above 1e-4.
pub(crate) fn p_value(chi_square: f64, degrees: usize) -> f64 {
    let k = degrees as f64;
    let v = 2.0 / (9.0 * k);
    upper_tail(((chi_square / k).cbrt() - (1.0 - v)) / v.sqrt())
}

/// Probability of a normal deviate above `z`.
fn upper_tail(z: f64) -> f64 {
    // The integral of the density by Simpson's rule, far beyond the precision needed here.
    let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let (low, high) = (z.clamp(-8.0, 8.0), 9.0);
    let n = 2000;
    let step = (high - low) / f64::from(n);
    let sum: f64 = (0..=n)
        .map(|k| {
            let weight = match k {
                0 => 1.0,
                _ if k == n => 1.0,
                _ if k % 2 == 1 => 4.0,
                _ => 2.0,
            };
            weight * density(low + f64::from(k) * step)
        })
        .sum();
    sum * step / 3.0
}

#[test]
fn p_values_of_tables() {
    for (chi_square, degrees, p) in [(18.307, 10, 0.05), (76.154, 50, 0.01), (40.0, 40, 0.4703)] {
        let got = p_value(chi_square, degrees);
        assert!(
            (got / p - 1.0).abs() < 0.02,
            "{chi_square} of {degrees}: {got} for {p}"
        );
    }
}
