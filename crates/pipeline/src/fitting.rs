//! The fit of every channel, with the uncertainty of what it took as given.

use crate::error::{Blame, Error, Kind, Result};
use crate::library::{self, ModelChoice};
use fit::{Constraint, Contribution, Fit, FitOptions};
use physics::footprint::Beam;
use physics::{
    Blur, Coefficients, Footprints, ForwardModel, Material, ProfilePoint, RadialProfile,
    TotalReflectance, fresnel,
};
use profile::Exit;

/// What a fit takes as given, and how well each is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    /// The model.
    pub model: ModelChoice,
    /// What the total does.
    pub constraint: Constraint,
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
}

impl Given {
    /// Share of the incident power that enters at index `eta`; 1 in the paper's mode.
    pub(crate) fn entry_factor(&self, eta: f64) -> f64 {
        if self.entry_loss {
            fresnel::entry_factor(eta, self.cos_beam)
        } else {
            1.0
        }
    }

    fn blur(&self) -> Blur {
        Blur {
            beam: self.beam,
            pixel_mm: self.pixel_mm,
        }
    }

    fn options(&self, eta: f64, u_scale_relative: f64) -> FitOptions {
        FitOptions {
            constraint: self.constraint,
            range_mm: self.range_mm,
            entry_factor: self.entry_factor(eta),
            u_scale_relative,
            blur: self.blur(),
            ..FitOptions::default()
        }
    }
}

/// Fits one channel; `u_scale_relative` is that of the scale which profile and total share.
///
/// The uncertainties of η, of the scale of length and of the beam's width are added to those of
/// the fit.
///
/// # Errors
///
/// The model is unknown, or the profile cannot constrain a medium.
pub fn fit_channel(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    u_scale_relative: f64,
    given: &Given,
) -> Result<Fit> {
    let model = library::model(&given.model, given.eta)?;
    let options = given.options(given.eta, u_scale_relative);
    let place = || format!("channel {}", profile.channel);
    let best = fit::fit(profile, total, &*model, &options).input(place())?;

    // Neighbouring fits keep the range, so that their difference is that of the input alone.
    let fixed = Given {
        range_mm: Some(best.range_mm),
        ..given.clone()
    };
    let mut contributions = vec![];
    if given.u_eta > 0.0 {
        let at = |eta: f64| -> Result<Coefficients> {
            let model = library::model(&given.model, eta)?;
            let factor = exit_factor(given.exit, given.eta) / exit_factor(given.exit, eta);
            let profile = scaled(profile, |_| factor);
            let total = total.map(|t| TotalReflectance {
                total_reflectance: t.total_reflectance * factor,
                u_total_reflectance: t.u_total_reflectance * factor,
                ..t.clone()
            });
            let options = fixed.options(eta, u_scale_relative);
            let found = fit::fit(&profile, total.as_ref(), &*model, &options).input(place())?;
            Ok(found.coefficients())
        };
        let (low, high) = ((given.eta - given.u_eta).max(1.0), given.eta + given.u_eta);
        let per_u = given.u_eta / (high - low);
        contributions.push(difference(at(low)?, at(high)?, per_u));
    }
    if given.u_length_relative > 0.0 {
        // Lengths all scale together, and coefficients as their inverse; totals do not move.
        contributions.push(Contribution {
            in_sigma_a: -best.sigma_a.value * given.u_length_relative,
            in_sigma_s_prime: -best.sigma_s_prime.value * given.u_length_relative,
        });
    }
    if given.u_fwhm_mm > 0.0 {
        let at = |change: f64| -> Result<Coefficients> {
            let beam = widened(fixed.beam, change);
            let options = Given {
                beam,
                ..fixed.clone()
            }
            .options(given.eta, u_scale_relative);
            Ok(fit::fit(profile, total, &*model, &options)
                .input(place())?
                .coefficients())
        };
        contributions.push(difference(at(-given.u_fwhm_mm)?, at(given.u_fwhm_mm)?, 0.5));
    }
    let found = best.coefficients();
    let own_error = |p: &ProfilePoint| model.relative_error(found, p.radius_mm);
    if profile.points.iter().any(|p| own_error(p) > 0.0) {
        // The whole profile off by the model's own standard error, the total not: the worst way.
        let at = |sign: f64| -> Result<Coefficients> {
            let profile = scaled(profile, |p| 1.0 + sign * own_error(p));
            let options = fixed.options(given.eta, u_scale_relative);
            Ok(fit::fit(&profile, total, &*model, &options)
                .input(place())?
                .coefficients())
        };
        contributions.push(difference(at(-1.0)?, at(1.0)?, 0.5));
    }
    Ok(best.with_contributions(&contributions))
}

fn difference(low: Coefficients, high: Coefficients, factor: f64) -> Contribution {
    Contribution {
        in_sigma_a: factor * (high.sigma_a - low.sigma_a),
        in_sigma_s_prime: factor * (high.sigma_s_prime - low.sigma_s_prime),
    }
}

fn exit_factor(exit: Exit, eta: f64) -> f64 {
    match exit {
        Exit::Fresnel { angle, .. } => Exit::Fresnel { eta, angle }.factor(),
        Exit::Lambert => 1.0,
    }
}

fn widened(beam: Beam, change: f64) -> Beam {
    match beam {
        Beam::Point => Beam::Point,
        Beam::Gaussian { fwhm_mm } => Beam::Gaussian {
            fwhm_mm: (fwhm_mm + change).max(0.0),
        },
        Beam::Disk { fwhm_mm } => Beam::Disk {
            fwhm_mm: (fwhm_mm + change).max(0.0),
        },
    }
}

/// The profile with every point times its `factor`.
fn scaled(profile: &RadialProfile, factor: impl Fn(&ProfilePoint) -> f64) -> RadialProfile {
    let points = profile
        .points
        .iter()
        .map(|p| ProfilePoint {
            reflectance_per_mm2: p.reflectance_per_mm2 * factor(p),
            u_reflectance_per_mm2: p.u_reflectance_per_mm2 * factor(p),
            ..*p
        })
        .collect();
    RadialProfile {
        channel: profile.channel.clone(),
        points,
    }
}

/// What the fitted medium looks like, per incident power, at every radius of `profile`, blurred
/// and scaled as the data are: `(radius_mm, reflectance_per_mm2)`.
///
/// # Errors
///
/// The model is unknown.
pub fn model_curve(profile: &RadialProfile, fit: &Fit, given: &Given) -> Result<Vec<(f64, f64)>> {
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
    footprints.reflectance(&*model, fit.coefficients(), &mut values);
    let factor = given.entry_factor(given.eta) * fit.scale;
    Ok(points
        .iter()
        .zip(values)
        .map(|(p, v)| (p.radius_mm, factor * v))
        .collect())
}

/// The rows that `fits` add to a table of materials.
///
/// # Errors
///
/// The model is unknown.
pub fn materials(fits: &[Fit], material: &str, given: &Given) -> Result<Vec<Material>> {
    let model: Box<dyn ForwardModel> = library::model(&given.model, given.eta)?;
    Ok(fits
        .iter()
        .map(|fit| {
            let Coefficients {
                sigma_a,
                sigma_s_prime,
            } = fit.coefficients();
            Material {
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
            }
        })
        .collect())
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
