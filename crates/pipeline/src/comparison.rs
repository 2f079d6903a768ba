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
    /// What the fits took as given, the model among it.
    pub given: Given,
    /// The fit of each channel, or why there is none.
    pub outcome: std::result::Result<Vec<Fit>, String>,
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
    fits: impl Fn(&Given) -> Result<Vec<Fit>> + Sync,
) -> Result<Vec<Compared>> {
    known
        .all(given.eta)
        .into_par_iter()
        .map(|model| {
            let given = Given {
                model,
                ..given.clone()
            };
            let outcome = match fits(&given) {
                Ok(fits) => Ok(fits),
                Err(e) if e.kind() == Kind::Input => Err(e.to_string()),
                Err(e) => return Err(e),
            };
            Ok(Compared { given, outcome })
        })
        .collect()
}

impl Compared {
    /// Name of the model.
    pub fn name(&self) -> &str {
        &self.given.model.name
    }

    /// The model's total over the whole plane, per power that enters, of each fitted channel.
    ///
    /// # Errors
    ///
    /// None: the model was made before.
    pub fn totals(&self) -> Result<Vec<f64>> {
        let model = library::model(&self.given.model, self.given.eta)?;
        let fits = self.outcome.as_deref().unwrap_or_default();
        Ok(fits
            .iter()
            .map(|fit| model.beyond(fit.coefficients(), 0.0))
            .collect())
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
        let Some(fit) = self.outcome.as_deref().ok().and_then(|f| f.get(index)) else {
            return Ok(None);
        };
        let curve = model_curve(profile, fit, &self.given)?
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
