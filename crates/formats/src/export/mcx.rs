//! The media of an MCX or MMC input file.

use super::{Header, OpticalProperties};
use serde_json::json;

/// `Domain.Media` of an MCX input file, in mm⁻¹: medium 0 is the outside, the others are
/// `media` in their order.
pub fn write(header: &Header, media: &[OpticalProperties]) -> String {
    let outside = json!({ "mua": 0.0, "mus": 0.0, "g": 1.0, "n": 1.0, "name": "outside" });
    let rows = media.iter().map(|m| {
        json!({ "mua": m.sigma_a_per_mm, "mus": m.sigma_s_per_mm, "g": m.g, "n": m.eta, "name": m.name })
    });
    let media: Vec<_> = std::iter::once(outside).chain(rows).collect();
    let document = json!({
        "_comment": header.lines,
        "Domain": { "LengthUnit": header.scene_unit_mm, "Media": media },
    });
    format!("{document:#}\n")
}

#[cfg(test)]
mod tests {
    use super::super::tests::{header, milk};
    use super::*;

    #[test]
    fn media_stand_behind_the_outside() {
        let text = write(&header(), &[milk()]);
        let found: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(found["Domain"]["LengthUnit"], 10.0);
        assert_eq!(found["Domain"]["Media"][0]["n"], 1.0);
        let expected = json!({ "mua": 0.25, "mus": 8.0, "g": 0.75, "n": 1.3, "name": "milk G" });
        assert_eq!(found["Domain"]["Media"][1], expected);
    }
}
