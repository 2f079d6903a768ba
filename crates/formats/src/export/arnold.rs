//! Arnold's `standard_surface`, as an `.ass` scene to include.

use super::{Band, Header, Shade, SpectrumError, triple};
use crate::csv_table::number;

/// A `standard_surface` for every shade.
///
/// Its radius is the mean free path in units of the scene (random walk, isotropic scattering) and
/// its colour the albedo that the walk should give, as OpenPBR has them.
///
/// # Errors
///
/// A spectrum has no place in it.
pub fn write(header: &Header, shades: &[Shade]) -> Result<String, SpectrumError> {
    let mut out = header.marked("#");
    for shade in shades {
        let bands = shade.rgb("Arnold")?;
        out.push('\n');
        for note in &shade.notes {
            out += &format!("# {note}\n");
        }
        let radius = |b: &Band| b.mean_free_path_mm / header.scene_unit_mm;
        out += &format!(
            "standard_surface\n{{\n name {}\n base 0\n specular 1\n specular_roughness 0\n specular_IOR {}\n \
             subsurface 1\n subsurface_color {}\n subsurface_radius {}\n subsurface_scale 1\n \
             subsurface_type \"randomwalk\"\n subsurface_anisotropy 0\n}}\n",
            shade.name,
            number(shade.eta),
            triple(bands, |b| b.color, " "),
            triple(bands, radius, " "),
        );
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{header, shade};
    use super::*;

    #[test]
    fn the_radius_is_in_units_of_the_scene() {
        let text = write(&header(), &[shade()]).unwrap();
        assert!(
            text.starts_with("# first\n# second\n\n# a note\nstandard_surface\n"),
            "{text}"
        );
        assert!(
            text.contains(" subsurface_radius 0.05 0.05 0.025\n"),
            "{text}"
        );
        assert!(text.contains(" specular_IOR 1.5\n") && text.contains(" name Marble\n"));
    }
}
