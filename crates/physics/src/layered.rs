//! Layered media: plane layers under light that falls from above.

use crate::medium::Medium;
use crate::phase::{InvalidPhase, Phase, PhaseMixture};
use thiserror::Error;

/// One plane layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Absorption coefficient σₐ, mm⁻¹.
    pub sigma_a: f64,
    /// Scattering coefficient σₛ, mm⁻¹; 0 in clear layers such as glass slides.
    pub sigma_s: f64,
    /// How it scatters.
    pub phase: Phase,
    /// Refractive index, on the same scale as its neighbours'.
    pub eta: f64,
    /// Thickness, mm; `None` for a last layer without end.
    pub thickness_mm: Option<f64>,
}

/// One kind of matter in a mixture, as it is where it fills all of the volume.
#[derive(Clone, Debug, PartialEq)]
pub struct Constituent {
    /// Absorption coefficient σₐ, mm⁻¹.
    pub sigma_a: f64,
    /// Scattering coefficient σₛ, mm⁻¹.
    pub sigma_s: f64,
    /// How it scatters.
    pub phase: Phase,
}

/// A mixture cannot be made.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum InvalidMixture {
    /// A share of the volume is negative, or not finite.
    #[error("part {part}: its share of the volume must be at least 0, got {fraction}")]
    Fraction {
        /// Which part, from 1.
        part: usize,
        /// What was given.
        fraction: f64,
    },
    /// The shares are more than the volume.
    #[error("the shares of the volume add up to {0}: more than 1; what is left of 1 is clear")]
    TooMuch(f64),
    /// A phase function is not one.
    #[error(transparent)]
    Phase(#[from] InvalidPhase),
}

/// Layers from the lit side down, between two outsides.
#[derive(Clone, Debug, PartialEq)]
pub struct LayeredMedium {
    /// The layers; the light falls on the first.
    pub layers: Vec<Layer>,
    /// Refractive index on the lit side.
    pub eta_above: f64,
    /// Refractive index behind the last layer. Without meaning if that has no end.
    pub eta_below: f64,
}

/// Whose index is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The outside on which the light falls.
    Above,
    /// The outside behind the last layer.
    Below,
    /// A layer, from 1 at the top.
    Layer(usize),
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Above => write!(f, "above the medium"),
            Self::Below => write!(f, "below the medium"),
            Self::Layer(number) => write!(f, "layer {number}"),
        }
    }
}

/// Layers do not make a medium.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum InvalidLayers {
    /// There is no layer at all.
    #[error("the medium has no layer: give at least one")]
    NoLayer,
    /// σₐ is negative or not finite.
    #[error("layer {layer}: absorption coefficient must be at least 0 mm^-1, got {sigma_a} mm^-1")]
    SigmaA {
        /// Number of the layer, from 1 at the top.
        layer: usize,
        /// What was given, mm⁻¹.
        sigma_a: f64,
    },
    /// σₛ is negative or not finite.
    #[error("layer {layer}: scattering coefficient must be at least 0 mm^-1, got {sigma_s} mm^-1")]
    SigmaS {
        /// Number of the layer, from 1 at the top.
        layer: usize,
        /// What was given, mm⁻¹.
        sigma_s: f64,
    },
    /// Its phase function is not one.
    #[error("layer {layer}: {invalid}")]
    Phase {
        /// Number of the layer, from 1 at the top.
        layer: usize,
        /// What is wrong with it.
        invalid: InvalidPhase,
    },
    /// An index below vacuum's, or beyond what a dielectric has.
    #[error("{place}: refractive index must lie between 1 and 5, got {eta}")]
    Eta {
        /// Whose index it is.
        place: Place,
        /// What was given.
        eta: f64,
    },
    /// A thickness that is not positive and finite.
    #[error(
        "layer {layer}: thickness must be above 0 mm, got {thickness_mm} mm; \
         leave it out for a layer without end"
    )]
    Thickness {
        /// Number of the layer, from 1 at the top.
        layer: usize,
        /// What was given, mm.
        thickness_mm: f64,
    },
    /// A layer without end has another one below it.
    #[error(
        "layer {layer} has no thickness but is not the last of {layers}: \
         only the last layer may be without end"
    )]
    EndlessAbove {
        /// Number of the layer, from 1 at the top.
        layer: usize,
        /// How many layers there are.
        layers: usize,
    },
    /// A layer without end that neither absorbs nor scatters.
    #[error(
        "layer {layer} has no end and neither absorbs nor scatters: light would never come to \
         rest; give it a thickness, or leave it out and set the index below"
    )]
    ClearEndless {
        /// Number of the layer, from 1 at the top.
        layer: usize,
    },
}

