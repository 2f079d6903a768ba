//! The fit of every channel, with the uncertainty of what it took as given.

use crate::discrepancy::{Discrepancy, with_grain};
use crate::error::{Error, Kind, Result};
use crate::library::{self, ModelChoice};
use fit::{
    Constraint, Contribution, Direction, DirectionKind, Estimate, Fit, FitError, FitOptions,
    ManyFits, Profiles, Warning,
};
use physics::footprint::Beam;
use physics::medium::SAMPLE_INDEX;
use physics::{
    Blur, Coefficients, Footprints, ForwardModel, Material, ProfilePoint, RadialProfile,
    TotalReflectance, fresnel,
};
use profile::Exit;
use rayon::prelude::*;
use std::sync::Arc;
use transport::TransportModel;

/// Standard uncertainty over the difference of two answers, were any between as likely as either:
/// 1/√12, as of a rectangle of half that width (JCGM 100, 4.3.7).
const TWO_STORIES: f64 = 0.289;
/// Mean cosines tried for the medium at which a closed form's discrepancy is taken.
const G_TRIED: [f64; 5] = [0.0, 0.3, 0.6, 0.8, 0.93];

/// One cause of the uncertainty of the scale that profile and total share.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleInput {
    /// The cause, as a person calls it: it becomes a line of the budget.
    pub source: &'static str,
    /// Standard uncertainty of the scale that comes from it, relative.
    pub u_relative: f64,
}

/// Relative standard uncertainty of a scale, its causes independent.
pub fn u_relative(scale: &[ScaleInput]) -> f64 {
    scale.iter().fold(0.0, |u: f64, s| u.hypot(s.u_relative))
}

/// What a fit takes as given, and how well each is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    /// The model.
    pub model: ModelChoice,
    /// Whether the model's error against transport takes part, where it is known.
    pub discrepancy: bool,
    /// What the total does.
    pub constraint: Constraint,
    /// Whether the scale that profile and total share is taken as unknown, so that the shape alone
    /// decides and the white reference does not matter.
    pub free_scale: bool,
    /// First and last radius, mm; `None` lets the fit choose.
    pub range_mm: Option<(f64, f64)>,
    /// Relative index of the sample.
    pub eta: f64,
    /// Its standard uncertainty.
    pub u_eta: f64,
    /// Whether only 1 − R_specular of the beam enters.
    pub entry_loss: bool,
    /// Cosine between beam and normal.
    pub cos_beam: f64,
    /// How radiance became exitance: its factor changes with `eta`.
    pub exit: Exit,
    /// Relative standard uncertainty of the scale of length.
    pub u_length_relative: f64,
    /// The beam.
    pub beam: Beam,
    /// Standard uncertainty of its full width at half maximum, mm.
    pub u_fwhm_mm: f64,
    /// Side of a pixel, mm; 0 where the profile does not come from pixels.
    pub pixel_mm: f64,
    /// Inputs that are each off by one standard uncertainty.
    pub variants: Vec<Variant>,
    /// Ways in which the data may be off together: the fit carries them along.
    pub directions: Vec<Direction>,
}

/// An input that is off, for what that does to the coefficients.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// The input, as a budget calls it.
    pub name: &'static str,
    /// How many standard uncertainties the change to one stands for: 1, or 1/√n where n variants
    /// are draws of the same input.
    pub weight: f64,
    /// What is otherwise.
    pub change: Change,
}

/// What is otherwise in a [`Variant`].
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// The beam.
    Beam(Beam),
    /// The mean cosine of the scattering angle.
    G(f64),
}

/// An input that is one number and bends a profile in a way that no medium does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bending {
    Eta,
    BeamWidth,
}

impl Bending {
    /// The line of the budget.
    fn source(self) -> &'static str {
        match self {
            Self::Eta => "relative index eta",
            Self::BeamWidth => "beam width",
        }
    }
}

impl Given {
    /// A model at an index, everything else exact: a thin beam along the normal, a profile of
    /// exitance per incident power, no total.
    pub fn of(model: ModelChoice, eta: f64) -> Self {
        Self {
            model,
            discrepancy: true,
            constraint: Constraint::None,
            free_scale: false,
            range_mm: None,
            eta,
            u_eta: 0.0,
            entry_loss: true,
            cos_beam: 1.0,
            exit: Exit::Lambert,
            u_length_relative: 0.0,
            beam: Beam::Point,
            u_fwhm_mm: 0.0,
            pixel_mm: 0.0,
            variants: vec![],
            directions: vec![],
        }
    }

    /// Relative standard uncertainty of a scale that `scale` makes uncertain; infinite where it is
    /// free.
    pub(crate) fn u_scale(&self, scale: &[ScaleInput]) -> f64 {
        if self.free_scale {
            f64::INFINITY
        } else {
            u_relative(scale)
        }
    }

