//! `fit.json`: the fits of a capture, for other programs.

use crate::beam::{BeamDocument, ChosenBeam};
use crate::bootstrap::Bootstrap;
use crate::capture::Input;
use crate::comparison::Compared;
use crate::confirm::Confirmation;
use crate::stray::{Veil, VeilDocument};
use crate::verdict::Verdict;
use fit::{Constraint, Contribution, Estimate, Fit, Termination};
use serde::{Deserialize, Serialize};

/// Version of the layout of every JSON document that beamspot writes.
pub const SCHEMA_VERSION: u32 = 1;

/// A whole `fit.json`.
#[derive(Clone, Debug, Serialize)]
pub struct FitDocument {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Version of beamspot.
    pub beamspot_version: &'static str,
    /// The files that the numbers come from, with their hashes.
    pub inputs: Vec<InputHash>,
    /// Name of the material, where it is known.
    pub material: Option<String>,
    /// Relative index.
    pub eta: f64,
    /// Name of the model.
    pub model: String,
    /// Name of the constraint.
    pub constraint: &'static str,
    /// What was assumed where nothing was stated.
    pub assumptions: Vec<String>,
    /// What was left out on the way, and why.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// What a user should know of the measurement as a whole.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The channels.
    pub channels: Vec<Channel>,
    /// The same channels under every model that applies, where that was asked.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<Model>,
}

/// What one model makes of the channels.
#[derive(Clone, Debug, Serialize)]
pub struct Model {
    model: String,
    g: Option<f64>,
    /// g of each channel with its standard uncertainty, where the data had to tell it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    fitted_g: Vec<(f64, f64)>,
    thickness_mm: Option<f64>,
    /// Why there are no channels, where there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    /// The model's total over the whole plane per power that enters, of each channel.
    total_reflectance: Vec<f64>,
    channels: Vec<Channel>,
}

impl From<&Compared> for Model {
    fn from(compared: &Compared) -> Self {
        let choice = &compared.model;
        Self {
            model: choice.name.clone(),
            g: choice.g,
            fitted_g: (compared.fits().iter())
                .filter_map(|(given, _)| given.fitted_g())
                .collect(),
            thickness_mm: choice.slab.map(|slab| slab.thickness_mm),
            error: compared.outcome.as_ref().err().cloned(),
            total_reflectance: compared.totals().unwrap_or_default(),
            channels: (compared.fits().iter())
                .map(|(_, fit)| Channel::from(fit))
                .collect(),
        }
    }
}

/// A file and its hash.
#[derive(Clone, Debug, Serialize)]
pub struct InputHash {
    /// As the manifest or the call names it.
    pub file: String,
    /// BLAKE3 of its bytes.
    pub blake3: String,
}

/// One channel of a `fit.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Channel {
    channel: String,
    wavelength_nm: Option<f64>,
    sigma_a_per_mm: Number,
    sigma_s_prime_per_mm: Number,
    correlation: f64,
    budget: Vec<Line>,
    total_reflectance: Option<Total>,
    scale: f64,
    range_mm: [f64; 2],
    points: usize,
    share_outside: f64,
    reduced_chi2: f64,
    evaluations: usize,
    termination: &'static str,
    upper_limit: Option<f64>,
    warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    verdict: Option<Verdict>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bootstrap: Option<Bootstrap>,
    #[serde(skip_serializing_if = "Option::is_none")]
    beam: Option<BeamDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stray_light: Option<VeilDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    monte_carlo: Option<Confirmation>,
}

#[derive(Clone, Debug, Serialize)]
struct Number {
    value: f64,
    u: f64,
    ci95: [f64; 2],
    /// Absent where infinite.
    degrees_of_freedom: Option<f64>,
}

/// A line of the uncertainty budget.
#[derive(Clone, Debug, Serialize)]
struct Line {
    source: String,
    u_sigma_a_per_mm: f64,
    u_sigma_s_prime_per_mm: f64,
    correlation: f64,
    /// Absent where the uncertainty was stated, which counts as infinitely many.
    degrees_of_freedom: Option<f64>,
}

#[derive(Clone, Debug, Serialize)]
struct Total {
    measured: f64,
    u: f64,
    model: f64,
    radius_max_mm: Option<f64>,
}

/// The name of a constraint on the command line and in files.
pub fn constraint_name(constraint: Constraint) -> &'static str {
    match constraint {
        Constraint::Exact => "exact",
        Constraint::Joint => "joint",
        Constraint::None => "none",
    }
}

/// The name of a termination in files.
pub fn termination_name(termination: Termination) -> &'static str {
    match termination {
        Termination::Converged => "converged",
        Termination::AtBound => "at_bound",
        Termination::OutOfEvaluations => "out_of_evaluations",
    }
}

impl From<&Estimate> for Number {
    fn from(e: &Estimate) -> Self {
        Self {
            value: e.value,
            u: e.u,
            ci95: [e.ci95.0, e.ci95.1],
            degrees_of_freedom: finite(e.degrees_of_freedom),
        }
    }
}

fn finite(number: f64) -> Option<f64> {
    number.is_finite().then_some(number)
}

impl From<&Contribution> for Line {
    fn from(c: &Contribution) -> Self {
        Self {
            source: c.source.clone(),
            u_sigma_a_per_mm: c.u_sigma_a,
            u_sigma_s_prime_per_mm: c.u_sigma_s_prime,
            correlation: c.correlation,
            degrees_of_freedom: finite(c.degrees_of_freedom),
        }
    }
}

