//! The uncertainty budget: what each input adds to the uncertainty of σₐ and σₛ′.

use crate::conclude::SCALE;
use crate::result::{Estimate, Fit};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Degrees of freedom from which Student's distribution is the normal one to a percent of u.
const MANY: f64 = 200.0;
/// Two-sided 95 % of a normal variate, in standard deviations.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// One line of an uncertainty budget (JCGM 100, 8.1): an input, and the uncertainty of the
/// coefficients that comes from it alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Contribution {
    /// The input, as a person calls it.
    pub source: String,
    /// Standard uncertainty of σₐ that comes from it, mm⁻¹.
    pub u_sigma_a: f64,
    /// Standard uncertainty of σₛ′ that comes from it, mm⁻¹.
    pub u_sigma_s_prime: f64,
    /// Correlation of the two: ±1 for an input that is one number.
    pub correlation: f64,
    /// Degrees of freedom of the input's own uncertainty; infinite where that was stated.
    pub degrees_of_freedom: f64,
}

impl Contribution {
    /// Of an input that is one number: the signed change of the coefficients, mm⁻¹, for one
    /// standard uncertainty of it.
    pub fn of_change(source: impl Into<String>, in_sigma_a: f64, in_sigma_s_prime: f64) -> Self {
        Self {
            source: source.into(),
            u_sigma_a: in_sigma_a.abs(),
            u_sigma_s_prime: in_sigma_s_prime.abs(),
            correlation: if in_sigma_a * in_sigma_s_prime < 0.0 {
                -1.0
            } else {
                1.0
            },
            degrees_of_freedom: f64::INFINITY,
        }
    }

    /// The same input with the degrees of freedom that its uncertainty was estimated from.
    #[must_use]
    pub fn with_degrees_of_freedom(self, degrees_of_freedom: f64) -> Self {
        Self {
            degrees_of_freedom,
            ..self
        }
    }
}

/// Effective degrees of freedom of a sum of squares (Welch and Satterthwaite; JCGM 100, G.4.1).
fn effective_freedom(u_and_freedom: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (mut variance, mut denominator) = (0.0, 0.0);
    for (u, freedom) in u_and_freedom {
        variance += u * u;
        denominator += u.powi(4) / freedom;
    }
    if denominator > 0.0 {
        variance * variance / denominator
    } else {
        f64::INFINITY
    }
}

/// Half a 95 % interval over u.
pub(crate) fn coverage_factor(degrees_of_freedom: f64) -> f64 {
    if degrees_of_freedom >= MANY {
        return NORMAL_95;
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0))
        .map_or(NORMAL_95, |t| t.inverse_cdf(0.975))
}

impl Fit {
    /// The same fit with the line of the shared scale divided among its causes, of which each has
    /// a name and its own relative standard uncertainty.
    #[must_use]
    pub fn with_causes_of_scale(&self, causes: &[(&str, f64)]) -> Self {
        let whole = causes.iter().fold(0.0, |u: f64, c| u.hypot(c.1));
        let mut budget = vec![];
        for line in &self.budget {
            if line.source != SCALE || whole == 0.0 {
                budget.push(line.clone());
                continue;
            }
            for (source, u) in causes.iter().filter(|c| c.1 > 0.0) {
                budget.push(Contribution {
                    source: (*source).to_owned(),
                    u_sigma_a: line.u_sigma_a * u / whole,
                    u_sigma_s_prime: line.u_sigma_s_prime * u / whole,
                    ..line.clone()
                });
            }
        }
        Self {
            budget,
            ..self.clone()
        }
    }

    /// The same fit with the uncertainties of inputs that it took as exact added in quadrature
    /// (JCGM 100, 5.1.2), independent of each other and of what is in the budget already.
    #[must_use]
    pub fn with_contributions(&self, contributions: Vec<Contribution>) -> Self {
        let (a, s) = (&self.sigma_a, &self.sigma_s_prime);
        let (mut aa, mut ss) = (a.u * a.u, s.u * s.u);
        let mut mixed = self.correlation * a.u * s.u;
        for c in &contributions {
            aa += c.u_sigma_a * c.u_sigma_a;
            ss += c.u_sigma_s_prime * c.u_sigma_s_prime;
            mixed += c.correlation * c.u_sigma_a * c.u_sigma_s_prime;
        }
        let mut budget = self.budget.clone();
        budget.extend(contributions);
        let freedom_a =
            effective_freedom(budget.iter().map(|c| (c.u_sigma_a, c.degrees_of_freedom)));
        let freedom_s = effective_freedom(
            budget
                .iter()
                .map(|c| (c.u_sigma_s_prime, c.degrees_of_freedom)),
        );
        let widen = |e: &Estimate, u: f64, freedom: f64| {
            if e.u == 0.0 {
                return Estimate { u, ..*e };
            }
            let factor = u / e.u * coverage_factor(freedom) / coverage_factor(e.degrees_of_freedom);
            let (low, high) = e.ci95;
            Estimate {
                value: e.value,
                u,
                ci95: (
                    (e.value - (e.value - low) * factor).max(0.0),
                    e.value + (high - e.value) * factor,
                ),
                degrees_of_freedom: freedom,
            }
        };
        let (sigma_a, sigma_s_prime) = (
            widen(a, aa.sqrt(), freedom_a),
            widen(s, ss.sqrt(), freedom_s),
        );
        let grown = if a.u > 0.0 { sigma_a.u / a.u } else { 1.0 };
        Self {
            sigma_a,
            sigma_s_prime,
            correlation: if aa > 0.0 && ss > 0.0 {
                mixed / (aa * ss).sqrt()
            } else {
                0.0
            },
            upper_limit: self
                .upper_limit
                .map(|limit| a.value + (limit - a.value) * grown),
            budget,
            ..self.clone()
        }
    }
}
