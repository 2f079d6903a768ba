//! Confirmation of a fit by Monte Carlo: Figure 6 of Jensen et al. (2001), for every material.

use crate::error::Result;
use crate::fitting::Given;
use crate::library;
use crate::simulation::{self, SpotRun};
use fit::Fit;
use physics::{Blur, Footprints, Medium, ProfilePoint, RadialProfile, ReducedMedium, fresnel};
use serde::Serialize;

/// Photons that a confirmation follows.
pub const PHOTONS: u64 = 1_000_000;
/// Any would do; the same one every time, so that the same fit is confirmed by the same bytes.
pub(crate) const SEED: u64 = 6;
/// Paths longer than so many times r²σₜ′ of the picture leave, if at all, far outside it.
const LONGEST_PATHS: f64 = 10.0;
/// Rings that too few photons reached say nothing about the model.
const WORST_RELATIVE_U: f64 = 0.3;

/// The fitted medium, by its model and by counted photons.
#[derive(Clone, Debug, Serialize)]
pub struct Confirmation {
    /// Photons followed.
    pub photons: u64,
    /// Mean cosine of their scattering: the fit knows σₛ′ alone.
    pub g: f64,
    /// Share of the entering power that leaves inside the picture, as counted, and its u.
    pub total_reflectance: f64,
    /// Standard error of that.
    pub u_total_reflectance: f64,
    /// The same by the model.
    pub total_reflectance_model: f64,
    /// Root mean square over the fitted rings of photons/model − 1, the photons' own noise taken
    /// out: the error of the model here.
    pub model_error: Option<f64>,
    /// The comparison decade by decade of radius.
    pub decades: Vec<Decade>,
    /// What was counted, per power that enters.
    #[serde(skip)]
    pub curve: Vec<ProfilePoint>,
}

/// Photons against model within a decade of radius.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Decade {
    /// From here, mm,
    pub radius_min_mm: f64,
    /// to here, mm.
    pub radius_max_mm: f64,
    /// Rings compared.
    pub rings: usize,
    /// Σ((photons − model)/u)².
    pub chi2: f64,
    /// Mean of photons/model − 1, each ring by its weight.
    pub mean_difference: f64,
    /// Standard error of that mean.
    pub u_mean_difference: f64,
}

/// Simulates the medium of `fit` and compares it with the model on the rings of `profile`.
///
/// `None` where the profile has no rings that cover the plane from the beam outward.
///
/// # Errors
///
/// The fitted medium cannot be simulated.
pub fn confirm(fit: &Fit, profile: &RadialProfile, given: &Given) -> Result<Option<Confirmation>> {
    let Some(edges) = contiguous_edges(profile) else {
        return Ok(None);
    };
    let g = given.model.g.unwrap_or(0.0);
    let c = fit.coefficients();
    let medium: Medium = ReducedMedium {
        sigma_a: c.sigma_a,
        sigma_s_prime: c.sigma_s_prime,
        eta: given.eta,
    }
    .with_g(g);
    let slab = given.model.slab.map(|slab| slab.at(given.eta));
    let reach = edges.last().copied().unwrap_or(0.0);
    let cutoff = LONGEST_PATHS * reach * reach * c.sigma_t_prime();
    let beam = given.beam.clone();
    let run = simulation::spot(&medium, slab, beam, edges, cutoff, PHOTONS, SEED)?;
    Ok(Some(compare(&run, fit, given, g)?))
}

/// The edges of rings that follow one another from radius 0.
fn contiguous_edges(profile: &RadialProfile) -> Option<Vec<f64>> {
    let mut edges = vec![0.0];
    for point in &profile.points {
        let (inner, outer) = point.ring_mm?;
        let last = *edges.last()?;
        if (inner - last).abs() > 1e-9 * outer {
            return None;
        }
        edges.push(outer);
    }
    Some(edges)
}

fn compare(run: &SpotRun, fit: &Fit, given: &Given, g: f64) -> Result<Confirmation> {
    let model = library::model(&given.model, given.eta)?;
    let entering = fresnel::entry_factor(given.eta, 1.0);
    let curve: Vec<ProfilePoint> = run
        .points
        .iter()
        .map(|p| ProfilePoint {
            reflectance_per_mm2: p.reflectance_per_mm2 / entering,
            u_reflectance_per_mm2: p.u_reflectance_per_mm2 / entering,
            ..*p
        })
        .collect();
    let mut expected = vec![0.0; curve.len()];
    let blur = Blur {
        beam: given.beam.clone(),
        pixel_mm: 0.0,
    };
    Footprints::new(&curve, &blur).reflectance(&*model, fit.coefficients(), &mut expected);

    let mut decades: Vec<(i32, Sums)> = vec![];
    let mut range = Sums::default();
    for (p, expected) in curve.iter().zip(expected) {
        let u = p.u_reflectance_per_mm2 / expected;
        let difference = p.reflectance_per_mm2 / expected - 1.0;
        if !(u > 0.0 && u < WORST_RELATIVE_U && difference.is_finite()) {
            continue;
        }
        let decade = p.radius_mm.log10().floor() as i32;
        match decades.last_mut() {
            Some((last, sums)) if *last == decade => sums.add(difference, u),
            _ => {
                let mut sums = Sums::default();
                sums.add(difference, u);
                decades.push((decade, sums));
            }
        }
        if p.radius_mm >= fit.range_mm.0 && p.radius_mm <= fit.range_mm.1 {
            range.add(difference, u);
        }
    }
    let reach = curve.last().and_then(|p| p.ring_mm).map_or(0.0, |r| r.1);
    let inside: f64 = curve
        .iter()
        .map(|p| p.area_mm2() * p.reflectance_per_mm2)
        .sum();
    Ok(Confirmation {
        photons: run.photons,
        g,
        total_reflectance: inside,
        // Of N photons each weighs at most 1, so the binomial error is an upper bound.
        u_total_reflectance: (inside * (1.0 - inside).max(0.0) / run.photons as f64).sqrt(),
        total_reflectance_model: model.within(fit.coefficients(), reach).value,
        model_error: range.rms(),
        decades: decades
            .into_iter()
            .map(|(decade, sums)| Decade {
                radius_min_mm: 10.0_f64.powi(decade),
                radius_max_mm: 10.0_f64.powi(decade + 1).min(reach),
                rings: sums.count,
                chi2: sums.chi2,
                mean_difference: sums.weighted / sums.weight,
                u_mean_difference: sums.weight.sqrt().recip(),
            })
            .collect(),
        curve,
    })
}

/// Sums over rings of a relative difference and its u.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: usize,
    chi2: f64,
    weight: f64,
    weighted: f64,
    squares: f64,
    noise: f64,
}

impl Sums {
    fn add(&mut self, difference: f64, u: f64) {
        self.count += 1;
        self.chi2 += (difference / u).powi(2);
        self.weight += u.powi(-2);
        self.weighted += difference * u.powi(-2);
        self.squares += difference * difference;
        self.noise += u * u;
    }

    /// Root mean square with the noise taken out.
    fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| {
            ((self.squares - self.noise) / self.count as f64)
                .max(0.0)
                .sqrt()
        })
    }
}

impl Confirmation {
    /// What it says, in a sentence.
    pub fn sentence(&self) -> Option<String> {
        let error = self.model_error?;
        Some(format!(
            "Monte Carlo ({} photons, g = {}): over the fitted radii the model is {:.1} % off the \
             transport of the very medium it found (rms); its total is {:.4}, by photons {:.4}",
            self.photons,
            self.g,
            100.0 * error,
            self.total_reflectance_model,
            self.total_reflectance
        ))
    }
}
