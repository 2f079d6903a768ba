//! Layers and surfaces added up.

use crate::directions::Directions;
use crate::operator::Operator;
use crate::slab::Slab;
use nalgebra::DVector;
use physics::layered::InvalidLayers;
use physics::{Layer, LayeredMedium, first_order, fresnel};
use std::f64::consts::PI;
use thiserror::Error;

/// How finely directions are told apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Resolution {
    /// Directions on the widest panel.
    pub(crate) nodes: usize,
    /// Legendre moments of a phase function.
    pub(crate) moments: usize,
}

impl Resolution {
    pub(crate) const FINE: Self = Self {
        nodes: 24,
        moments: 48,
    };
}

/// A question that has no answer.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CannotSolve {
    /// The layers do not make a medium.
    #[error(transparent)]
    Layers(#[from] InvalidLayers),
    /// An angle at or past 90 degrees.
    #[error("the cosine between direction and normal must be above 0 and at most 1, got {0}")]
    Cosine(f64),
}

/// What a stack of layers does with light, per unit of incident power; angles are outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Share reflected by the first surface, per incidence.
    pub specular: Vec<f64>,
    /// Share reflected in all, the specular part included, per incidence.
    pub reflectance: Vec<f64>,
    /// Share transmitted in all, per incidence.
    pub transmittance: Vec<f64>,
    /// Share transmitted without having been scattered, per incidence.
    pub unscattered_transmittance: Vec<f64>,
    /// BRDF of light that was scattered inside, mean over azimuth, sr⁻¹: per incidence, one value
    /// per view.
    pub brdf: Vec<Vec<f64>>,
    /// BTDF of light that was scattered inside, mean over azimuth, sr⁻¹: per incidence, one value
    /// per view behind the last layer. 0 where that has no end.
    pub btdf: Vec<Vec<f64>>,
    /// Reflectance under light from all directions with equal radiance.
    pub diffuse_reflectance: f64,
    /// Transmittance under such light.
    pub diffuse_transmittance: f64,
}

/// Solves `medium` for light that comes in with each of `cos_in` and is looked at with each of
/// `cos_out`, cosines to the normal outside, in (0, 1].
///
/// Totals are good to about 1e-6, values by angle to about 1e-4 of them, where the phase function
/// is not much sharper than g = 0.95.
///
/// # Errors
///
/// [`CannotSolve`] for layers that are none and cosines outside (0, 1].
///
/// # Source
///
/// Adding and doubling: van de Hulst (1980), *Multiple Light Scattering*; Prahl (1995) in *Optical-Thermal
/// Response of Laser-Irradiated Tissue*. Refraction is diagonal here, since directions are named by
/// n sin θ.
pub fn solve(
    medium: &LayeredMedium,
    cos_in: &[f64],
    cos_out: &[f64],
) -> Result<Response, CannotSolve> {
    solve_with(medium, cos_in, cos_out, Resolution::FINE)
}

