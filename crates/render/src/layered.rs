//! BRDF and BTDF of layers: `brdf` after Hanrahan and Krueger.
//!
//! Light that scattered once is a closed form with all of its directions. What scattered more
//! often has lost most of them: it comes as a table of its mean over azimuth, from whoever can solve
//! the layers.

use crate::Vec3;
use crate::brdf::azimuth;
use crate::scene::Scene;
use crate::surface::{Point, Shader, through_surface, unhidden};
use physics::FirstOrder;
use physics::brdf::Directions;
use physics::random::Stream;

/// Light that scattered more than once, between cosines, mean over azimuth, sr⁻¹.
#[derive(Clone, Debug, PartialEq)]
pub struct Multiple {
    /// Cosines to the normal outside, increasing.
    pub cosines: Vec<f64>,
    /// BRDF: for each cosine of the light, one value a cosine of the view.
    pub brdf: Vec<Vec<f64>>,
    /// BTDF, likewise.
    pub btdf: Vec<Vec<f64>>,
}

impl Multiple {
    /// Between the four nearest nodes; beyond the last, the last.
    fn at(&self, table: &[Vec<f64>], cos_in: f64, cos_out: f64) -> f64 {
        let place = |cos: f64| {
            let last = self.cosines.len() - 1;
            let next = self.cosines.partition_point(|c| *c < cos).clamp(1, last);
            let (low, high) = (self.cosines[next - 1], self.cosines[next]);
            (next, ((cos - low) / (high - low)).clamp(0.0, 1.0))
        };
        let ((i, a), (o, b)) = (place(cos_in), place(cos_out));
        let row = |row: &[f64]| row[o - 1] + b * (row[o] - row[o - 1]);
        let (before, after) = (row(&table[i - 1]), row(&table[i]));
        before + a * (after - before)
    }
}

/// Layers in one channel.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Light that scattered once.
    pub once: FirstOrder,
    /// Light that scattered more often.
    pub multiple: Multiple,
    /// Whether what is behind is the open: then light shines through. Otherwise it is the inside
    /// of a body, in which light that goes through the layers stays.
    pub open_behind: bool,
}

impl Sheet {
    /// Subsurface BRDF of light that scattered once and more often, sr⁻¹.
    pub fn brdf(&self, directions: &Directions) -> (f64, f64) {
        let Directions {
            cos_in, cos_out, ..
        } = *directions;
        let more = self.multiple.at(&self.multiple.brdf, cos_in, cos_out);
        (self.once.brdf(directions), more)
    }

    /// The same of the BTDF.
    pub fn btdf(&self, directions: &Directions) -> (f64, f64) {
        let Directions {
            cos_in, cos_out, ..
        } = *directions;
        let more = self.multiple.at(&self.multiple.btdf, cos_in, cos_out);
        (self.once.btdf(directions), more)
    }
}

/// The surfaces of solids as layers.
pub struct Layered {
    of_object: Vec<Vec<Sheet>>,
}

impl Layered {
    /// One sheet for each solid and channel.
    ///
    /// # Panics
    ///
    /// If the lists do not fit the scene.
    pub fn new(scene: &Scene, of_object: Vec<Vec<Sheet>>) -> Self {
        scene.assert_one_each(&of_object);
        Self { of_object }
    }
}

impl Shader for Layered {
    fn shade(
        &self,
        scene: &Scene,
        point: &Point,
        view: Vec3,
        rng: &mut Stream,
        single: &mut [f64],
        diffuse: &mut [f64],
    ) {
        let sheets = &self.of_object[point.object];
        let cos_out = view.dot(point.normal).clamp(1e-6, 1.0);
        for lamp in &scene.lamps {
            // A sheet is lit from both sides.
            for (behind, normal) in [(false, point.normal), (true, -point.normal)] {
                if behind && !sheets.iter().any(|sheet| sheet.open_behind) {
                    continue;
                }
                let Some(incident) = lamp.light.shine(point.at, Some(normal), rng) else {
                    continue;
                };
                let true_normal = if behind {
                    -point.true_normal
                } else {
                    point.true_normal
                };
                let cos_in = incident.toward.dot(normal).min(1.0);
                if cos_in <= 0.0 || incident.toward.dot(true_normal) <= 0.0 {
                    continue;
                }
                let open = if behind {
                    through_surface(scene, point.object, point.at, &incident).is_some()
                } else {
                    unhidden(scene, point.at, &incident)
                };
                if !open {
                    continue;
                }
                // Light that keeps its way along the surface has an azimuth of 0 on either side.
                let directions = Directions {
                    cos_in,
                    cos_out,
                    cos_azimuth: azimuth(point.normal, incident.toward, view),
                };
                let irradiance = incident.irradiance * cos_in;
                for (channel, sheet) in sheets.iter().enumerate() {
                    let (once, more) = match behind {
                        false => sheet.brdf(&directions),
                        true if sheet.open_behind => sheet.btdf(&directions),
                        true => continue,
                    };
                    let light = irradiance * lamp.strength[channel];
                    single[channel] += light * once;
                    diffuse[channel] += light * more;
                }
            }
        }
    }
}
