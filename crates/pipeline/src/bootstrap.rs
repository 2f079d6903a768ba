//! A parametric bootstrap: the capture drawn again from what was found, every input from its
//! stated uncertainty, and fitted again.
//!
//! It shares with the budget what it is told of the inputs, and nothing of how they get into the
//! coefficients: no derivative, no linearity, no elimination of nuisances.
//!
//! The light is the model's own: what the model's error against transport adds is not drawn, and
//! the spread stands beside the other lines of the budget.

use crate::error::Result;
use crate::fitting::{Given, ScaleInput, Shared, exit_factor, fit_beside, u_relative};
use crate::unknown_g::settled;
use fit::DirectionKind;
use physics::{Blur, Coefficients, Footprints, ProfilePoint, RadialProfile, TotalReflectance};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::Serialize;

/// Any would do; the same one every time, so that the same data give the same bytes.
pub const SEED: u64 = 5;

/// What N replicas of a channel gave.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bootstrap {
    /// Replicas that could be fitted.
    pub replicas: usize,
    /// Replicas that could not.
    pub failed: usize,
    /// Standard deviation of σₐ, mm⁻¹.
    pub u_sigma_a_per_mm: f64,
    /// Standard deviation of σₛ′, mm⁻¹.
    pub u_sigma_s_prime_per_mm: f64,
    /// Their correlation.
    pub correlation: f64,
    /// 2.5 and 97.5 % of σₐ, mm⁻¹.
    pub sigma_a_per_mm: [f64; 2],
    /// 2.5 and 97.5 % of σₛ′, mm⁻¹.
    pub sigma_s_prime_per_mm: [f64; 2],
}

/// A channel's data and what is known of their making, to be drawn again around a medium.
#[derive(Clone, Copy, Debug)]
pub struct Channel<'a> {
    /// Radii, rings and noise; the values do not matter.
    pub profile: &'a RadialProfile,
    /// Noise and circle of the total; the value does not matter.
    pub total: Option<&'a TotalReflectance>,
    /// What makes the scale uncertain.
    pub scale: &'a [ScaleInput],
    /// The rest.
    pub given: &'a Given,
}

