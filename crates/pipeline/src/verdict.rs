//! How far a channel's numbers can be trusted, in plain words and as data.

use crate::error::Result;
use crate::fitting::{Given, ScaleInput, fit_channel, u_relative};
use fit::{Constraint, Fit, Termination, Warning};
use physics::{Coefficients, Footprints, RadialProfile, TotalReflectance};
use serde::Serialize;

/// Light beyond the picture from which the total is more the model's than the camera's.
const MUCH_OUTSIDE: f64 = 0.2;
/// α′ below which a closed form's coefficients are those of another medium (example `coverage`).
const LEAST_ALBEDO: f64 = 0.8;
/// A fit that starts nearer than so many 1/σₜ′ sees light that no diffusion describes.
const NEAR: f64 = 1.0;
/// A fit that ends before so many decay lengths 1/σₜᵣ sees little of absorption.
const SHORT: f64 = 0.5;
/// Standard deviations of the number of runs from which the residuals have structure.
const STRUCTURE: f64 = 4.0;
/// How much g may be off where it is given, for what that does to the coefficients.
const STEP_OF_G: f64 = 0.05;
/// Relative u from which a coefficient is hardly known.
const VAGUE: f64 = 0.5;

/// What is to be said of one channel's fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether nothing speaks against the numbers.
    pub good: bool,
    /// What speaks against them, one sentence each.
    pub bad: Vec<String>,
    /// The rest, one sentence each.
    pub notes: Vec<String>,
    /// d ln σₐ/d ln R under the hard constraint: by how many percent σₐ moves for one of R.
    pub sigma_a_by_total: Option<f64>,
    /// Relative u of the total at which the hard constraint begins to hurt σₐ.
    pub break_even_u_total: Option<f64>,
    /// Relative u of the total here, its scale included.
    pub u_total: Option<f64>,
    /// The mean cosine g that the model took, and how well it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub g: Option<MeanCosine>,
    /// Where the fit starts, in transport lengths 1/σₜ′.
    pub start_in_transport_lengths: f64,
    /// Where it ends, in decay lengths 1/σₜᵣ.
    pub end_in_decay_lengths: f64,
    /// α′.
    pub albedo_prime: f64,
    /// The smallest σₐ that this capture could have told from 0, mm⁻¹.
    pub smallest_sigma_a_per_mm: Option<f64>,
    /// Share of the light that leaves beyond the picture, by the model.
    pub share_outside: f64,
    /// Standard deviations by which the residuals change sign less often than noise does.
    pub runs_z: f64,
}

/// The mean cosine of the scattering angle in a fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanCosine {
    /// Its value.
    pub value: f64,
    /// Its standard uncertainty, where it was fitted along; without one it was given.
    pub u: Option<f64>,
    /// By what share σₐ and σₛ′ move if it is 0.05 larger or smaller, the larger of the two.
    pub moves: [f64; 2],
}

/// Judges the fit of a channel.
///
/// # Errors
///
/// The model is unknown.
pub fn judge(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    scale: &[ScaleInput],
    given: &Given,
    fit: &Fit,
) -> Result<Verdict> {
    let at = fit.coefficients();
    let (start, end) = fit.range_mm;
    let total = total.filter(|_| given.constraint != Constraint::None);
    // The total alone moves, with everything else that a fit chooses held.
    let fixed = |constraint| Given {
        constraint,
        range_mm: Some(fit.range_mm),
        discrepancy: false,
        free_scale: false,
        ..given.exact()
    };
    let mut by_total = None;
    let mut free = None;
    if let Some(total) = total.filter(|_| fit.sigma_a.value > 0.0) {
        let hard = fixed(Constraint::Exact);
        let at = |factor: f64| {
            let total = TotalReflectance {
                total_reflectance: factor * total.total_reflectance,
                ..total.clone()
            };
            let found = fit_channel(profile, Some(&total), scale, &hard).ok()?;
            (found.sigma_a.value > 0.0).then_some(found.sigma_a.value)
        };
        let step = 1e-3;
        if let (Some(low), Some(high)) = (at(1.0 - step), at(1.0 + step)) {
            by_total = Some((high / low).ln() / ((1.0 + step) / (1.0 - step)).ln());
        }
        let soft = fixed(Constraint::None);
        free = fit_channel(profile, None, scale, &soft)
            .ok()
            .filter(|f| f.sigma_a.value > 0.0)
            .map(|f| f.sigma_a.u / f.sigma_a.value);
    }
    let break_even = by_total.zip(free).map(|(slope, free)| free / slope.abs());
    let u_total =
        total.map(|t| (t.u_total_reflectance / t.total_reflectance).hypot(u_relative(scale)));
    let g = mean_cosine(profile, total, scale, &fixed(given.constraint), fit);
    let mut verdict = Verdict {
        g: g.map(|g| MeanCosine {
            u: given.fitted_g().map(|(_, u)| u),
            ..g
        }),
        good: true,
        bad: vec![],
        notes: vec![],
        sigma_a_by_total: by_total,
        break_even_u_total: break_even,
        u_total,
        start_in_transport_lengths: start * at.sigma_t_prime(),
        end_in_decay_lengths: end * at.sigma_tr(),
        albedo_prime: at.albedo_prime(),
        smallest_sigma_a_per_mm: smallest(profile, total, scale, given, fit)?,
        share_outside: fit.share_outside,
        runs_z: runs_z(fit),
    };
    verdict.words(given, fit);
    verdict.good = verdict.bad.is_empty();
    Ok(verdict)
}