    /// Share of the incident power that enters at index `eta`; 1 in the paper's mode.
    pub(crate) fn entry_factor(&self, eta: f64) -> f64 {
        if self.entry_loss {
            fresnel::entry_factor(eta, self.cos_beam)
        } else {
            1.0
        }
    }

    /// The model at the index.
    ///
    /// # Errors
    ///
    /// The model is unknown, or lacks what it needs; or no sample has this index.
    pub fn model(&self) -> Result<Box<dyn ForwardModel>> {
        self.check_index()?;
        library::model(&self.model, self.eta)
    }

    /// Refuses an index that no sample has.
    ///
    /// # Errors
    ///
    /// It says what is expected.
    pub fn check_index(&self) -> Result<()> {
        if SAMPLE_INDEX.contains(&self.eta) {
            return Ok(());
        }
        let message = format!(
            "eta must be a relative refractive index from {} to {}, as 1.3 for a wet tissue, got {}",
            SAMPLE_INDEX.start(),
            SAMPLE_INDEX.end(),
            self.eta
        );
        Err(Error::new(Kind::Usage, message))
    }

    /// Transport at every g that the medium may have, where the model's discrepancy takes part.
    fn truths(&self) -> Vec<TransportModel> {
        if !self.discrepancy || !Discrepancy::is_known(&self.model) {
            return vec![];
        }
        let eta = self.eta.clamp(1.0, 1.6);
        let (first, last) = (G_TRIED[0], G_TRIED[G_TRIED.len() - 1]);
        let told = self.model.g.map(|g| [g.clamp(first, last)]);
        let tried = told.as_ref().map_or(&G_TRIED[..], |g| g);
        let truths = tried.iter();
        truths
            .filter_map(|g| TransportModel::new(eta, *g).ok())
            .collect()
    }

    /// Where the model's discrepancy takes part: a medium near the one that made the data, as
    /// transport has it under the hard constraint, at the g that suits the data best.
    fn near(
        &self,
        profile: &RadialProfile,
        total: Option<&TotalReflectance>,
        truths: &[TransportModel],
        footprints: &Arc<Footprints>,
    ) -> Option<Coefficients> {
        let hard = total.is_some() && self.constraint != Constraint::None && !self.free_scale;
        let options = FitOptions {
            constraint: if hard {
                Constraint::Exact
            } else {
                Constraint::None
            },
            footprints: Some(Arc::clone(footprints)),
            ..self.options(if self.free_scale { f64::INFINITY } else { 0.0 })
        };
        // Where that has no answer, neither has a fit with a closed form: it will say why.
        let fits = truths.iter();
        let fits = fits.filter_map(|truth| fit::fit(profile, total, truth, &options).ok());
        let best = fits.min_by(|a, b| a.reduced_chi2.total_cmp(&b.reduced_chi2));
        best.map(|fit| fit.coefficients())
    }

    /// The same with every input taken as exact that a fit does not carry along: what comes out is
    /// the same coefficients, without the neighbouring fits.
    pub(crate) fn exact(&self) -> Self {
        let carried = Self {
            u_length_relative: 0.0,
            variants: vec![],
            ..self.clone()
        };
        if self.carries_inputs() {
            return carried;
        }
        Self {
            u_eta: 0.0,
            u_fwhm_mm: 0.0,
            ..carried
        }
    }

    /// Whether a fit weighs its data with what it knows of η and the beam. The hard constraint
    /// takes them as true, and asks afterwards.
    fn carries_inputs(&self) -> bool {
        self.constraint != Constraint::Exact
    }

    /// The inputs that bend a profile and have one number each that may be off.
    fn bending(&self) -> impl Iterator<Item = Bending> {
        let all = [
            (Bending::Eta, self.u_eta),
            (Bending::BeamWidth, self.u_fwhm_mm),
        ];
        let uncertain = all.into_iter().filter(|(_, u)| *u > 0.0);
        uncertain.map(|(bending, _)| bending)
    }

    /// The same where `input` is off by `z` of its standard uncertainties, and how far it then is:
    /// η stops at 1.
    fn off(&self, input: Bending, z: f64) -> (Self, f64) {
        let mut given = self.clone();
        match input {
            Bending::Eta => {
                given.eta = (self.eta + z * self.u_eta).max(1.0);
                let moved = (given.eta - self.eta) / self.u_eta;
                (given, moved)
            }
            Bending::BeamWidth => {
                given.beam = widened(&self.beam, z * self.u_fwhm_mm);
                (given, z)
            }
        }
    }

