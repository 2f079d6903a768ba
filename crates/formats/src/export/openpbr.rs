//! MaterialX 1.39 with OpenPBR surfaces.

use super::{Band, Header, Shade, SpectrumError, triple, xml_comment};
use crate::csv_table::number;

/// The document: a surface and a material for every shade.
///
/// OpenPBR (Academy Software Foundation, version 1.1, section on subsurface) takes the mean free
/// path as `subsurface_radius` times `subsurface_radius_scale` in units of the scene, and the
/// albedo of a half-space without a reflecting surface as `subsurface_color`.
///
/// # Errors
///
/// A spectrum has no place in it.
pub fn write(header: &Header, shades: &[Shade]) -> Result<String, SpectrumError> {
    let mut out = String::from("<?xml version=\"1.0\"?>\n<!--\n");
    out += &xml_comment(&header.lines, "  ");
    out += "-->\n<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n";
    for shade in shades {
        let bands = shade.rgb("OpenPBR")?;
        let name = &shade.name;
        let longest = bands
            .iter()
            .map(|b| b.mean_free_path_mm)
            .fold(0.0, f64::max);
        out += &format!("  <!--\n{}  -->\n", xml_comment(&shade.notes, "    "));
        out += &format!("  <open_pbr_surface name=\"{name}_surface\" type=\"surfaceshader\">\n");
        let mut input = |field: &str, kind: &str, value: &str| {
            out += &format!("    <input name=\"{field}\" type=\"{kind}\" value=\"{value}\" />\n");
        };
        input("specular_ior", "float", &number(shade.eta));
        input("specular_roughness", "float", "0");
        input("subsurface_weight", "float", "1");
        input(
            "subsurface_color",
            "color3",
            &triple(bands, |b| b.color, ", "),
        );
        input(
            "subsurface_radius",
            "float",
            &number(longest / header.scene_unit_mm),
        );
        let relative = |b: &Band| b.mean_free_path_mm / longest;
        input(
            "subsurface_radius_scale",
            "color3",
            &triple(bands, relative, ", "),
        );
        input("subsurface_scatter_anisotropy", "float", "0");
        out += "  </open_pbr_surface>\n";
        out += &format!("  <surfacematerial name=\"{name}\" type=\"material\">\n");
        out += &format!(
            "    <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"{name}_surface\" />\n"
        );
        out += "  </surfacematerial>\n";
    }
    out += "</materialx>\n";
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{header, shade};
    use super::*;

    #[test]
    fn radius_times_scale_is_the_mean_free_path_in_units_of_the_scene() {
        let text = write(&header(), &[shade()]).unwrap();
        // 0.5 mm is the longest, a unit is 10 mm.
        assert!(
            text.contains("name=\"subsurface_radius\" type=\"float\" value=\"0.05\""),
            "{text}"
        );
        assert!(
            text.contains("type=\"color3\" value=\"1, 1, 0.5\""),
            "{text}"
        );
        assert!(text.contains("name=\"subsurface_color\" type=\"color3\" value=\"0.9, 0.9, 0.9\""));
        assert!(text.contains("    a note\n"));
    }
}
