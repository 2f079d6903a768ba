//! One set of profiles under every model that applies: `--model all`.

use crate::error::{Kind, Result};
use crate::fitting::{Given, model_curve};
use crate::library::{self, ModelChoice};
use fit::Fit;
use physics::RadialProfile;
use rayon::prelude::*;
use report::{CurvePoint, ModelReport};

/// What one model makes of every channel.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The model.
    pub model: ModelChoice,
    /// What the fit of each channel took as given, a g that it had to find among it, and the fit;
    /// or why there is none.
    pub outcome: std::result::Result<Vec<(Given, Fit)>, String>,
}

/// Fits with every model that `known` allows, the rest as `given` says; `fits` fits all channels.
///
/// A model that cannot be fitted says why in its place; it does not stop the others.
///
/// # Errors
///
/// An interruption, or a fault of ours.
pub fn compare(
    known: &ModelChoice,
    given: &Given,
    fits: impl Fn(&Given) -> Result<Vec<(Given, Fit)>> + Sync,
) -> Result<Vec<Compared>> {
    known
        .all(given.eta)
        .into_par_iter()
        .map(|model| {
            let given = Given {
                model: model.clone(),
                ..given.clone()
            };
            let outcome = match fits(&given) {
                Ok(fits) => Ok(fits),
                Err(e) if e.kind() == Kind::Input => Err(e.to_string()),
                Err(e) => return Err(e),
            };
            Ok(Compared { model, outcome })
        })
        .collect()
}

impl Compared {
    /// Name of the model.
    pub fn name(&self) -> &str {
        &self.model.name
    }

    /// The fit of each channel with what it took as given; none where the model was not fitted.
    pub fn fits(&self) -> &[(Given, Fit)] {
        self.outcome.as_deref().unwrap_or_default()
    }

    /// The model's total over the whole plane, per power that enters, of each fitted channel.
    ///
    /// # Errors
    ///
    /// None: the model was made before.
    pub fn totals(&self) -> Result<Vec<f64>> {
        let total = |(given, fit): &(Given, Fit)| {
            let model = library::model(&given.model, given.eta)?;
            Ok(model.beyond(fit.coefficients(), 0.0))
        };
        self.fits().iter().map(total).collect()
    }

