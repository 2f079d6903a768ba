//! A mean cosine g of the scattering angle that nobody knows: fitted along.
//!
//! Transport needs g, which shapes the profile within some transport lengths of the beam. Where it
//! is not given, every g from 0 to the table's largest is as likely as any other, evenly in
//! −ln(1 − g): each is tried, and weighs by how well its best fit agrees with the data. The g on
//! average is taken, and the fits of the others, by their weights, become a line of the budget.
//! Data that say nothing of g then leave it wide open, and the coefficients with it as far as
//! they hang on it.

use crate::error::{Blame, Result};
use crate::fitting::{Change, Given, ScaleInput, Variant};
use physics::{Footprints, ForwardModel, RadialProfile, TotalReflectance};
use std::sync::Arc;
use transport::TransportFamily;

/// The line of the budget.
const SOURCE: &str = "g, fitted along";
/// The mean cosine that stands in until the data have spoken: tissue's and milk's.
pub(crate) const STAND_IN: f64 = 0.8;
/// Values of g tried at once; where they lie too far apart for the data, once more between those
/// that are left.
const TRIED: usize = 13;
/// χ² above the least from which a g is out: its weight is 1e-4.
const OUT: f64 = 18.0;
/// Rounds of looking closer. Six times narrower each, the third tells g to 1e-3.
const ROUNDS: usize = 4;

/// `given` for one channel, with a g that its data bear out where none is known and the model
/// needs one.
///
/// # Errors
///
/// η is outside the table, or no g gives a fit.
pub fn settled(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    scale: &[ScaleInput],
    given: &Given,
) -> Result<Given> {
    if !given.model.lacks_g() {
        return Ok(given.clone());
    }
    let family = TransportFamily::new(given.eta).input("model monte-carlo")?;
    let u_scale = given.u_scale(scale);
    // One range for every g, or their χ² would not compare.
    let mut options = given.options(u_scale);
    let first = family.at(STAND_IN).input("model monte-carlo")?;
    let start = fit::fit(profile, total, &first, &options)?;
    options.range_mm = Some(start.range_mm);
    options.footprints = Some(Arc::new(Footprints::new(&profile.points, &given.blur())));
    // The table's own error near the beam must not be taken for news of g.
    let mut profile = profile.clone();
    for p in &mut profile.points {
        let own = first.relative_error(start.coefficients(), p.radius_mm);
        let own = own * p.reflectance_per_mm2.abs();
        p.u_reflectance_per_mm2 = p.u_reflectance_per_mm2.hypot(own);
    }
    let chi2_at = |forwardness: f64| {
        let g = 1.0 - (-forwardness).exp();
        let model = family.at(g).ok()?;
        let fit = fit::fit(&profile, total, &model, &options).ok()?;
        let freedom = fit.residuals.len().saturating_sub(2).max(1) as f64;
        Some((fit.reduced_chi2 * freedom, fit.reduced_chi2))
    };
    let (mut low, mut high) = (0.0, -(1.0 - family.range().1).ln());
    let mut weighed: Vec<(f64, f64)> = vec![];
    for round in 1..=ROUNDS {
        let step = (high - low) / (TRIED - 1) as f64;
        let tried: Vec<(f64, f64, f64)> = (0..TRIED)
            .map(|i| low + step * i as f64)
            .filter_map(|x| chi2_at(x).map(|(chi2, reduced)| (x, chi2, reduced)))
            .collect();
        let Some(best) = tried.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)) else {
            break;
        };
        // Noise that was stated too small says as little of g as of anything else.
        let widened = best.2.max(1.0);
        weighed = tried
            .into_iter()
            .map(|(x, chi2, _)| (x, (chi2 - best.1) / widened))
            .filter(|(_, above)| *above < OUT)
            .collect();
        if weighed.len() > TRIED / 2 || round == ROUNDS {
            break;
        }
        let (first, last) = (weighed[0].0, weighed[weighed.len() - 1].0);
        (low, high) = ((first - step).max(low), (last + step).min(high));
    }
    let all: f64 = weighed.iter().map(|(_, above)| (-0.5 * above).exp()).sum();
    let weights = || {
        weighed
            .iter()
            .map(|(x, above)| (1.0 - (-x).exp(), (-0.5 * above).exp() / all))
    };
    let mut given = given.clone();
    given.model.g = Some(if weighed.is_empty() {
        STAND_IN
    } else {
        weights().map(|(g, weight)| g * weight).sum()
    });
    given.variants.extend(weights().map(|(g, weight)| Variant {
        name: SOURCE,
        weight: weight.sqrt(),
        change: Change::G(g),
    }));
    Ok(given)
}

impl Given {
    /// The g that was fitted along, drawn by the weights that the data gave it: that of the share
    /// `place` of them, 0 to 1. `None` where none was.
    pub(crate) fn drawn_g(&self, place: f64) -> Option<f64> {
        let mut left = place;
        let mut last = None;
        for v in &self.variants {
            let Change::G(g) = v.change else { continue };
            last = Some(g);
            left -= v.weight * v.weight;
            if left < 0.0 {
                break;
            }
        }
        last
    }

    /// The same as before its g was fitted along.
    pub(crate) fn unsettled(&self) -> Self {
        let mut given = self.clone();
        if self.fitted_g().is_some() {
            given.model.g = None;
            given.variants.retain(|v| !matches!(v.change, Change::G(_)));
        }
        given
    }

