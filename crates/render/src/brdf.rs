//! The method `brdf`: light leaves where it enters.

use crate::Vec3;
use crate::scene::Scene;
use crate::surface::{Point, Shader, arrives};
use physics::brdf::{BrdfApproximation, Directions};
use physics::random::Stream;
use physics::{DiffuseFresnel, Dipole, Medium};
use std::borrow::Cow;
use std::f64::consts::PI;

/// Which BRDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The dipole's total, evenly in all directions, with nothing lost at the surface.
    Lambert,
    /// Jensen et al. (2001), section 2.4: single scattering and diffuse.
    Jensen,
}

/// A BRDF for each solid and channel; under a texture, that of the medium at the point.
pub struct Brdf {
    kind: Kind,
    of_object: Vec<Vec<OfMedium>>,
}

/// Jensen's, and the dipole's total.
type OfMedium = (BrdfApproximation, f64);

fn of_medium(medium: &Medium) -> OfMedium {
    let total = Dipole::new(&medium.reduced(), DiffuseFresnel::Exact).total_reflectance();
    (BrdfApproximation::new(medium, DiffuseFresnel::Exact), total)
}

impl Brdf {
    /// The BRDFs of the materials of `scene`.
    pub fn new(scene: &Scene, kind: Kind) -> Self {
        let of_object = scene
            .objects
            .iter()
            .map(|o| o.material.media.iter().map(of_medium).collect())
            .collect();
        Self { kind, of_object }
    }
}

/// Cosine of the azimuth between two directions, 1 where they are on opposite sides.
pub(crate) fn azimuth(normal: Vec3, a: Vec3, b: Vec3) -> f64 {
    let flat = |d: Vec3| (d - d.dot(normal) * normal).normalize_or_zero();
    -flat(a).dot(flat(b))
}

impl Shader for Brdf {
    fn shade(
        &self,
        scene: &Scene,
        point: &Point,
        view: Vec3,
        rng: &mut Stream,
        single: &mut [f64],
        diffuse: &mut [f64],
    ) {
        let here: Cow<[OfMedium]> = match point.coordinates {
            None => Cow::Borrowed(&self.of_object[point.object]),
            Some(_) => scene.media(point).iter().map(of_medium).collect(),
        };
        for (index, lamp) in scene.lamps.iter().enumerate() {
            let Some(incident) = arrives(scene, index, point, rng) else {
                continue;
            };
            let directions = Directions {
                cos_in: incident.toward.dot(point.normal).min(1.0),
                cos_out: view.dot(point.normal).clamp(1e-6, 1.0),
                cos_azimuth: azimuth(point.normal, incident.toward, view),
            };
            let irradiance = incident.irradiance * directions.cos_in;
            for (channel, (brdf, total)) in here.iter().enumerate() {
                let light = irradiance * lamp.strength[channel];
                match self.kind {
                    Kind::Lambert => diffuse[channel] += light * total / PI,
                    Kind::Jensen => {
                        single[channel] += light * brdf.single_scattering(&directions);
                        diffuse[channel] += light * brdf.diffuse(&directions);
                    }
                }
            }
        }
    }
}