pub(crate) fn solve_with(
    medium: &LayeredMedium,
    cos_in: &[f64],
    cos_out: &[f64],
    resolution: Resolution,
) -> Result<Response, CannotSolve> {
    let Resolution { nodes, moments } = resolution;
    let medium = medium.clone().validated()?;
    for &cos in cos_in.iter().chain(cos_out) {
        if !(cos > 0.0 && cos <= 1.0) {
            return Err(CannotSolve::Cosine(cos));
        }
    }
    let endless = medium
        .layers
        .last()
        .is_some_and(|l| l.thickness_mm.is_none());
    let (above, below) = (medium.eta_above, medium.eta_below);
    let mut indices = vec![above];
    indices.extend(medium.layers.iter().map(|l| l.eta));
    if !endless {
        indices.push(below);
    }
    let square = |index: f64, cos: f64| index * index * (1.0 - cos) * (1.0 + cos);
    let looked_at: Vec<f64> = cos_in
        .iter()
        .chain(cos_out)
        .map(|&cos| square(above, cos))
        .chain(cos_out.iter().map(|&cos| square(below, cos)))
        .collect();
    let directions = Directions::new(&indices, nodes, &looked_at);
    let weights = DVector::from_column_slice(&directions.weights);

    let mut stack = Stack::surface(&directions, above, medium.layers[0].eta);
    for (k, layer) in medium.layers.iter().enumerate() {
        stack = stack.on(&slab(layer, &directions, moments), &weights);
        let next = medium.layers.get(k + 1).map_or(below, |l| l.eta);
        if layer.thickness_mm.is_some() {
            stack = stack.on(&Stack::surface(&directions, layer.eta, next), &weights);
        }
    }

    let first = directions.count() - looked_at.len();
    let (views_above, views_below) = (first + cos_in.len(), first + cos_in.len() + cos_out.len());
    let total =
        |operator: &Operator, j: usize| operator.direct[j] + operator.scattered(j, &weights);
    let incidences = first..first + cos_in.len();
    let per_incidence = |f: &dyn Fn(usize) -> f64| incidences.clone().map(f).collect::<Vec<f64>>();
    let by_view = |operator: &Operator, index: f64, views: usize| {
        let value = |i: usize, j: usize| index * index / PI * operator.kernel[(i, j)];
        incidences
            .clone()
            .map(|j| {
                (views..views + cos_out.len())
                    .map(|i| value(i, j))
                    .collect()
            })
            .collect::<Vec<Vec<f64>>>()
    };
    let diffuse = |operator: &Operator| {
        let from_above = (0..first).filter(|&j| directions.cos(j, above).is_some());
        from_above
            .map(|j| weights[j] * total(operator, j))
            .sum::<f64>()
            / (above * above)
    };
    Ok(Response {
        specular: cos_in
            .iter()
            .map(|&cos| fresnel::reflectance(medium.layers[0].eta / above, cos))
            .collect(),
        reflectance: per_incidence(&|j| total(&stack.reflection, j)),
        transmittance: per_incidence(&|j| total(&stack.transmission, j)),
        unscattered_transmittance: cos_in
            .iter()
            .map(|&c| first_order::unscattered(&medium, c).1)
            .collect(),
        brdf: by_view(&stack.reflection, above, views_above),
        btdf: by_view(&stack.transmission, below, views_below),
        diffuse_reflectance: diffuse(&stack.reflection),
        diffuse_transmittance: diffuse(&stack.transmission),
    })
}

fn slab(layer: &Layer, directions: &Directions, moments: usize) -> Stack {
    let Slab {
        reflection,
        transmission,
    } = Slab::new(layer, directions, moments);
    Stack {
        reflection_below: reflection.clone(),
        transmission_up: transmission.clone(),
        reflection,
        transmission,
    }
}

/// What lies between two planes, seen from above and from below.
struct Stack {
    reflection: Operator,
    transmission: Operator,
    reflection_below: Operator,
    transmission_up: Operator,
}

impl Stack {
    /// A smooth surface between two indices.
    fn surface(directions: &Directions, above: f64, below: f64) -> Self {
        let count = directions.count();
        let [mut from_above, mut from_below, mut through] = [(); 3].map(|()| DVector::zeros(count));
        for i in 0..count {
            match (directions.cos(i, above), directions.cos(i, below)) {
                (Some(mu), Some(_)) => {
                    let r = fresnel::reflectance(below / above, mu);
                    (from_above[i], from_below[i], through[i]) = (r, r, 1.0 - r);
                }
                (Some(_), None) => from_above[i] = 1.0,
                (None, Some(_)) => from_below[i] = 1.0,
                (None, None) => {}
            }
        }
        Self {
            reflection: Operator::diagonal(from_above),
            reflection_below: Operator::diagonal(from_below),
            transmission: Operator::diagonal(through.clone()),
            transmission_up: Operator::diagonal(through),
        }
    }

    /// This on top of `lower`.
    fn on(&self, lower: &Self, weights: &DVector<f64>) -> Self {
        let after = |a: &Operator, b: &Operator| a.after(b, weights);
        let down = after(&self.reflection_below, &lower.reflection).bounces(weights);
        let up = after(&lower.reflection, &self.reflection_below).bounces(weights);
        let into = after(&down, &self.transmission);
        let out = after(&up, &lower.transmission_up);
        Self {
            reflection: after(&self.transmission_up, &after(&lower.reflection, &into))
                .plus(&self.reflection, 1.0),
            transmission: after(&lower.transmission, &into),
            reflection_below: after(&lower.transmission, &after(&self.reflection_below, &out))
                .plus(&lower.reflection_below, 1.0),
            transmission_up: after(&self.transmission_up, &out),
        }
    }
}