    /// A beam as far off as its width is uncertain, by the standard normal `draw`.
    pub(crate) fn drawn_beam(&self, draw: f64) -> Beam {
        let Beam::Measured(spread) = &self.beam else {
            return widened(&self.beam, self.u_fwhm_mm * draw);
        };
        let fwhm = spread.fwhm_mm();
        let squares: f64 = (self.variants.iter())
            .map(|v| match &v.change {
                Change::Beam(Beam::Measured(other)) => {
                    (v.weight * (other.fwhm_mm() - fwhm) / fwhm).powi(2)
                }
                Change::Beam(_) | Change::G(_) => 0.0,
            })
            .sum();
        // Three standard deviations of any width that can be measured stay above half of it.
        let factor = (1.0 + squares.sqrt() * draw).max(0.5);
        Beam::Measured(spread.stretched(factor))
    }

    pub(crate) fn blur(&self) -> Blur {
        Blur {
            beam: self.beam.clone(),
            pixel_mm: self.pixel_mm,
        }
    }

    /// What a fit alone is told of it, without the uncertainties of the inputs.
    pub fn options(&self, u_scale_relative: f64) -> FitOptions {
        FitOptions {
            constraint: self.constraint,
            range_mm: self.range_mm,
            entry_factor: self.entry_factor(self.eta),
            u_scale_relative,
            blur: self.blur(),
            directions: self.directions.clone(),
            ..FitOptions::default()
        }
    }
}

/// Fits one channel; `scale` lists what makes the scale uncertain that profile and total share.
///
/// What η and a stated beam width may be off bends the whole profile together: the fit weighs its data with
/// that, each a line of its budget, and its χ² is judged with it. The hard constraint takes them
/// as true, and what they are uncertain by is added to its u, as are in any fit the uncertainties
/// of the scale of length, of every variant of the inputs and of the model's own numerics.
///
/// # Errors
///
/// The model is unknown, or the profile cannot constrain a medium.
pub fn fit_channel(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    scale: &[ScaleInput],
    given: &Given,
) -> Result<Fit> {
    fit_beside(profile, total, scale, given, &Shared::of(given))
}

/// What fits of many profiles share that were taken alike.
pub(crate) struct Shared {
    /// Transport at every g that the medium may have, where the model's discrepancy takes part.
    truths: Vec<TransportModel>,
    /// What the points average over, where all profiles have the same.
    footprints: Option<Arc<Footprints>>,
}

impl Shared {
    /// Of profiles for which this is given.
    pub(crate) fn of(given: &Given) -> Self {
        Self {
            truths: given.truths(),
            footprints: None,
        }
    }

    /// The same where all have these points, which have been checked.
    pub(crate) fn at(self, points: &[ProfilePoint], given: &Given) -> Self {
        let footprints = Footprints::new(points, &given.blur());
        Self {
            footprints: Some(Arc::new(footprints)),
            ..self
        }
    }
}

/// Fits every one of many profiles that share radii and what is given, on all threads of the
/// current `rayon` pool; the same on any number of them, to the last bit.
///
/// Where no discrepancy takes part this is [`fit::fit_many`], which allocates nothing from one
/// profile to the next. With one it is [`fit_channel`] of each: a fit with transport finds where
/// the model's error is taken, a hundred times slower. Whether profiles are in another unit is then
/// asked of no more than a few of those that fit badly: all of an array are in one.
///
/// # Errors
///
/// The model is unknown, or the arrays do not belong together. A profile that cannot be fitted
/// does not stop the others.
pub fn fit_many(profiles: &Profiles, scale: &[ScaleInput], given: &Given) -> Result<ManyFits> {
    let model = given.model()?;
    let options = given.options(given.u_scale(scale));
    let mut found = fit::fit_many(profiles, &*model, &options)?;
    let shared = Shared::of(given);
    let alone = shared.truths.is_empty();
    let asked = if alone {
        in_doubt(&found)
    } else {
        // What has no answer without the discrepancy has none with it.
        let fitted = 0..found.sigma_a.len();
        fitted.filter(|i| found.termination[*i].is_some()).collect()
    };
    let unknown = !given.model.solves_transport() && !Discrepancy::is_known(&given.model);
    if alone && given.discrepancy && unknown {
        let model = model.name();
        let fitted = (0..found.sigma_a.len()).filter(|i| found.termination[*i].is_some());
        let unknown = fitted.map(|i| (i, Warning::UnknownModelError { model }));
        found.warnings.extend(unknown);
    }
    let shared = shared.at(profiles.points, given);
    let points = profiles.points.len();
    let one = |i: usize| {
        let channel = i.to_string();
        let u = profiles.u_reflectance_per_mm2;
        let u = if u.len() == points {
            u
        } else {
            &u[i * points..][..points]
        };
        let values = &profiles.reflectance_per_mm2[i * points..][..points];
        let measured = profiles.points.iter().zip(values.iter().zip(u));
        let profile = RadialProfile {
            channel: channel.clone(),
            points: measured
                .map(|(p, (value, u))| ProfilePoint {
                    reflectance_per_mm2: *value,
                    u_reflectance_per_mm2: *u,
                    ..*p
                })
                .collect(),
        };
        let total = profiles.totals.map(|t| TotalReflectance {
            channel,
            total_reflectance: t.total_reflectance[i],
            u_total_reflectance: t.u_total_reflectance[i],
            radius_max_mm: t.radius_max_mm,
            u_scale_relative: u_relative(scale),
            u_offset_per_mm2: 0.0,
        });
        fit_beside(&profile, total.as_ref(), scale, given, &shared)
    };
    let fits: Vec<(usize, Result<Fit>)> = asked.into_par_iter().map(|i| (i, one(i))).collect();
    if !alone {
        found.warnings.clear();
    }
    for (i, fit) in fits {
        match fit {
            Ok(fit) if alone => {
                let unit = |w: &&Warning| matches!(w, Warning::AnotherUnit { .. });
                let said = fit.warnings.iter().find(unit);
                found.warnings.extend(said.map(|w| (i, *w)));
            }
            Ok(fit) => {
                found.replace(i, Ok(&fit));
                found.warnings.extend(fit.warnings.iter().map(|w| (i, *w)));
            }
            // Only the fit itself fails from here on: everything else was there for the first.
            Err(error) => match error.cause::<FitError>() {
                Some(_) if alone => {}
                Some(cause) => found.replace(i, Err(cause.clone())),
                None => return Err(error),
            },
        }
    }
    found.warnings.sort_by_key(|w| w.0);
    Ok(found)
}

