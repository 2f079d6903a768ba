//! Many profiles on the same radii at once.

use crate::conclude::Summary;
use crate::geometry::Geometry;
use crate::options::{Constraint, FitOptions};
use crate::problem::{self, Data, Measured, Memory};
use crate::result::{Estimate, Fit, FitError, Termination, Warning};
use physics::{ForwardModel, ProfilePoint};
use rayon::prelude::*;

/// Profiles that share their radii, as arrays.
#[derive(Clone, Copy, Debug)]
pub struct Profiles<'a> {
    /// Where the points lie: rings and radii; what else these hold is not looked at.
    pub points: &'a [ProfilePoint],
    /// Exitance per incident power, mm⁻², by profile and then by point: n × points.
    pub reflectance_per_mm2: &'a [f64],
    /// Standard uncertainties, mm⁻²: n × points, or one run of points that all profiles share.
    pub u_reflectance_per_mm2: &'a [f64],
    /// The totals, where the constraint needs them.
    pub totals: Option<Totals<'a>>,
}

/// Total reflectances of many profiles.
#[derive(Clone, Copy, Debug)]
pub struct Totals<'a> {
    /// Exitance per incident power inside the circle: n.
    pub total_reflectance: &'a [f64],
    /// Standard uncertainty that each has for itself: n.
    pub u_total_reflectance: &'a [f64],
    /// Radius of the circle of all, mm; `None` for the whole plane. As in [`crate::fit`].
    pub radius_max_mm: Option<f64>,
}

/// What [`fit_many`] finds, one array a quantity, one number a profile.
///
/// A profile that could not be fitted has NaN in every array, [`None`] for its termination and
/// its reason in [`Self::errors`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ManyFits {
    /// Absorption coefficients, mm⁻¹.
    pub sigma_a: Vec<f64>,
    /// Their standard uncertainties, mm⁻¹.
    pub u_sigma_a: Vec<f64>,
    /// Lower ends of their 95 % intervals, mm⁻¹.
    pub sigma_a_low: Vec<f64>,
    /// Upper ends of their 95 % intervals, mm⁻¹.
    pub sigma_a_high: Vec<f64>,
    /// Reduced scattering coefficients, mm⁻¹.
    pub sigma_s_prime: Vec<f64>,
    /// Their standard uncertainties, mm⁻¹.
    pub u_sigma_s_prime: Vec<f64>,
    /// Lower ends of their 95 % intervals, mm⁻¹.
    pub sigma_s_prime_low: Vec<f64>,
    /// Upper ends of their 95 % intervals, mm⁻¹.
    pub sigma_s_prime_high: Vec<f64>,
    /// Correlations of the errors of the two.
    pub correlation: Vec<f64>,
    /// Fitted scale factors.
    pub scale: Vec<f64>,
    /// χ² per degree of freedom. Where it is improbable, the uncertainties are widened by its
    /// root.
    pub reduced_chi2: Vec<f64>,
    /// First radius that took part, mm; the last is that of the profile or of the options.
    pub start_mm: Vec<f64>,
    /// Shares of the light that leave beyond the last radius, by the model.
    pub share_outside: Vec<f64>,
    /// How the searches ended.
    pub termination: Vec<Option<Termination>>,
    /// Which profiles could not be fitted, and why. Channels are named by the profile's index.
    pub errors: Vec<(usize, FitError)>,
    /// What should be known of which profile, in their order: what [`crate::fit`] says of each, but
    /// for [`Warning::OnePointDecides`] and [`Warning::InputOff`], which would want the model once
    /// more.
    pub warnings: Vec<(usize, Warning)>,
}

/// Profiles that one thread fits in one go, with one memory.
const RUN: usize = 64;