fn check_eta(eta: f64, place: Place) -> Result<(), InvalidLayers> {
    // NaN fails the range test as well.
    if (1.0..=5.0).contains(&eta) {
        Ok(())
    } else {
        Err(InvalidLayers::Eta { place, eta })
    }
}

impl Layer {
    fn check(&self, layer: usize, layers: usize) -> Result<(), InvalidLayers> {
        let Self {
            sigma_a,
            sigma_s,
            ref phase,
            eta,
            thickness_mm,
        } = *self;
        if !(sigma_a >= 0.0 && sigma_a.is_finite()) {
            return Err(InvalidLayers::SigmaA { layer, sigma_a });
        }
        if !(sigma_s >= 0.0 && sigma_s.is_finite()) {
            return Err(InvalidLayers::SigmaS { layer, sigma_s });
        }
        phase
            .check()
            .map_err(|invalid| InvalidLayers::Phase { layer, invalid })?;
        check_eta(eta, Place::Layer(layer))?;
        match thickness_mm {
            Some(thickness_mm) if !(thickness_mm > 0.0 && thickness_mm.is_finite()) => {
                Err(InvalidLayers::Thickness {
                    layer,
                    thickness_mm,
                })
            }
            None if layer < layers => Err(InvalidLayers::EndlessAbove { layer, layers }),
            None if sigma_a == 0.0 && sigma_s == 0.0 => Err(InvalidLayers::ClearEndless { layer }),
            _ => Ok(()),
        }
    }

    /// A layer of constituents, each with its share of the volume; what is left of 1 is clear.
    ///
    /// # Errors
    ///
    /// [`InvalidMixture`] where the shares are none.
    ///
    /// # Source
    ///
    /// Hanrahan and Krueger (1993), section 3: σₐ = Σ wᵢ σₐ,ᵢ and σₛ p = Σ wᵢ σₛ,ᵢ pᵢ.
    pub fn mixed(
        parts: &[(f64, Constituent)],
        eta: f64,
        thickness_mm: Option<f64>,
    ) -> Result<Self, InvalidMixture> {
        for (part, &(fraction, _)) in parts.iter().enumerate() {
            if !(fraction >= 0.0 && fraction.is_finite()) {
                let part = part + 1;
                return Err(InvalidMixture::Fraction { part, fraction });
            }
        }
        let whole: f64 = parts.iter().map(|part| part.0).sum();
        if whole > 1.0 + 1e-9 {
            return Err(InvalidMixture::TooMuch(whole));
        }
        let scattering: Vec<(f64, Phase)> = parts
            .iter()
            .map(|(fraction, c)| (fraction * c.sigma_s, c.phase.clone()))
            .filter(|(sigma_s, _)| *sigma_s > 0.0)
            .collect();
        let phase = match scattering.as_slice() {
            [] => Phase::ISOTROPIC,
            [(_, only)] => only.clone(),
            several => Phase::Mixture(PhaseMixture::new(several)?),
        };
        Ok(Self {
            sigma_a: parts.iter().map(|(fraction, c)| fraction * c.sigma_a).sum(),
            sigma_s: scattering.iter().map(|part| part.0).sum(),
            phase,
            eta,
            thickness_mm,
        })
    }

