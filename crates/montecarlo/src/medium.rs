//! Layered media: plane layers under light that falls from above.

use crate::error::{InvalidSimulation, Place};
use crate::phase::Phase;
use physics::Medium;

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

/// Scattering optical thickness below which no photon of any run would scatter.
const THINNEST: f64 = 1e-9;
/// Mean free paths in a layer beyond which single precision cannot place a photon.
const DENSEST: f64 = 1e7;

fn check_eta(eta: f64, place: Place) -> Result<(), InvalidSimulation> {
    // NaN fails the range test as well.
    if (1.0..=5.0).contains(&eta) {
        Ok(())
    } else {
        Err(InvalidSimulation::Eta { place, eta })
    }
}

impl Layer {
    fn check(&self, layer: usize, layers: usize) -> Result<(), InvalidSimulation> {
        let Self {
            sigma_a,
            sigma_s,
            ref phase,
            eta,
            thickness_mm,
        } = *self;
        if !(sigma_a >= 0.0 && sigma_a.is_finite()) {
            return Err(InvalidSimulation::SigmaA { layer, sigma_a });
        }
        if !(sigma_s >= 0.0 && sigma_s.is_finite()) {
            return Err(InvalidSimulation::SigmaS { layer, sigma_s });
        }
        if let Phase::HenyeyGreenstein { g } = *phase
            && !(g > -1.0 && g < 1.0)
        {
            return Err(InvalidSimulation::G { layer, g });
        }
        check_eta(eta, Place::Layer(layer))?;
        match thickness_mm {
            Some(thickness_mm) if !(thickness_mm > 0.0 && thickness_mm.is_finite()) => {
                Err(InvalidSimulation::Thickness {
                    layer,
                    thickness_mm,
                })
            }
            Some(thickness_mm) if sigma_s * thickness_mm > DENSEST => {
                let mean_free_path_mm = 1.0 / sigma_s;
                Err(InvalidSimulation::TooDense {
                    layer,
                    mean_free_path_mm,
                    thickness_mm,
                })
            }
            None if layer < layers => Err(InvalidSimulation::EndlessAbove { layer, layers }),
            None if sigma_a == 0.0 && sigma_s == 0.0 => {
                Err(InvalidSimulation::ClearEndless { layer })
            }
            _ => Ok(()),
        }
    }

    /// Thickness, mm; infinite without one.
    pub(crate) fn thickness(&self) -> f64 {
        self.thickness_mm.unwrap_or(f64::INFINITY)
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
    /// [`InvalidSimulation`] names the first thing that is.
    pub fn validated(self) -> Result<Self, InvalidSimulation> {
        if self.layers.is_empty() {
            return Err(InvalidSimulation::NoLayer);
        }
        check_eta(self.eta_above, Place::Above)?;
        for (k, layer) in self.layers.iter().enumerate() {
            layer.check(k + 1, self.layers.len())?;
        }
        check_eta(self.eta_below, Place::Below)?;
        let optical = self.layers.iter().filter(|layer| layer.sigma_s > 0.0);
        let optical_thickness = optical.map(|layer| layer.sigma_s * layer.thickness()).sum();
        if optical_thickness < THINNEST {
            return Err(InvalidSimulation::TooThin { optical_thickness });
        }
        Ok(self)
    }

    /// Number of the endless layer without absorption, in which the mean path is infinite.
    pub(crate) fn lossless_endless(&self) -> Option<usize> {
        let last = self.layers.last()?;
        (last.thickness_mm.is_none() && last.sigma_a == 0.0).then_some(self.layers.len())
    }

    /// Depth of the top of each layer, mm.
    pub(crate) fn tops(&self) -> Vec<f64> {
        let tops = self.layers.iter().scan(0.0, |top, layer| {
            let here = *top;
            *top += layer.thickness();
            Some(here)
        });
        tops.collect()
    }
}