/// Fits every one of many profiles that share radii and options, on all threads of the current
/// `rayon` pool.
///
/// The same as [`crate::fit`] of each, to the last bit, on any number of threads; but what the
/// profiles share is prepared once, no memory is allocated from one to the next, and the results
/// are arrays. A profile that cannot be fitted does not stop the others.
///
/// # Errors
///
/// [`FitError::BadOption`] where the arrays do not belong together;
/// [`FitError::BeamWiderThanProfile`] and a wrong option are everybody's.
pub fn fit_many(
    profiles: &Profiles,
    model: &dyn ForwardModel,
    options: &FitOptions,
) -> Result<ManyFits, FitError> {
    let points = profiles.points.len();
    let expect = |name, found: usize, right: bool, expected| {
        let found = found as f64;
        let wrong = FitError::BadOption {
            name,
            found,
            expected,
        };
        if right { Ok(()) } else { Err(wrong) }
    };
    let values = profiles.reflectance_per_mm2;
    let u = profiles.u_reflectance_per_mm2;
    expect("the number of points", points, points > 0, "above 0")?;
    let whole = values.len().is_multiple_of(points);
    let expected = "a multiple of the number of points";
    expect("the number of reflectances", values.len(), whole, expected)?;
    let n = values.len() / points;
    let right = u.len() == values.len() || u.len() == points;
    let expected = "that of the reflectances or of the points";
    expect("the number of uncertainties", u.len(), right, expected)?;
    for length in profiles
        .totals
        .iter()
        .flat_map(|t| [t.total_reflectance.len(), t.u_total_reflectance.len()])
    {
        let expected = "that of the profiles";
        expect("the number of totals", length, length == n, expected)?;
    }
    problem::check_options(options, points)?;
    let all = || "all".to_owned();
    problem::check_radii(&all, profiles.points.iter().map(|p| p.radius_mm))?;
    let geometry = Geometry::new(profiles.points, &all, options)?;

    let one = |memory: &mut Memory, i: usize, warnings: &mut Vec<Warning>| {
        let channel = || i.to_string();
        let row = &values[i * points..(i + 1) * points];
        let all_u = if u.len() == points {
            u
        } else {
            &u[i * points..(i + 1) * points]
        };
        let total = profiles.totals.map(|t| Measured {
            total: t.total_reflectance[i],
            u: t.u_total_reflectance[i],
            radius_max_mm: t.radius_max_mm,
        });
        let pairs = row.iter().copied().zip(all_u.iter().copied());
        problem::check_values(&channel, profiles.points, pairs, total, options)?;
        problem::check_total(&channel, total, options)?;
        let fitted = geometry
            .indices
            .first()
            .map_or(0..0, |&first| first..first + geometry.len());
        // The geometry's points are all neighbours unless rings overlap in a strange way.
        let contiguous = geometry
            .indices
            .last()
            .is_none_or(|&last| last + 1 == fitted.end);
        let (picked, picked_u): (Vec<f64>, Vec<f64>);
        let (value, u) = if contiguous {
            (&row[fitted.clone()], &all_u[fitted])
        } else {
            picked = geometry.indices.iter().map(|&j| row[j]).collect();
            picked_u = geometry.indices.iter().map(|&j| all_u[j]).collect();
            (&picked[..], &picked_u[..])
        };
        let data = Data {
            geometry: &geometry,
            value,
            u,
            total: total.filter(|_| options.constraint != Constraint::None),
            model,
            options,
            channel: &channel,
        };
        let (mut problem, solution, near) = crate::search(data, std::mem::take(memory))?;
        let summary = problem.summary(&solution);
        *memory = problem.memory;
        warnings.extend(near);
        summary.warn(options.u_scale_relative, options.entry_factor, warnings);
        let measured = profiles.points.iter().zip(row.iter().zip(all_u));
        let measured = measured.map(|(p, (value, u))| (p.radius_mm, *value, *u));
        warnings.extend(problem::negative_light(measured));
        Ok::<Summary, FitError>(summary)
    };

    let mut summaries: Vec<Option<Summary>> = vec![None; n];
    // Of every run, in the order of its profiles.
    let said: Vec<(Vec<_>, Vec<_>)> = summaries
        .par_chunks_mut(RUN)
        .enumerate()
        .map_init(Default::default, |(memory, said), (run, out)| {
            let (mut errors, mut warnings) = (vec![], vec![]);
            for (j, out) in out.iter_mut().enumerate() {
                let i = run * RUN + j;
                match one(memory, i, said) {
                    Ok(summary) => *out = Some(summary),
                    Err(error) => errors.push((i, error)),
                }
                warnings.extend(said.drain(..).map(|warning| (i, warning)));
            }
            (errors, warnings)
        })
        .collect();
    let (errors, warnings): (Vec<_>, Vec<_>) = said.into_iter().unzip();
    let mut found = ManyFits::new(&summaries, errors.into_iter().flatten().collect());
    found.warnings = warnings.into_iter().flatten().collect();
    Ok(found)
}

