//! The tissue of an input file of the Virtual Tissue Simulator's Monte Carlo command line.

use super::{Header, OpticalProperties};
use serde_json::{Value, json};

/// Thickness of the layers, mm: none is known, and this one is thick for most media.
const THICKNESS_MM: f64 = 100.0;

/// A `TissueInput` of one layer for each of `media`, between two half-spaces of air, in mm⁻¹ with
/// the scattering not reduced. To be put in the place of `TissueInput` in an input file.
pub fn write(header: &Header, media: &[OpticalProperties]) -> String {
    let region = |from: Value, to: Value, properties: Value| {
        json!({
            "TissueRegionType": "Layer",
            "ZRange": { "Start": from, "Stop": to, "Count": 2 },
            "RegionOP": properties,
        })
    };
    let tissue = |m: &OpticalProperties| {
        // Air must scatter a little there, or it is no medium.
        let air = json!({ "Mua": 0.0, "Mus": 1e-10, "G": 1.0, "N": 1.0 });
        let medium =
            json!({ "Mua": m.sigma_a_per_mm, "Mus": m.sigma_s_per_mm, "G": m.g, "N": m.eta });
        json!({
            "Name": m.name,
            "TissueInput": {
                "TissueType": "MultiLayer",
                "Regions": [
                    region(json!("-Infinity"), json!(0.0), air.clone()),
                    region(json!(0.0), json!(THICKNESS_MM), medium),
                    region(json!(THICKNESS_MM), json!("Infinity"), air),
                ],
            },
        })
    };
    let document = json!({
        "_comment": header.lines,
        "Tissues": media.iter().map(tissue).collect::<Vec<_>>(),
    });
    format!("{document:#}\n")
}

#[cfg(test)]
mod tests {
    use super::super::tests::{header, milk};
    use super::*;

    #[test]
    fn scattering_is_not_reduced() {
        let found: Value = serde_json::from_str(&write(&header(), &[milk()])).unwrap();
        let expected = json!({ "Mua": 0.25, "Mus": 8.0, "G": 0.75, "N": 1.3 });
        assert_eq!(
            found["Tissues"][0]["TissueInput"]["Regions"][1]["RegionOP"],
            expected
        );
    }
}
