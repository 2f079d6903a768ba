//! Layered media from their files.

use crate::error::{Blame, Error, Kind, Result};
use formats::medium_toml::{ConstituentEntry, LayerEntry, MediumFile, PhaseEntry, PhaseName};
use physics::{Constituent, Layer, LayeredMedium, Phase, TabulatedPhase};
use std::collections::BTreeMap;

/// The skin of Hanrahan and Krueger (1993), Table 2, and the leaf of their section 7.2.
const SHIPPED: [(&str, &str); 2] = [
    ("skin", include_str!("../../../data/media/skin.toml")),
    ("leaf", include_str!("../../../data/media/leaf.toml")),
];

/// The text of the shipped medium called `name`.
pub fn shipped(name: &str) -> Option<&'static str> {
    let found = SHIPPED.iter().find(|(known, _)| *known == name);
    found.map(|(_, text)| *text)
}

/// The layers that a file describes.
///
/// # Errors
///
/// The error names the layer and what is wrong with it.
pub fn layered_medium(file: &MediumFile) -> Result<LayeredMedium> {
    let layers = file
        .layer
        .iter()
        .enumerate()
        .map(|(k, entry)| {
            layer(entry, &file.constituent).map_err(|e| e.within(format!("layer {}", k + 1)))
        })
        .collect::<Result<Vec<Layer>>>()?;
    Ok(LayeredMedium {
        layers,
        eta_above: file.eta_above,
        eta_below: file.eta_below,
    })
}

fn layer(entry: &LayerEntry, known: &BTreeMap<String, ConstituentEntry>) -> Result<Layer> {
    let LayerEntry {
        thickness_mm,
        sigma_a_per_mm,
        sigma_s_per_mm,
        g,
        eta,
        phase,
        mixture,
    } = entry;
    match (sigma_a_per_mm, sigma_s_per_mm, mixture) {
        (Some(sigma_a), Some(sigma_s), None) => Ok(Layer {
            sigma_a: *sigma_a,
            sigma_s: *sigma_s,
            phase: match phase {
                None => Phase::HenyeyGreenstein {
                    g: g.unwrap_or(0.0),
                },
                Some(PhaseEntry::Named(PhaseName::Rayleigh)) => Phase::Rayleigh,
                Some(PhaseEntry::Table(rows)) => {
                    let rows: Vec<(f64, f64)> = rows.iter().map(|r| (r[0], r[1])).collect();
                    Phase::Tabulated(TabulatedPhase::new(&rows).input("phase")?)
                }
            },
            eta: *eta,
            thickness_mm: *thickness_mm,
        }),
        (None, None, Some(mixture)) if g.is_none() && phase.is_none() => {
            let parts = mixture
                .iter()
                .map(|(name, fraction)| {
                    let Some(c) = known.get(name) else {
                        let names: Vec<&str> = known.keys().map(String::as_str).collect();
                        let message = format!(
                            "mixture: no [constituent.{name}]; there are {}",
                            names.join(", ")
                        );
                        return Err(Error::new(Kind::Input, message));
                    };
                    let constituent = Constituent {
                        sigma_a: c.sigma_a_per_mm,
                        sigma_s: c.sigma_s_per_mm,
                        phase: Phase::HenyeyGreenstein { g: c.g },
                    };
                    Ok((*fraction, constituent))
                })
                .collect::<Result<Vec<_>>>()?;
            Layer::mixed(&parts, *eta, *thickness_mm).input("mixture")
        }
        _ => Err(Error::new(
            Kind::Input,
            "expected either sigma_a_per_mm and sigma_s_per_mm (with g or phase), or mixture alone",
        )),
    }
}
