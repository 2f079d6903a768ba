//! RenderMan's `PxrSurface`, as RIB.

use super::{Band, Header, Shade, SpectrumError, triple};
use crate::csv_table::number;

/// The longest diffusion length that is written, mm, for a colour that absorbs nothing and has
/// none: farther than any object that is rendered.
pub const LONGEST_MM: f64 = 1e4;

/// A `PxrSurface` for every shade, with the dipole of Jensen et al. (2001), which it has as model
/// 0: the very model, in its own quantities. Its colour is the total reflectance, its diffuse mean
/// free path the diffusion length 1/σₜᵣ in mm, and `unitLength` the millimetre in units of the
/// scene.
///
/// # Errors
///
/// A spectrum has no place in it.
pub fn write(header: &Header, shades: &[Shade]) -> Result<String, SpectrumError> {
    let mut out = header.marked("#");
    for shade in shades {
        let bands = shade.rgb("RenderMan")?;
        let length = |b: &Band| b.diffusion_length_mm.unwrap_or(LONGEST_MM).min(LONGEST_MM);
        let longest = bands.iter().map(length).fold(0.0, f64::max);
        out.push('\n');
        for note in &shade.notes {
            out += &format!("# {note}\n");
        }
        out += &format!(
            "Bxdf \"PxrSurface\" \"{}\"\n  \"float diffuseGain\" [0]\n  \"int subsurfaceType\" [0]\n  \
             \"float subsurfaceGain\" [1]\n  \"color subsurfaceColor\" [{}]\n  \"float subsurfaceDmfp\" [{}]\n  \
             \"color subsurfaceDmfpColor\" [{}]\n  \"float subsurfaceIor\" [{}]\n  \"float unitLength\" [{}]\n",
            shade.name,
            triple(bands, |b| b.total_reflectance, " "),
            number(longest),
            triple(bands, |b| length(b) / longest, " "),
            number(shade.eta),
            number(header.scene_unit_mm.recip()),
        );
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::super::Bands;
    use super::super::tests::{header, shade};
    use super::*;

    #[test]
    fn the_diffuse_free_path_is_in_millimetres() {
        let mut marble = shade();
        let Bands::Rgb(bands) = &mut marble.bands else {
            unreachable!()
        };
        bands[2].diffusion_length_mm = Some(1.0);
        let text = write(&header(), &[marble]).unwrap();
        assert!(text.contains("\"float subsurfaceDmfp\" [4]"), "{text}");
        assert!(
            text.contains("\"color subsurfaceDmfpColor\" [1 0.5 0.25]"),
            "{text}"
        );
        assert!(text.contains("\"float unitLength\" [0.1]"), "{text}");
    }

    #[test]
    fn light_that_is_never_absorbed_goes_as_far_as_is_written() {
        let text = write(&header(), &[shade()]).unwrap();
        assert!(text.contains("\"float subsurfaceDmfp\" [10000]"), "{text}");
    }
}