    /// What the report shows of the model for channel `index`, whose data are `profile`.
    ///
    /// # Errors
    ///
    /// None: the model was made before.
    pub(crate) fn report(
        &self,
        index: usize,
        profile: &RadialProfile,
    ) -> Result<Option<ModelReport<'_>>> {
        let Some((given, fit)) = self.fits().get(index) else {
            return Ok(None);
        };
        let curve = model_curve(profile, fit, given)?
            .into_iter()
            .map(|(radius_mm, reflectance_per_mm2)| CurvePoint {
                radius_mm,
                reflectance_per_mm2,
            })
            .collect();
        Ok(Some(ModelReport {
            name: self.name(),
            fit,
            curve,
            total_reflectance: self.totals()?.get(index).copied().unwrap_or(0.0),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fitting::{ScaleInput, fit_channel};
    use crate::library::SlabChoice;
    use crate::unknown_g::settled;
    use fit::{Constraint, Warning};
    use physics::{Coefficients, ForwardModel, ObliqueBeam, ProfilePoint, TotalReflectance};

    /// `values` at `radii`, with so much noise.
    fn profile(radii: &[f64], values: &[f64], u_relative: f64) -> RadialProfile {
        let points = radii.iter().zip(values);
        let points = points.map(|(&radius_mm, &value)| ProfilePoint {
            ring_mm: None,
            radius_mm,
            reflectance_per_mm2: value,
            u_reflectance_per_mm2: u_relative * value,
            pixels: None,
        });
        RadialProfile {
            channel: "Y".to_owned(),
            points: points.collect(),
        }
    }

    /// Every model finds its own medium among the fits of all, under each constraint: also the one
    /// whose thickness has a scale, and the oblique one.
    #[test]
    fn each_model_finds_its_own_medium() {
        let known = ModelChoice {
            g: Some(0.7),
            slab: Some(SlabChoice {
                thickness_mm: 4.0,
                eta_below: Some(1.0),
            }),
            beam: ObliqueBeam {
                angle: 0.7,
                center_mm: 0.0,
            },
            ..ModelChoice::default()
        };
        let truth = Coefficients {
            sigma_a: 0.05,
            sigma_s_prime: 1.3,
        };
        let radii: Vec<f64> = (0..40).map(|i| 0.3 * 1.1_f64.powi(i)).collect();
        for constraint in [Constraint::Exact, Constraint::Joint, Constraint::None] {
            let given = Given {
                discrepancy: false,
                constraint,
                range_mm: Some((1.0, 15.0)),
                entry_loss: false,
                ..Given::of(known.called("dipole"), 1.4)
            };
            let of_itself = |given: &Given| {
                let model = library::model(&given.model, given.eta)?;
                let mut values = vec![0.0; radii.len()];
                model.diffuse_reflectance(truth, &radii, &mut values);
                let profile = profile(&radii, &values, 1e-3);
                let total = TotalReflectance {
                    channel: "Y".to_owned(),
                    total_reflectance: model.within(truth, f64::INFINITY).value,
                    u_total_reflectance: 1e-3,
                    radius_max_mm: None,
                    u_scale_relative: 0.0,
                    u_offset_per_mm2: 0.0,
                };
                let scale: [ScaleInput; 0] = [];
                let fit = fit_channel(&profile, Some(&total), &scale, given)?;
                Ok(vec![(given.clone(), fit)])
            };
            let compared = compare(&known, &given, of_itself).unwrap();
            assert_eq!(compared.len(), 8);
            for model in compared {
                let (_, fit) = &model.outcome.as_ref().unwrap()[0];
                let error_a = fit.sigma_a.value / truth.sigma_a - 1.0;
                let error_s = fit.sigma_s_prime.value / truth.sigma_s_prime - 1.0;
                assert!(
                    error_a.abs() < 1e-5 && error_s.abs() < 1e-5,
                    "{} {constraint:?}: {error_a:e} {error_s:e} {:?}",
                    model.name(),
                    fit.termination
                );
            }
        }
    }

    /// Ink: every closed form warns of it, and transport, which is not told g, does not.
    #[test]
    fn only_closed_forms_complain_of_a_dark_medium() {
        let truth = Coefficients {
            sigma_a: 0.7,
            sigma_s_prime: 0.3,
        };
        let light = transport::TransportModel::new(1.4, 0.8).unwrap();
        let radii: Vec<f64> = (0..30).map(|i| 0.3 * 1.1_f64.powi(i)).collect();
        let mut values = vec![0.0; radii.len()];
        light.diffuse_reflectance(truth, &radii, &mut values);
        let profile = profile(&radii, &values, 1e-2);
        let known = ModelChoice::default();
        let given = Given {
            discrepancy: false,
            entry_loss: false,
            ..Given::of(known.clone(), 1.4)
        };
        let all = compare(&known, &given, |given| {
            let given = settled(&profile, None, &[], given)?;
            let fit = fit_channel(&profile, None, &[], &given)?;
            Ok(vec![(given, fit)])
        });
        let mut warned = vec![];
        for model in all.unwrap() {
            let [(given, fit)] = model.fits() else {
                panic!("{model:?}");
            };
            let dark =
                |w: &Warning| matches!(w, Warning::LowAlbedo { .. } | Warning::StartsNear { .. });
            warned.push((model.name().to_owned(), fit.warnings.iter().any(dark)));
            assert_eq!(given.fitted_g().is_some(), model.name() == "monte-carlo");
        }
        assert_eq!(warned.len(), 7);
        for (name, warned) in warned {
            assert_eq!(warned, name != "monte-carlo", "{name}");
        }
    }
}