/// Profiles at most that are asked whether they are in another unit: all of an array are in one.
const ASKED: usize = 64;

/// Of many fits those, evenly over them, that look as if the profile may be in another unit.
fn in_doubt(found: &ManyFits) -> Vec<usize> {
    let mut warnings = found.warnings.as_slice();
    let mut doubted: Vec<usize> = vec![];
    for (i, chi2) in found.reduced_chi2.iter().enumerate() {
        let own = warnings.iter().take_while(|w| w.0 == i).count();
        let (own, rest) = warnings.split_at(own);
        if fit::doubts_unit(*chi2, own.iter().map(|w| &w.1)) {
            doubted.push(i);
        }
        warnings = rest;
    }
    let step = doubted.len().div_ceil(ASKED).max(1);
    doubted.into_iter().step_by(step).collect()
}

/// The fit of [`fit_channel`], with what it shares with others.
pub(crate) fn fit_beside(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    scale: &[ScaleInput],
    given: &Given,
    shared: &Shared,
) -> Result<Fit> {
    let mut found = fit_with_lines(profile, total, scale, given, shared)?;
    if given.discrepancy && !given.model.solves_transport() && !Discrepancy::is_known(&given.model)
    {
        let model = given.model()?.name();
        found.warnings.push(Warning::UnknownModelError { model });
    }
    if given.free_scale {
        return Ok(found);
    }
    let unit = fit::another_unit(profile, &found, |other, factor| {
        let mut given = given.exact();
        let directions = given.directions.iter_mut();
        for direction in directions.filter(|d| d.kind == DirectionKind::Absolute) {
            for change in &mut direction.profile {
                *change *= factor;
            }
        }
        fit_with_lines(other, total, scale, &given, shared).ok()
    });
    found.warnings.extend(unit);
    Ok(found)
}