    /// Thickness, mm; infinite without one.
    pub fn thickness(&self) -> f64 {
        self.thickness_mm.unwrap_or(f64::INFINITY)
    }

    /// Extinction coefficient σₜ = σₐ + σₛ, mm⁻¹.
    pub fn sigma_t(&self) -> f64 {
        self.sigma_a + self.sigma_s
    }

    /// Optical thickness σₜ·d; infinite for a layer without end.
    pub fn optical_thickness(&self) -> f64 {
        self.thickness_mm
            .map_or(f64::INFINITY, |d| d * self.sigma_t())
    }

    /// Single-scattering albedo σₛ/σₜ; 0 in a clear layer.
    pub fn albedo(&self) -> f64 {
        if self.sigma_s == 0.0 {
            0.0
        } else {
            self.sigma_s / self.sigma_t()
        }
    }
}

impl LayeredMedium {
    /// A homogeneous half-space in air (or in whatever its relative index refers to).
    pub fn half_space(medium: &Medium) -> Self {
        let phase = Phase::HenyeyGreenstein { g: medium.g };
        let Medium {
            sigma_a,
            sigma_s,
            eta,
            ..
        } = *medium;
        Self {
            layers: vec![Layer {
                sigma_a,
                sigma_s,
                phase,
                eta,
                thickness_mm: None,
            }],
            eta_above: 1.0,
            eta_below: 1.0,
        }
    }

    /// The same medium, or what is wrong with it.
    ///
    /// # Errors
    ///
    /// [`InvalidLayers`] names the first thing that is.
    pub fn validated(self) -> Result<Self, InvalidLayers> {
        if self.layers.is_empty() {
            return Err(InvalidLayers::NoLayer);
        }
        check_eta(self.eta_above, Place::Above)?;
        for (k, layer) in self.layers.iter().enumerate() {
            layer.check(k + 1, self.layers.len())?;
        }
        check_eta(self.eta_below, Place::Below)?;
        Ok(self)
    }

    /// Depth of the top of each layer, mm.
    pub fn tops(&self) -> Vec<f64> {
        let tops = self.layers.iter().scan(0.0, |top, layer| {
            let here = *top;
            *top += layer.thickness();
            Some(here)
        });
        tops.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase::PhaseFunction;

    fn matter(sigma_a: f64, sigma_s: f64, g: f64) -> Constituent {
        Constituent {
            sigma_a,
            sigma_s,
            phase: Phase::HenyeyGreenstein { g },
        }
    }

    #[test]
    fn a_mixture_is_the_sum_of_its_parts() {
        let (dermis, blood) = (matter(0.3, 21.7, 0.81), matter(32.6, 0.96, 0.0));
        let parts = [(0.9, dermis.clone()), (0.05, blood)];
        let layer = Layer::mixed(&parts, 1.37, None).unwrap();
        assert!((layer.sigma_a - (0.9 * 0.3 + 0.05 * 32.6)).abs() < 1e-14);
        assert!((layer.sigma_s - (0.9 * 21.7 + 0.05 * 0.96)).abs() < 1e-14);
        let g = 0.9 * 21.7 * 0.81 / layer.sigma_s;
        assert!((layer.phase.g() - g).abs() < 1e-14, "{}", layer.phase.g());
        let alone = Layer::mixed(&[(1.0, dermis.clone())], 1.37, None).unwrap();
        assert_eq!((alone.sigma_s, alone.phase), (21.7, dermis.phase));
    }

    #[test]
    fn bad_shares_are_named() {
        let part = |fraction| (fraction, matter(1.0, 1.0, 0.0));
        let mixed = |parts: &[(f64, Constituent)]| Layer::mixed(parts, 1.3, None);
        let negative = InvalidMixture::Fraction {
            part: 2,
            fraction: -0.1,
        };
        assert_eq!(mixed(&[part(0.5), part(-0.1)]), Err(negative));
        assert_eq!(
            mixed(&[part(0.75), part(0.5)]),
            Err(InvalidMixture::TooMuch(1.25))
        );
    }
}