impl From<&Fit> for Channel {
    fn from(fit: &Fit) -> Self {
        Self {
            channel: fit.channel.clone(),
            wavelength_nm: None,
            sigma_a_per_mm: (&fit.sigma_a).into(),
            sigma_s_prime_per_mm: (&fit.sigma_s_prime).into(),
            correlation: fit.correlation,
            budget: fit.budget.iter().map(Line::from).collect(),
            total_reflectance: fit.total.map(|t| Total {
                measured: t.measured,
                u: t.u,
                model: t.model,
                radius_max_mm: t.radius_max_mm,
            }),
            scale: fit.scale,
            range_mm: [fit.range_mm.0, fit.range_mm.1],
            points: fit.residuals.len(),
            share_outside: fit.share_outside,
            reduced_chi2: fit.reduced_chi2,
            evaluations: fit.evaluations,
            termination: termination_name(fit.termination),
            upper_limit: fit.upper_limit,
            warnings: fit.warnings.iter().map(ToString::to_string).collect(),
            verdict: None,
            bootstrap: None,
            beam: None,
            stray_light: None,
            monte_carlo: None,
        }
    }
}

impl FitDocument {
    /// The document of `fits`.
    pub fn new(
        fits: &[Fit],
        material: Option<String>,
        eta: f64,
        model: &str,
        constraint: Constraint,
        inputs: &[Input],
        assumptions: &[String],
    ) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            beamspot_version: env!("CARGO_PKG_VERSION"),
            inputs: inputs
                .iter()
                .map(|i| InputHash {
                    file: i.name.clone(),
                    blake3: i.blake3.clone(),
                })
                .collect(),
            material,
            eta,
            model: model.to_owned(),
            constraint: constraint_name(constraint),
            assumptions: assumptions.to_vec(),
            left_out: vec![],
            warnings: vec![],
            channels: fits.iter().map(Channel::from).collect(),
            models: vec![],
        }
    }

    /// The same document with the fits of every model.
    #[must_use]
    pub fn with_models(mut self, compared: &[Compared]) -> Self {
        self.models = compared.iter().map(Model::from).collect();
        self
    }

    /// The same document with the verdict on each channel.
    #[must_use]
    pub fn with_verdicts(mut self, verdicts: &[Verdict]) -> Self {
        for (channel, verdict) in self.channels.iter_mut().zip(verdicts) {
            channel.verdict = Some(verdict.clone());
        }
        self
    }

    /// The same document with what replicas of each channel gave.
    #[must_use]
    pub fn with_bootstraps(mut self, bootstraps: &[Bootstrap]) -> Self {
        for (channel, bootstrap) in self.channels.iter_mut().zip(bootstraps) {
            channel.bootstrap = Some(*bootstrap);
        }
        self
    }

    /// The same document with the frames and pixels that were left out, in sentences.
    #[must_use]
    pub fn with_left_out(mut self, lines: &[String]) -> Self {
        self.left_out = lines.to_vec();
        self
    }

    /// The same document with warnings of the measurement as a whole.
    #[must_use]
    pub fn with_warnings(mut self, warnings: &[String]) -> Self {
        self.warnings = warnings.to_vec();
        self
    }

    /// The same document with the beam of each channel.
    #[must_use]
    pub fn with_beams(mut self, beams: &[ChosenBeam]) -> Self {
        for (channel, beam) in self.channels.iter_mut().zip(beams) {
            channel.beam = Some(beam.into());
        }
        self
    }

    /// The same document with the stray light of each channel.
    #[must_use]
    pub fn with_stray_light(mut self, veils: &[Veil]) -> Self {
        for (channel, veil) in self.channels.iter_mut().zip(veils) {
            channel.stray_light = Some(veil.into());
        }
        self
    }

    /// The same document with what photon counting says of each channel.
    #[must_use]
    pub fn with_confirmations(mut self, confirmations: &[Option<Confirmation>]) -> Self {
        for (channel, confirmation) in self.channels.iter_mut().zip(confirmations) {
            channel.monte_carlo.clone_from(confirmation);
        }
        self
    }

    /// The text of the file.
    ///
    /// # Errors
    ///
    /// None that a finite number could cause; serde's are passed on.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|text| text + "\n")
    }
}

/// What a table of many captures shows of a `fit.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FitSummary {
    /// Name of the material.
    pub material: Option<String>,
    /// The channels.
    pub channels: Vec<ChannelSummary>,
}

/// One channel of a [`FitSummary`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ChannelSummary {
    /// Its name.
    pub channel: String,
    /// σₐ, mm⁻¹.
    pub sigma_a_per_mm: NumberSummary,
    /// σₛ′, mm⁻¹.
    pub sigma_s_prime_per_mm: NumberSummary,
    /// σₐ that it does not exceed, mm⁻¹, where it could not be told from 0.
    pub upper_limit: Option<f64>,
    /// χ² per degree of freedom, where it is finite.
    pub reduced_chi2: Option<f64>,
    /// What speaks against it.
    pub verdict: Option<VerdictSummary>,
}

/// A value and its standard uncertainty.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct NumberSummary {
    /// The value.
    pub value: f64,
    /// Its standard uncertainty, where it is finite.
    pub u: Option<f64>,
}

/// What a [`Verdict`] comes down to.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct VerdictSummary {
    /// Whether nothing speaks against the numbers.
    pub good: bool,
    /// What does, one sentence each.
    pub bad: Vec<String>,
}

impl FitSummary {
    /// Of the text of a `fit.json`.
    ///
    /// # Errors
    ///
    /// It is not one.
    pub fn read(text: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(text)
    }

    /// The first thing that speaks against each channel, if anything does.
    pub fn bad(&self) -> impl Iterator<Item = String> {
        self.channels.iter().filter_map(|c| {
            let first = c.verdict.as_ref()?.bad.first()?;
            Some(format!("channel {}: {first}", c.channel))
        })
    }
}