/// The fit, with the lines of its budget that it does not find itself.
fn fit_with_lines(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    scale: &[ScaleInput],
    given: &Given,
    shared: &Shared,
) -> Result<Fit> {
    given.check_index()?;
    let u_scale_relative = given.u_scale(scale);
    // What a number that is none does to a footprint is nobody's question.
    fit::check(profile, total, &given.options(u_scale_relative))?;
    let footprints = match &shared.footprints {
        Some(footprints) => Arc::clone(footprints),
        None => Arc::new(Footprints::new(&profile.points, &given.blur())),
    };
    let near = given.near(profile, total, &shared.truths, &footprints);
    let (profile, total) = if near.is_some() {
        with_grain(&given.model, profile, total)
    } else {
        (profile.clone(), total.cloned())
    };
    let mut given = given.clone();
    if let Some(near) = near.filter(|_| given.range_mm.is_none()) {
        // What the form itself finds may be far off before its error is known.
        let options = given.options(u_scale_relative);
        given.range_mm = Some(fit::trusted_range(&profile, near, &options)?);
    }
    let given = &given;
    let case = Case {
        profile,
        total,
        given: given.clone(),
        near,
        last: None,
        footprints,
        bends: vec![],
    };
    let (case, best) = case.settled(u_scale_relative)?;
    let mut neighbours = Neighbours {
        case,
        u_scale_relative,
        lines: vec![],
    };
    // Neighbouring fits keep the range, so that their difference is that of the input alone.
    neighbours.case.given.range_mm = Some(best.range_mm);
    let u_length = given.u_length_relative;
    if given.model.slab.is_some() && u_length > 0.0 {
        // The thickness was not measured in pixels and stays.
        neighbours.add(
            "mm per pixel",
            [-u_length, u_length],
            0.5,
            |case, change| {
                case.stretch(1.0 + change);
            },
        )?;
    } else if u_length > 0.0 {
        // Lengths all scale together, and coefficients as their inverse; totals do not move.
        neighbours.lines.push(Contribution::of_change(
            "mm per pixel",
            -best.sigma_a.value * u_length,
            -best.sigma_s_prime.value * u_length,
        ));
    }
    let carried = given.carries_inputs();
    for input in given.bending().filter(|_| !carried) {
        let (low, high) = (given.off(input, -1.0), given.off(input, 1.0));
        let per_u = 1.0 / (high.1 - low.1);
        let ends = [low.0, high.0];
        neighbours.add(input.source(), [0, 1], per_u, |case, end| {
            case.take(&ends[end]);
        })?;
    }
    for variants in given.variants.chunk_by(|a, b| a.name == b.name) {
        neighbours.add_variants(&best, variants)?;
    }
    let model = library::model(&given.model, given.eta)?;
    let found = best.coefficients();
    let own_error = |p: &ProfilePoint| model.relative_error(found, p.radius_mm);
    let points = &neighbours.case.profile.points;
    if points.iter().any(|p| own_error(p) > 0.0) {
        // What the model lacks varies slowly over ln r, nobody knows how: the whole profile off by
        // the model's own standard error, the total not, and one end of it off against the other.
        let radii = points.iter().map(|p| p.radius_mm.ln());
        let (low, high) = radii
            .filter(|x| x.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
        let tilt = |p: &ProfilePoint| {
            let place = 2.0 * (p.radius_mm.ln() - low) / (high - low) - 1.0;
            place.clamp(-1.0, 1.0)
        };
        for (name, tilted) in [
            ("model's own numerics", false),
            ("model's own numerics, near against far", true),
        ] {
            neighbours.add(name, [-1.0, 1.0], 0.5, |case, sign| {
                let shape = |p: &ProfilePoint| if tilted { tilt(p) } else { 1.0 };
                case.scale(|p| 1.0 + sign * own_error(p) * shape(p), 1.0);
            })?;
        }
    }
    if let Some(near) = near {
        // The discrepancy was taken there: where the form goes elsewhere all the same, it and
        // transport tell two stories of the same data, and the difference is in doubt.
        neighbours.lines.push(Contribution::of_change(
            "model against transport",
            TWO_STORIES * (found.sigma_a - near.sigma_a),
            TWO_STORIES * (found.sigma_s_prime - near.sigma_s_prime),
        ));
    }
    let causes: Vec<(&str, f64)> = scale.iter().map(|s| (s.source, s.u_relative)).collect();
    let best = best.with_causes_of_scale(&causes);
    Ok(best.with_contributions(neighbours.lines))
}

/// The data of a channel and what their fit takes as given.
#[derive(Clone)]
struct Case {
    profile: RadialProfile,
    total: Option<TotalReflectance>,
    given: Given,
    /// Where the discrepancy of the model is taken, if it takes part.
    near: Option<Coefficients>,
    /// What the last fit of it found, where the next begins.
    last: Option<Coefficients>,
    /// What the points average over, as given.
    footprints: Arc<Footprints>,
    /// What inputs do to the data that may be off, for the fit to carry along.
    bends: Vec<Direction>,
}

/// Rounds of looking at what inputs do to the data of the medium that was found with the last.
const ROUNDS: usize = 6;
/// Part of its uncertainty by which a coefficient may still move from one round to the next.
const SETTLED: f64 = 0.01;
/// Standard uncertainties of an input over which a slope is taken at least.
const SHORTEST: f64 = 0.3;

impl Case {
    /// The fit that carries along what it is told of its inputs.
    ///
    /// What an input does is taken from where it is stated to where the fit has it, at the medium
    /// that the fit finds: the model is then the one of that input, and not of a linear guess.
    fn settled(mut self, u_scale_relative: f64) -> Result<(Self, Fit)> {
        let mut best = self.fitted(u_scale_relative)?;
        let inputs: Vec<Bending> = self.given.bending().collect();
        if !self.given.carries_inputs() || inputs.is_empty() {
            self.last = Some(best.coefficients());
            return Ok((self, best));
        }
        let mut off = vec![1.0; inputs.len()];
        for _ in 0..ROUNDS {
            self.bends = self.bends(best.coefficients(), &inputs, &off)?;
            let next = self.fitted(u_scale_relative)?;
            let moved = |last: &Estimate, next: &Estimate| {
                (next.value - last.value).abs() > SETTLED * next.u
            };
            let settled = !moved(&best.sigma_a, &next.sigma_a)
                && !moved(&best.sigma_s_prime, &next.sigma_s_prime);
            best = next;
            // From here on the directions change little: the next minimum is beside this one.
            self.last = Some(best.coefficients());
            if settled {
                break;
            }
            let first = self.given.directions.len();
            off.copy_from_slice(&best.nuisances[first..][..inputs.len()]);
        }
        Ok((self, best))
    }

    /// What the `inputs` do to the data of `medium` for one standard uncertainty, each along the way
    /// to where it is off by `off` of them.
    fn bends(
        &self,
        medium: Coefficients,
        inputs: &[Bending],
        off: &[f64],
    ) -> Result<Vec<Direction>> {
        let stated = self.seen(&self.given, medium)?;
        let direction = |source, given: &Given, per_u: f64| -> Result<Direction> {
            let seen = self.seen(given, medium)?;
            let exit = exit_factor(given.exit, given.eta) / exit_factor(given.exit, self.given.eta);
            let change = |to: f64, from: f64| per_u * (exit * to - from);
            Ok(Direction {
                source,
                kind: DirectionKind::Absolute,
                profile: (seen.0.iter().zip(&stated.0))
                    .map(|(to, from)| change(*to, *from))
                    .collect(),
                total: change(seen.1, stated.1),
            })
        };
        let mut directions = vec![];
        for (input, off) in inputs.iter().zip(off) {
            let step = off.abs().max(SHORTEST).copysign(*off);
            let (given, moved) = self.given.off(*input, step);
            // An index of 1 has nowhere to go.
            let per_u = if moved == 0.0 { 0.0 } else { 1.0 / moved };
            directions.push(direction(input.source(), &given, per_u)?);
        }
        Ok(directions)
    }

    /// What the model says of the data where the medium is this, and the total; 0 for one that is
    /// not there.
    fn seen(&self, given: &Given, medium: Coefficients) -> Result<(Vec<f64>, f64)> {
        let model = given.model()?;
        let entry = given.entry_factor(given.eta);
        let mut values = vec![0.0; self.profile.points.len()];
        let footprints = if given.blur() == self.given.blur() {
            Arc::clone(&self.footprints)
        } else {
            self.averaged(given)
        };
        footprints.reflectance(&*model, medium, &mut values);
        for value in &mut values {
            *value *= entry;
        }
        let total = self.total.as_ref().map_or(0.0, |t| {
            let radius = t.radius_max_mm.unwrap_or(f64::INFINITY);
            entry * model.within(medium, radius).value
        });
        Ok((values, total))
    }

    /// What the points average over where this is given.
    fn averaged(&self, given: &Given) -> Arc<Footprints> {
        Arc::new(Footprints::new(&self.profile.points, &given.blur()))
    }

    /// The same where another beam lit them.
    fn lit_by(&mut self, beam: &Beam) {
        if self.given.beam != *beam {
            self.given.beam = beam.clone();
            self.footprints = self.averaged(&self.given);
        }
    }

    /// The data as an input that is otherwise makes them, for a fit that takes it so.
    fn take(&mut self, given: &Given) {
        let factor = exit_factor(given.exit, self.given.eta) / exit_factor(given.exit, given.eta);
        self.scale(|_| factor, factor);
        self.given.eta = given.eta;
        self.lit_by(&given.beam);
    }

    /// The fit, with nothing added to its own uncertainty.
    fn fitted(&self, u_scale_relative: f64) -> Result<Fit> {
        let Self {
            profile,
            total,
            given,
            near,
            last,
            footprints,
            bends,
        } = self;
        let model = given.model()?;
        let of_model = match near {
            Some(near) => match Discrepancy::of(&given.model, given.eta, *near) {
                Some(error) => {
                    let (values, of_total) = self.seen(given, *near)?;
                    let total = total.as_ref().map(|t| {
                        let radius = t.radius_max_mm.unwrap_or(f64::INFINITY);
                        (radius, of_total)
                    });
                    error.directions(&profile.points, &values, total)
                }
                None => vec![],
            },
            None => vec![],
        };
        let mut options = FitOptions {
            near: *near,
            last: *last,
            footprints: Some(Arc::clone(footprints)),
            ..given.options(u_scale_relative)
        };
        options.directions.extend_from_slice(bends);
        options.directions.extend(of_model);
        Ok(fit::fit(profile, total.as_ref(), &*model, &options)?)
    }

    /// Every point times its own factor, and the total times `total`.
    fn scale(&mut self, factor: impl Fn(&ProfilePoint) -> f64, total: f64) {
        for p in &mut self.profile.points {
            let factor = factor(p);
            p.reflectance_per_mm2 *= factor;
            p.u_reflectance_per_mm2 *= factor;
        }
        if let Some(t) = &mut self.total {
            t.total_reflectance *= total;
            t.u_total_reflectance *= total;
        }
    }
}

impl Case {
    /// Every length of the picture times `factor`, and light per area accordingly.
    fn stretch(&mut self, factor: f64) {
        for p in &mut self.profile.points {
            p.radius_mm *= factor;
            p.ring_mm = p.ring_mm.map(|(a, b)| (a * factor, b * factor));
            p.reflectance_per_mm2 /= factor * factor;
            p.u_reflectance_per_mm2 /= factor * factor;
        }
        for direction in &mut self.bends {
            for change in &mut direction.profile {
                *change /= factor * factor;
            }
        }
        if let Some(t) = &mut self.total {
            t.radius_max_mm = t.radius_max_mm.map(|r| r * factor);
        }
        let given = &mut self.given;
        given.range_mm = given.range_mm.map(|(a, b)| (a * factor, b * factor));
        given.pixel_mm *= factor;
        given.beam = match given.beam {
            Beam::Measured(ref spread) => Beam::Measured(spread.stretched(factor)),
            Beam::Point => Beam::Point,
            Beam::Gaussian { fwhm_mm } => Beam::Gaussian {
                fwhm_mm: fwhm_mm * factor,
            },
            Beam::Disk { fwhm_mm } => Beam::Disk {
                fwhm_mm: fwhm_mm * factor,
            },
        };
        self.footprints = self.averaged(&self.given);
        // Lengths and coefficients are each other's inverse.
        self.last = self.last.map(|last| Coefficients {
            sigma_a: last.sigma_a / factor,
            sigma_s_prime: last.sigma_s_prime / factor,
        });
    }
}

/// Fits with one input changed, for the lines of a budget.
struct Neighbours {
    case: Case,
    u_scale_relative: f64,
    lines: Vec<Contribution>,
}

impl Neighbours {
    /// The line of an input that is one number: half the way, or so much of it as `per_u` says,
    /// between the fits at the two `steps` of it, which `change` brings about.
    fn add<Step>(
        &mut self,
        source: &str,
        [low, high]: [Step; 2],
        per_u: f64,
        change: impl Fn(&mut Case, Step),
    ) -> Result<()> {
        let at = |step: Step| -> Result<Coefficients> {
            let mut case = self.case.clone();
            change(&mut case, step);
            Ok(case.fitted(self.u_scale_relative)?.coefficients())
        };
        let (low, high) = (at(low)?, at(high)?);
        self.lines.push(Contribution::of_change(
            source,
            per_u * (high.sigma_a - low.sigma_a),
            per_u * (high.sigma_s_prime - low.sigma_s_prime),
        ));
        Ok(())
    }
}

impl Neighbours {
    /// The line of an input of which `variants` are draws, or the one change.
    fn add_variants(&mut self, best: &Fit, variants: &[Variant]) -> Result<()> {
        let (mut aa, mut mixed, mut ss) = (0.0, 0.0, 0.0);
        for Variant { weight, change, .. } in variants {
            let mut case = self.case.clone();
            match change {
                Change::Beam(beam) => case.lit_by(beam),
                Change::G(g) => case.given.model.g = Some(*g),
            }
            let (from, to) = (
                best.coefficients(),
                case.fitted(self.u_scale_relative)?.coefficients(),
            );
            let a = weight * (to.sigma_a - from.sigma_a);
            let s = weight * (to.sigma_s_prime - from.sigma_s_prime);
            aa += a * a;
            mixed += a * s;
            ss += s * s;
        }
        let Some(first) = variants.first() else {
            return Ok(());
        };
        let (a, s) = (aa.sqrt(), ss.sqrt());
        let draws = variants.len() as f64;
        self.lines.push(Contribution {
            source: first.name.to_owned(),
            u_sigma_a: a,
            u_sigma_s_prime: s,
            correlation: if a * s > 0.0 { mixed / (a * s) } else { 0.0 },
            degrees_of_freedom: if draws > 1.0 { draws } else { f64::INFINITY },
        });
        Ok(())
    }
}

pub(crate) fn exit_factor(exit: Exit, eta: f64) -> f64 {
    match exit {
        Exit::Fresnel { angle, .. } => Exit::Fresnel { eta, angle }.factor(),
        Exit::Lambert => 1.0,
    }
}

fn widened(beam: &Beam, change: f64) -> Beam {
    match beam {
        Beam::Point | Beam::Measured(_) => beam.clone(),
        Beam::Gaussian { fwhm_mm } => Beam::Gaussian {
            fwhm_mm: (fwhm_mm + change).max(0.0),
        },
        Beam::Disk { fwhm_mm } => Beam::Disk {
            fwhm_mm: (fwhm_mm + change).max(0.0),
        },
    }
}

/// What the fitted medium looks like, per incident power, at every radius of `profile`, blurred
/// and scaled as the data are: `(radius_mm, reflectance_per_mm2)`.
///
/// # Errors
///
/// The model is unknown.
pub fn model_curve(profile: &RadialProfile, fit: &Fit, given: &Given) -> Result<Vec<(f64, f64)>> {
    let values = curve_at(profile, fit, given, fit.coefficients())?;
    let radii = profile.points.iter().map(|p| p.radius_mm);
    Ok(radii.zip(values).collect())
}

/// What the standard uncertainties of both coefficients, with their correlation, leave open of each
/// point of [`model_curve`], mm⁻².
///
/// # Errors
///
/// The model is unknown.
pub fn u_model_curve(profile: &RadialProfile, fit: &Fit, given: &Given) -> Result<Vec<f64>> {
    let (a, s, rho) = (fit.sigma_a, fit.sigma_s_prime, fit.correlation);
    // The columns of a root of the covariance: two changes that are independent of each other.
    let changes = [
        (a.u, rho * s.u),
        (0.0, (1.0 - rho * rho).max(0.0).sqrt() * s.u),
    ];
    let mut squares = vec![0.0; profile.points.len()];
    for (of_a, of_s) in changes {
        let moved = |sign: f64| Coefficients {
            sigma_a: (a.value + sign * of_a).max(0.0),
            // A tenth of it is where no fit's u says anything any more.
            sigma_s_prime: (s.value + sign * of_s).max(0.1 * s.value),
        };
        let [up, down] = [1.0, -1.0].map(|sign| curve_at(profile, fit, given, moved(sign)));
        for (square, (up, down)) in squares.iter_mut().zip(up?.into_iter().zip(down?)) {
            *square += (0.5 * (up - down)).powi(2);
        }
    }
    Ok(squares.into_iter().map(f64::sqrt).collect())
}

/// What the transport equation makes of the fitted medium, in the terms of [`model_curve`], with its
/// mean cosine: the model's, or 0 where that knows none, as [`crate::confirm`] takes it.
///
/// `None` where the model is that equation itself, knows of a slab or of an oblique beam, or the
/// equation's table does not reach.
///
/// # Errors
///
/// None: the model is known.
pub fn transport_curve(
    profile: &RadialProfile,
    fit: &Fit,
    given: &Given,
) -> Result<Option<Vec<(f64, f64)>>> {
    let model = &given.model;
    if model.solves_transport() || model.uses_slab() || model.uses_beam() {
        return Ok(None);
    }
    let model = ModelChoice {
        g: Some(model.g.unwrap_or(0.0)),
        ..model.called("monte-carlo")
    };
    if library::model(&model, given.eta).is_err() {
        return Ok(None);
    }
    let given = Given {
        model,
        ..given.clone()
    };
    model_curve(profile, fit, &given).map(Some)
}

/// The model for coefficients `at`, smeared as the profile is, in the profile's terms and with the
/// fit's scale.
fn curve_at(
    profile: &RadialProfile,
    fit: &Fit,
    given: &Given,
    at: Coefficients,
) -> Result<Vec<f64>> {
    let model = library::model(&given.model, given.eta)?;
    let points: Vec<ProfilePoint> = profile
        .points
        .iter()
        .map(|p| ProfilePoint {
            ring_mm: None,
            ..*p
        })
        .collect();
    let mut values = vec![0.0; points.len()];
    let footprints = Footprints::new(&points, &given.blur());
    footprints.reflectance(&*model, at, &mut values);
    let factor = given.entry_factor(given.eta) * fit.scale;
    Ok(values.into_iter().map(|v| factor * v).collect())
}

/// The rows that `fits` add to a table of materials, each with what it took as `given`.
///
/// # Errors
///
/// The model is unknown.
pub fn materials(fits: &[Fit], material: &str, given: &[Given]) -> Result<Vec<Material>> {
    fits.iter()
        .zip(given)
        .map(|(fit, given)| {
            let model = library::model(&given.model, given.eta)?;
            let Coefficients {
                sigma_a,
                sigma_s_prime,
            } = fit.coefficients();
            Ok(Material {
                material: material.to_owned(),
                channel: fit.channel.clone(),
                wavelength_nm: None,
                medium: physics::ReducedMedium {
                    sigma_a,
                    sigma_s_prime,
                    eta: given.eta,
                },
                u_sigma_a_per_mm: Some(fit.sigma_a.u),
                u_sigma_s_prime_per_mm: Some(fit.sigma_s_prime.u),
                correlation: Some(fit.correlation),
                total_reflectance: Some(model.beyond(fit.coefficients(), 0.0)),
                g: given.model.g,
                model: given.model.name.clone(),
                source: format!("beamspot {}", env!("CARGO_PKG_VERSION")),
            })
        })
        .collect()
}

/// The constraint called `name`.
///
/// # Errors
///
/// A name that is not there is answered with those that are.
pub fn constraint(name: &str) -> Result<Constraint> {
    match name {
        "exact" => Ok(Constraint::Exact),
        "joint" => Ok(Constraint::Joint),
        "none" => Ok(Constraint::None),
        _ => {
            let message = format!("no constraint is called `{name}`; there are exact, joint, none");
            Err(Error::new(Kind::Usage, message))
        }
    }
}
