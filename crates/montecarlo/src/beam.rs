//! Light on its way in.

use crate::error::InvalidSimulation;
use crate::random::Uniform;
use physics::LayeredMedium;
use physics::footprint::Beam;
use physics::fresnel;
use std::f64::consts::{FRAC_PI_2, LN_2, TAU};

/// A beam of unit power: its width, and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Incidence {
    /// Power across the beam, centred on radius 0. A tilted beam is round about its own axis, so
    /// its footprint is longer along x by 1/cos; a diffuse one has a round footprint.
    pub beam: Beam,
    /// From which directions it comes.
    pub direction: Direction,
}

/// Directions from which light falls on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Direction {
    /// From one, `angle` radians from the normal, travelling toward +x.
    Collimated {
        /// Angle of incidence outside, radians, in [0, π/2).
        angle: f64,
    },
    /// From all, with equal radiance.
    Diffuse,
}

impl Incidence {
    /// A pencil beam along the normal.
    pub const PENCIL: Self = Self {
        beam: Beam::Point,
        direction: Direction::Collimated { angle: 0.0 },
    };

    /// The same beam, or what is wrong with it.
    ///
    /// # Errors
    ///
    /// [`InvalidSimulation`] for an angle outside [0°, 90°) or a width that is not positive.
    pub fn validated(self) -> Result<Self, InvalidSimulation> {
        if let Direction::Collimated { angle } = self.direction
            && !(0.0..FRAC_PI_2).contains(&angle)
        {
            return Err(InvalidSimulation::Angle {
                degrees: angle.to_degrees(),
            });
        }
        match self.beam {
            Beam::Gaussian { fwhm_mm } | Beam::Disk { fwhm_mm }
                if !(fwhm_mm > 0.0 && fwhm_mm.is_finite()) =>
            {
                Err(InvalidSimulation::BeamWidth { fwhm_mm })
            }
            _ => Ok(self),
        }
    }
}

/// A photon just below the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Launch {
    /// Position on the surface, mm.
    pub(crate) at: [f64; 2],
    /// Direction inside, z downward.
    pub(crate) direction: [f64; 3],
    /// Share that the surface reflected before the photon entered.
    pub(crate) specular: f64,
}

/// Draws photons of a beam at the surface of a medium.
pub(crate) fn launch(
    incidence: &Incidence,
    medium: &LayeredMedium,
    random: &mut impl Uniform,
) -> Launch {
    // Radius of the footprint that holds the share ξ of the power.
    let radius = match &incidence.beam {
        Beam::Measured(spread) => spread.radius_holding(random.uniform()),
        Beam::Point => 0.0,
        Beam::Gaussian { fwhm_mm } => {
            fwhm_mm * (-(1.0 - random.uniform()).ln() / (4.0 * LN_2)).sqrt()
        }
        Beam::Disk { fwhm_mm } => 0.5 * fwhm_mm * random.uniform().sqrt(),
    };
    let at = match incidence.beam {
        Beam::Point => [0.0, 0.0],
        Beam::Gaussian { .. } | Beam::Disk { .. } | Beam::Measured(_) => {
            let (sin, cos) = (TAU * random.uniform()).sin_cos();
            [radius * cos, radius * sin]
        }
    };
    let (cos, (sin_phi, cos_phi)) = match incidence.direction {
        Direction::Collimated { angle } => (angle.cos(), (0.0, 1.0)),
        // Irradiance weighs radiance with the cosine, so cos² is uniform.
        Direction::Diffuse => (
            (1.0 - random.uniform()).sqrt(),
            (TAU * random.uniform()).sin_cos(),
        ),
    };
    let at = match incidence.direction {
        Direction::Collimated { .. } => [at[0] / cos, at[1]],
        Direction::Diffuse => at,
    };
    let eta_ti = medium.layers[0].eta / medium.eta_above;
    let specular = fresnel::reflectance(eta_ti, cos);
    let inside = fresnel::refracted_cos(eta_ti, cos).unwrap_or(0.0);
    let along = (1.0 - inside * inside).max(0.0).sqrt();
    Launch {
        at,
        direction: [along * cos_phi, along * sin_phi, inside],
        specular,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream64;
    use physics::Medium;

    fn launches(incidence: &Incidence) -> Vec<Launch> {
        let half_space = LayeredMedium::half_space(&Medium {
            sigma_a: 1.0,
            sigma_s: 1.0,
            g: 0.0,
            eta: 1.5,
        });
        let mut random = Stream64::new(3, 0);
        (0..40_000)
            .map(|_| launch(incidence, &half_space, &mut random))
            .collect()
    }

    #[test]
    fn half_the_power_falls_where_the_width_says() {
        let half_within = |beam: Beam, radius: f64| {
            let all = launches(&Incidence {
                beam: beam.clone(),
                ..Incidence::PENCIL
            });
            let within = all
                .iter()
                .filter(|l| l.at[0].hypot(l.at[1]) < radius)
                .count();
            let share = within as f64 / all.len() as f64;
            // Four standard errors of a fair coin thrown 40,000 times.
            assert!((share - 0.5).abs() < 0.01, "{beam:?}: {share}");
        };
        // A Gaussian's half-width at half maximum holds half of its power; so does 1/√2 of a disk.
        half_within(Beam::Gaussian { fwhm_mm: 0.8 }, 0.4);
        half_within(Beam::Disk { fwhm_mm: 0.8 }, 0.4 / 2.0_f64.sqrt());
        // A fifth of the light in a disk of 0.2 mm, the rest in a ring: half of all at
        // r² = 0.04 + 3/8 (0.36 − 0.04).
        let spread = physics::RadialSpread::new(vec![0.0, 0.2, 0.6], &[0.2, 0.8]).unwrap();
        half_within(Beam::Measured(spread), 0.4);
    }

    #[test]
    fn oblique_light_is_refracted_toward_the_normal() {
        let direction = Direction::Collimated { angle: 1.0 };
        let l = launches(&Incidence {
            direction,
            ..Incidence::PENCIL
        })[0];
        assert!(
            (l.direction[0] - 1.0_f64.sin() / 1.5).abs() < 1e-15,
            "{l:?}"
        );
        assert!((l.specular - fresnel::reflectance(1.5, 1.0_f64.cos())).abs() < 1e-15);
    }

    #[test]
    fn diffuse_light_loses_the_average_reflectance() {
        let all = launches(&Incidence {
            direction: Direction::Diffuse,
            ..Incidence::PENCIL
        });
        let mean = all.iter().map(|l| l.specular).sum::<f64>() / all.len() as f64;
        // The spread of F over the hemisphere is 0.12: four standard errors.
        assert!(
            (mean - fresnel::diffuse_reflectance(1.5)).abs() < 0.0025,
            "{mean}"
        );
    }

    #[test]
    fn bad_beams_are_refused() {
        let tilted = |angle| {
            let direction = Direction::Collimated { angle };
            Incidence {
                direction,
                ..Incidence::PENCIL
            }
            .validated()
        };
        assert!(tilted(FRAC_PI_2).is_err() && tilted(-0.1).is_err() && tilted(f64::NAN).is_err());
        let beam = Beam::Disk { fwhm_mm: 0.0 };
        let wide = Incidence {
            beam,
            ..Incidence::PENCIL
        }
        .validated();
        assert_eq!(wide, Err(InvalidSimulation::BeamWidth { fwhm_mm: 0.0 }));
    }
}