impl ManyFits {
    /// Puts what [`crate::fit`] says of profile `i`, asked in another way, in the place of what is
    /// there, but for its warnings. Nothing where there is no such profile.
    pub fn replace(&mut self, i: usize, found: Result<&Fit, FitError>) {
        if i >= self.sigma_a.len() {
            return;
        }
        self.errors.retain(|e| e.0 != i);
        match found {
            Ok(fit) => {
                let rest = [
                    fit.correlation,
                    fit.scale,
                    fit.reduced_chi2,
                    fit.range_mm.0,
                    fit.share_outside,
                ];
                let numbers = row(&fit.sigma_a, &fit.sigma_s_prime, rest);
                self.put(i, numbers, Some(fit.termination));
            }
            Err(error) => {
                self.put(i, [f64::NAN; COLUMNS], None);
                self.errors.push((i, error));
                self.errors.sort_by_key(|e| e.0);
            }
        }
    }

    fn new(summaries: &[Option<Summary>], errors: Vec<(usize, FitError)>) -> Self {
        let mut all = Self {
            termination: vec![None; summaries.len()],
            errors,
            ..Self::default()
        };
        for column in all.columns() {
            *column = vec![f64::NAN; summaries.len()];
        }
        for (i, summary) in summaries.iter().enumerate() {
            let Some(s) = summary else { continue };
            let rest = [
                s.correlation,
                s.scale,
                s.reduced_chi2,
                s.range_mm.0,
                s.share_outside,
            ];
            let numbers = row(&s.sigma_a, &s.sigma_s_prime, rest);
            all.put(i, numbers, Some(s.termination));
        }
        all
    }

    fn put(&mut self, i: usize, row: [f64; COLUMNS], termination: Option<Termination>) {
        self.termination[i] = termination;
        for (column, number) in self.columns().into_iter().zip(row) {
            column[i] = number;
        }
    }

    /// In the order of [`row`].
    fn columns(&mut self) -> [&mut Vec<f64>; COLUMNS] {
        [
            &mut self.sigma_a,
            &mut self.u_sigma_a,
            &mut self.sigma_a_low,
            &mut self.sigma_a_high,
            &mut self.sigma_s_prime,
            &mut self.u_sigma_s_prime,
            &mut self.sigma_s_prime_low,
            &mut self.sigma_s_prime_high,
            &mut self.correlation,
            &mut self.scale,
            &mut self.reduced_chi2,
            &mut self.start_mm,
            &mut self.share_outside,
        ]
    }
}

const COLUMNS: usize = 13;

/// What one profile has in every column; `rest` is what is no part of the two estimates.
fn row(sigma_a: &Estimate, sigma_s_prime: &Estimate, rest: [f64; 5]) -> [f64; COLUMNS] {
    let of = |e: &Estimate| [e.value, e.u, e.ci95.0, e.ci95.1];
    let ([a, b, c, d], [e, f, g, h]) = (of(sigma_a), of(sigma_s_prime));
    let [i, j, k, l, m] = rest;
    [a, b, c, d, e, f, g, h, i, j, k, l, m]
}