/// The g of a transport fit, and what the coefficients make of another one.
fn mean_cosine(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    scale: &[ScaleInput],
    given: &Given,
    fit: &Fit,
) -> Option<MeanCosine> {
    let value = given.model.g.filter(|_| given.model.solves_transport())?;
    let at = fit.coefficients();
    let mut moves = [0.0_f64; 2];
    for step in [-STEP_OF_G, STEP_OF_G] {
        let mut given = given.clone();
        given.model.g = Some(value + step);
        // At the table's edge one side has to do.
        let Ok(found) = fit_channel(profile, total, scale, &given) else {
            continue;
        };
        let found = found.coefficients();
        for (most, (found, at)) in moves.iter_mut().zip([
            (found.sigma_a, at.sigma_a),
            (found.sigma_s_prime, at.sigma_s_prime),
        ]) {
            if at > 0.0 {
                *most = most.max((found / at - 1.0).abs());
            }
        }
    }
    Some(MeanCosine {
        value,
        u: None,
        moves,
    })
}

/// The upper limit that this capture gives for a medium without absorption.
fn smallest(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    scale: &[ScaleInput],
    given: &Given,
    fit: &Fit,
) -> Result<Option<f64>> {
    let clear = Coefficients {
        sigma_a: 0.0,
        sigma_s_prime: fit.sigma_s_prime.value,
    };
    let model = given.model()?;
    let entry = given.entry_factor(given.eta);
    let mut values = vec![0.0; profile.points.len()];
    Footprints::new(&profile.points, &given.blur()).reflectance(&*model, clear, &mut values);
    let mut seen = profile.clone();
    for (p, value) in seen.points.iter_mut().zip(values) {
        p.reflectance_per_mm2 = entry * value;
    }
    let seen_total = total.map(|t| {
        let radius = t.radius_max_mm.unwrap_or(f64::INFINITY);
        TotalReflectance {
            total_reflectance: entry * model.within(clear, radius).value,
            ..t.clone()
        }
    });
    let given = Given {
        range_mm: Some(fit.range_mm),
        ..given.exact()
    };
    let found = fit_channel(&seen, seen_total.as_ref(), scale, &given).ok();
    Ok(found.map(|f| f.upper_limit.unwrap_or(f.sigma_a.ci95.1)))
}

/// How many standard deviations fewer runs of one sign the residuals have than noise would
/// (Wald and Wolfowitz 1940).
fn runs_z(fit: &Fit) -> f64 {
    let signs: Vec<bool> = fit
        .residuals
        .iter()
        .map(|r| r.measured_per_mm2 - r.model_per_mm2 - r.nuisances_per_mm2)
        .filter(|r| *r != 0.0)
        .map(|r| r > 0.0)
        .collect();
    let up = signs.iter().filter(|s| **s).count() as f64;
    let (all, down) = (signs.len() as f64, signs.len() as f64 - up);
    if up == 0.0 || down == 0.0 || all < 10.0 {
        return 0.0;
    }
    let runs = 1.0 + signs.windows(2).filter(|w| w[0] != w[1]).count() as f64;
    let product = 2.0 * up * down;
    let mean = product / all + 1.0;
    let variance = product * (product - all) / (all * all * (all - 1.0));
    (mean - runs) / variance.sqrt()
}