    /// The g that was fitted along, and its standard uncertainty; `None` where it was given, or
    /// no model needs it.
    pub fn fitted_g(&self) -> Option<(f64, f64)> {
        let value = self.model.g?;
        let squares: Vec<f64> = (self.variants.iter())
            .filter_map(|v| match v.change {
                Change::G(g) => Some((v.weight * (g - value)).powi(2)),
                Change::Beam(_) => None,
            })
            .collect();
        (!squares.is_empty()).then(|| (value, squares.iter().sum::<f64>().sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bootstrap::Channel;
    use crate::fitting::fit_channel;
    use crate::library::ModelChoice;
    use fit::Fit;
    use physics::{Coefficients, ProfilePoint};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;
    use transport::TransportModel;

    const ETA: f64 = 1.4;
    const TRUTH: Coefficients = Coefficients {
        sigma_a: 0.03,
        sigma_s_prime: 1.2,
    };

    /// Transport at `g` with 0.3 % of noise, and what is given from `start_mm` on without g.
    fn seen(g: f64, start_mm: f64, seed: u64) -> (RadialProfile, Given) {
        let model = TransportModel::new(ETA, g).unwrap();
        let radii: Vec<f64> = (0..60).map(|i| 0.1 * 1.1_f64.powi(i)).collect();
        let mut values = vec![0.0; radii.len()];
        model.diffuse_reflectance(TRUTH, &radii, &mut values);
        let mut rng = Pcg64::seed_from_u64(seed);
        let points = radii.iter().zip(&values).map(|(&radius_mm, &value)| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let u = 3e-3 * value;
            ProfilePoint {
                ring_mm: None,
                radius_mm,
                reflectance_per_mm2: value + u * noise,
                u_reflectance_per_mm2: u,
                pixels: None,
            }
        });
        let profile = RadialProfile {
            channel: "Y".to_owned(),
            points: points.collect(),
        };
        let model = ModelChoice {
            name: "monte-carlo".to_owned(),
            ..ModelChoice::default()
        };
        let given = Given {
            range_mm: Some((start_mm, 30.0)),
            entry_loss: false,
            ..Given::of(model, ETA)
        };
        (profile, given)
    }

    /// What a fit makes of that.
    fn found(g: f64, start_mm: f64, seed: u64) -> (Given, Fit) {
        let (profile, given) = seen(g, start_mm, seed);
        let given = settled(&profile, None, &[], &given).unwrap();
        let fit = fit_channel(&profile, None, &[], &given).unwrap();
        (given, fit)
    }

    /// Replicas find g again, so that their spread holds what the budget says of it.
    #[test]
    fn replicas_draw_g_and_find_it_again() {
        let (profile, given) = seen(0.7, 3.0, 3);
        let given = settled(&profile, None, &[], &given).unwrap();
        let fit = fit_channel(&profile, None, &[], &given).unwrap();
        let channel = Channel {
            profile: &profile,
            total: None,
            scale: &[],
            given: &given,
        };
        let medium = fit.coefficients();
        let spread = channel.bootstrap(medium, 60, 1).unwrap();
        let told = Given {
            variants: vec![],
            ..given.clone()
        };
        let channel = Channel {
            given: &told,
            ..channel
        };
        let narrow = channel.bootstrap(medium, 60, 1).unwrap();
        // 60 replicas tell a standard deviation to 9 %; three of those.
        let ratio = spread.u_sigma_s_prime_per_mm / fit.sigma_s_prime.u;
        assert!((ratio - 1.0).abs() < 0.27, "{ratio}: {spread:?} {fit:?}");
        let ratio = spread.u_sigma_a_per_mm / fit.sigma_a.u;
        assert!((ratio - 1.0).abs() < 0.27, "{ratio}: {spread:?} {fit:?}");
        // Here most of it comes from g.
        let ratio = narrow.u_sigma_s_prime_per_mm / spread.u_sigma_s_prime_per_mm;
        assert!(ratio < 0.7, "{ratio}: {narrow:?} {spread:?}");
    }

    /// Where radii reach near the beam, the data tell g; where they start far out they do not,
    /// which the uncertainty knows. Both ways the intervals hold the truth.
    #[test]
    fn data_that_know_g_tell_it_and_others_admit_that_they_do_not() {
        let mut far_u = vec![];
        for (case, g) in [0.0, 0.6, 0.9].into_iter().enumerate() {
            for (start_mm, near) in [(0.3, true), (12.0, false)] {
                let (given, fit) = found(g, start_mm, case as u64);
                let (value, u) = given.fitted_g().unwrap();
                let z = [
                    (value - g) / u,
                    (fit.sigma_a.value - TRUTH.sigma_a) / fit.sigma_a.u,
                    (fit.sigma_s_prime.value - TRUTH.sigma_s_prime) / fit.sigma_s_prime.u,
                ];
                let label = format!(
                    "g {g} from {start_mm} mm: {value:.3} +- {u:.3}, sigma_a {:?}, z {z:.2?}",
                    fit.sigma_a
                );
                println!("{label}");
                assert!(z.iter().all(|z| z.abs() < 3.5), "{label}");
                assert!(fit.budget.iter().any(|l| l.source == SOURCE), "{label}");
                if near {
                    assert!(u < 0.05, "{label}");
                } else {
                    far_u.push(u);
                }
            }
        }
        // Even from 0 to 0.95 has a standard deviation of 0.27 in g.
        assert!(far_u.iter().all(|u| *u > 0.1), "{far_u:?}");
    }

    #[test]
    fn a_g_that_is_known_is_left_alone() {
        let (given, _) = found(0.8, 1.0, 1);
        let told = Given {
            model: ModelChoice {
                g: Some(0.5),
                ..given.model.clone()
            },
            variants: vec![],
            ..given
        };
        let profile = RadialProfile {
            channel: "Y".to_owned(),
            points: vec![],
        };
        assert_eq!(settled(&profile, None, &[], &told).unwrap(), told);
        assert_eq!(told.fitted_g(), None);
    }
}