impl Channel<'_> {
    /// What the same laboratory would have measured of `medium` on another day: every systematic
    /// drawn once, then the noise.
    ///
    /// # Errors
    ///
    /// The model is unknown.
    pub fn drawn(
        &self,
        medium: Coefficients,
        rng: &mut Pcg64,
    ) -> Result<(RadialProfile, Option<TotalReflectance>)> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let given = self.given;
        let scale = 1.0 + u_relative(self.scale) * normal();
        let eta = (given.eta + given.u_eta * normal()).max(1.0);
        let length = 1.0 + given.u_length_relative * normal();
        let beam = given.drawn_beam(normal());
        let mut truth = Given {
            eta,
            beam: beam.clone(),
            ..given.clone()
        };
        if given.fitted_g().is_some() {
            let place = StandardUniform.sample(rng);
            truth.model.g = given.drawn_g(place);
        }
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let model = truth.model()?;
        // Radii as they are, where the camera's scale of length is off by `length`.
        let stretched = |x: f64| x * length;
        let points: Vec<ProfilePoint> = self
            .profile
            .points
            .iter()
            .map(|p| ProfilePoint {
                ring_mm: p.ring_mm.map(|(a, b)| (stretched(a), stretched(b))),
                radius_mm: stretched(p.radius_mm),
                ..*p
            })
            .collect();
        let blur = Blur {
            beam,
            pixel_mm: stretched(given.pixel_mm),
        };
        let mut light = vec![0.0; points.len()];
        Footprints::new(&points, &blur).reflectance(&*model, medium, &mut light);
        let seen = scale * truth.entry_factor(eta) * exit_factor(given.exit, eta)
            / exit_factor(given.exit, given.eta);
        for light in &mut light {
            *light *= seen * length * length;
        }
        let mut total = self.total.map(|t| {
            let radius = t.radius_max_mm.map_or(f64::INFINITY, stretched);
            seen * model.within(medium, radius).value
        });
        for direction in &given.directions {
            let draw = normal();
            let off = |value: f64, change: f64| match direction.kind {
                DirectionKind::Relative => value * (1.0 + draw * change),
                DirectionKind::Absolute => value + draw * change,
            };
            for (light, change) in light.iter_mut().zip(&direction.profile) {
                *light = off(*light, *change);
            }
            total = total.map(|total| off(total, direction.total));
        }
        let circle = self.total.and_then(|t| t.radius_max_mm).unwrap_or(0.0) * (1.0 + 1e-9);
        let (mut noise_within, mut variance_within) = (0.0, 0.0);
        let drawn: Vec<ProfilePoint> = self
            .profile
            .points
            .iter()
            .zip(&light)
            .map(|(p, light)| {
                let noise = p.u_reflectance_per_mm2 * normal();
                if p.ring_mm.is_some_and(|ring| ring.1 <= circle) {
                    noise_within += p.area_mm2() * noise;
                    variance_within += (p.area_mm2() * p.u_reflectance_per_mm2).powi(2);
                }
                ProfilePoint {
                    reflectance_per_mm2: light + noise,
                    ..*p
                }
            })
            .collect();
        let total = self.total.zip(total).map(|(t, value)| {
            let rest = (t.u_total_reflectance.powi(2) - variance_within).max(0.0);
            TotalReflectance {
                total_reflectance: value + noise_within + rest.sqrt() * normal(),
                ..t.clone()
            }
        });
        let channel = self.profile.channel.clone();
        let points = drawn;
        Ok((RadialProfile { channel, points }, total))
    }

    /// `count` replicas around `medium`, fitted; the same for any number of threads.
    ///
    /// # Errors
    ///
    /// The model is unknown. A replica that cannot be fitted is counted.
    pub fn bootstrap(&self, medium: Coefficients, count: usize, seed: u64) -> Result<Bootstrap> {
        // A g that the data had to tell, they have to tell again.
        let given = self.given.unsettled();
        let shared = Shared::of(&given).at(&self.profile.points, &given);
        let found = (0..count as u64)
            .into_par_iter()
            .map(|replica| {
                // A stream of its own for every replica.
                let mut rng =
                    Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ replica);
                let (profile, total) = self.drawn(medium, &mut rng)?;
                let total = total.as_ref();
                let fit = settled(&profile, total, self.scale, &given)
                    .and_then(|g| fit_beside(&profile, total, self.scale, &g.exact(), &shared));
                Ok(fit.ok().map(|fit| fit.coefficients()))
            })
            .collect::<Result<Vec<Option<Coefficients>>>>()?;
        Ok(Bootstrap::of(&found))
    }
}

impl Bootstrap {
    /// Of the coefficients that the replicas gave, `None` for one that could not be fitted.
    pub fn of(found: &[Option<Coefficients>]) -> Self {
        let fitted: Vec<Coefficients> = found.iter().flatten().copied().collect();
        let count = fitted.len() as f64;
        let column = |f: fn(&Coefficients) -> f64| -> (Vec<f64>, f64) {
            let values: Vec<f64> = fitted.iter().map(f).collect();
            let mean = values.iter().sum::<f64>() / count;
            (values, mean)
        };
        let (a, mean_a) = column(|c| c.sigma_a);
        let (s, mean_s) = column(|c| c.sigma_s_prime);
        let moment = |x: &[f64], mean_x: f64, y: &[f64], mean_y: f64| {
            let products = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y));
            products.sum::<f64>() / (count - 1.0).max(1.0)
        };
        let (aa, ss) = (
            moment(&a, mean_a, &a, mean_a).sqrt(),
            moment(&s, mean_s, &s, mean_s).sqrt(),
        );
        let range = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            let at = |share: f64| {
                let last = values.len().saturating_sub(1) as f64;
                values
                    .get((share * last).round() as usize)
                    .copied()
                    .unwrap_or(0.0)
            };
            [at(0.025), at(0.975)]
        };
        Self {
            replicas: fitted.len(),
            failed: found.len() - fitted.len(),
            u_sigma_a_per_mm: aa,
            u_sigma_s_prime_per_mm: ss,
            correlation: if aa > 0.0 && ss > 0.0 {
                moment(&a, mean_a, &s, mean_s) / (aa * ss)
            } else {
                0.0
            },
            sigma_a_per_mm: range(a),
            sigma_s_prime_per_mm: range(s),
        }
    }
}