impl Verdict {
    fn words(&mut self, given: &Given, fit: &Fit) {
        let closed_form = !given.model.solves_transport();
        let (bad, notes) = (&mut self.bad, &mut self.notes);
        if let (Some(slope), Some(u)) = (self.sigma_a_by_total, self.u_total) {
            notes.push(format!(
                "1 % of the total reflectance is {:.1} % of sigma_a if it is taken as exact",
                slope.abs()
            ));
            if let Some(even) = self.break_even_u_total {
                let side = if u > even { "hurts" } else { "helps" };
                notes.push(format!(
                    "an exact total {side} here: it is known to {:.2} %, and profile alone does as \
                     well from {:.2} % on (model error left out)",
                    100.0 * u,
                    100.0 * even
                ));
            }
        }
        if let Some(MeanCosine { value, u, moves }) = self.g {
            let [a, s] = moves.map(|x| 100.0 * x);
            let whence = match u {
                Some(u) => format!(
                    "g was not given: the data want {value:.2} +- {u:.2}, which is part of u"
                ),
                None => format!("g = {value} is taken as given"),
            };
            notes.push(format!(
                "{whence}; {STEP_OF_G} more or less moves sigma_a by {a:.2} % and sigma_s' by {s:.2} \
                 %"
            ));
        }
        // Transport holds wherever its table does; how sure it is near the beam is part of u.
        if closed_form && self.start_in_transport_lengths < NEAR {
            bad.push(format!(
                "the fit starts at {:.2} transport lengths from the beam, where no diffusion is: \
                 photograph a wider field",
                self.start_in_transport_lengths
            ));
        }
        if self.end_in_decay_lengths < SHORT && fit.upper_limit.is_none() {
            notes.push(format!(
                "the radii end at {:.2} decay lengths: absorption shows little in the profile, and \
                 sigma_a rests on the total",
                self.end_in_decay_lengths
            ));
        }
        if closed_form && self.albedo_prime < LEAST_ALBEDO {
            bad.push(format!(
                "reduced albedo {:.2}: too dark for a closed form; take monte-carlo",
                self.albedo_prime
            ));
        }
        if let Some(smallest) = self.smallest_sigma_a_per_mm {
            notes.push(format!(
                "the smallest sigma_a that this capture could have seen is {smallest:.1e} mm^-1"
            ));
        }
        if self.share_outside > MUCH_OUTSIDE {
            bad.push(format!(
                "{:.0} % of the light leaves outside the picture: photograph a wider field",
                100.0 * self.share_outside
            ));
        }
        for warning in &fit.warnings {
            match warning {
                Warning::PoorFit { reduced_chi2, .. } => bad.push(format!(
                    "the residuals are larger than noise and model error explain: reduced \
                     chi-squared {reduced_chi2:.1}"
                )),
                Warning::ScaleOff { scale, u } => bad.push(format!(
                    "the data want the scale of the white reference times {scale:.3}, stated with \
                     u {u:.3}"
                )),
                Warning::InputOff { input, off } => bad.push(format!(
                    "the data want the {input} {off:.1} of its standard uncertainties from what \
                     was stated"
                )),
                Warning::AnotherUnit { .. } => bad.push(warning.to_string()),
                Warning::UnknownModelError { .. } => notes.push(warning.to_string()),
                _ => {}
            }
        }
        if self.runs_z > STRUCTURE && fit.reduced_chi2 > 1.5 {
            bad.push(format!(
                "the residuals have structure: they change sign less often than noise by {:.1} \
                 standard deviations",
                self.runs_z
            ));
        }
        if fit.termination == Termination::OutOfEvaluations {
            bad.push("the search did not converge".to_owned());
        }
        let vague = |e: &fit::Estimate| e.u > VAGUE * e.value;
        if vague(&fit.sigma_s_prime) || (fit.upper_limit.is_none() && vague(&fit.sigma_a)) {
            bad.push("a coefficient is known to no better than half its value".to_owned());
        }
    }

    /// What it says, in sentences, the bad news first.
    pub fn sentences(&self) -> impl Iterator<Item = &str> {
        self.bad.iter().chain(&self.notes).map(String::as_str)
    }
}
