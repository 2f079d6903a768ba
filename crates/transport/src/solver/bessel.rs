//! Modified Bessel functions of complex argument.

use nalgebra::Complex;

/// K₀ and K₁ of `w`, each times e^`scale`, for |arg w| up to π/4 and a little.
///
/// The trapezoidal rule for ∫e^(−w cosh u) cosh νu du converges like e^(−2π·(π/4)/step).
pub(crate) fn k0_k1(w: Complex<f64>, scale: f64) -> (Complex<f64>, Complex<f64>) {
    const STEP: f64 = 0.16;
    let (mut k0, mut k1) = (Complex::default(), Complex::default());
    for i in 0.. {
        let cosh = (STEP * f64::from(i)).cosh();
        let weight = if i == 0 { 0.5 * STEP } else { STEP };
        let term = (-w * cosh + scale).exp() * weight;
        k0 += term;
        k1 += term * cosh;
        if w.re * (cosh - 1.0) > 40.0 {
            break;
        }
    }
    (k0, k1)
}
