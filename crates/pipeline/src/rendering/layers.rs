//! Layers of the solids of a scene, solved for the renderer.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::read_text;
use crate::medium::{layered_medium, shipped};
use formats::medium_toml;
use gauss_quad::GaussLegendre;
use physics::brdf::Directions;
use physics::{FirstOrder, LayeredMedium, Reflections};
use render::layered::{Multiple, Sheet};
use std::f64::consts::PI;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// The layers of a file beside the scene, or of a shipped medium by its name.
///
/// # Errors
///
/// The error names the file and what is wrong with it.
pub(super) fn read(name: &str, folder: &Path, inputs: &mut Vec<PathBuf>) -> Result<LayeredMedium> {
    let path = folder.join(name);
    let text = match shipped(name) {
        Some(text) if !path.is_file() => text.to_owned(),
        _ => {
            let text = read_text(&path)?;
            inputs.push(path.clone());
            text
        }
    };
    let file = medium_toml::parse(&text).input(path.display())?;
    let medium = layered_medium(&file).map_err(|e| e.within(path.display()))?;
    let medium = medium.validated().input(path.display())?;
    if medium.eta_above != 1.0 {
        let message = format!(
            "eta_above: expected 1, the air of the scene, found {}",
            medium.eta_above
        );
        return Err(Error::new(Kind::Input, message).within(path.display()));
    }
    Ok(medium)
}

/// What the renderer needs of layers: light that scattered once in closed form, and what scattered
/// more often by adding and doubling less the former.
///
/// # Errors
///
/// The layers make no medium.
pub fn sheet(medium: &LayeredMedium) -> Result<Sheet> {
    // Closer where the surface lets light in more and more.
    let grazing = [0.02, 0.05, 0.09, 0.14, 0.2, 0.27, 0.35];
    let cosines: Vec<f64> = grazing
        .into_iter()
        .chain((0..=11).map(|k| 0.45 + 0.05 * f64::from(k)))
        .collect();
    let solved = ::layers::solve(medium, &cosines, &cosines).fault("layers")?;
    let once = FirstOrder::new(medium.clone(), Reflections::All).fault("layers")?;
    let rule = GaussLegendre::new(NonZeroUsize::new(24).expect("24 is not zero"));
    let rest = |all: &[Vec<f64>], of: &dyn Fn(&Directions) -> f64| -> Vec<Vec<f64>> {
        let lines = cosines.iter().zip(all).map(|(&cos_in, line)| {
            let values = cosines.iter().zip(line).map(|(&cos_out, all)| {
                let mean = rule.integrate(0.0, PI, |azimuth: f64| {
                    of(&Directions {
                        cos_in,
                        cos_out,
                        cos_azimuth: azimuth.cos(),
                    })
                }) / PI;
                (all - mean).max(0.0)
            });
            values.collect()
        });
        lines.collect()
    };
    let multiple = Multiple {
        brdf: rest(&solved.brdf, &|d| once.brdf(d)),
        btdf: rest(&solved.btdf, &|d| once.btdf(d)),
        cosines: cosines.clone(),
    };
    let endless = medium
        .layers
        .last()
        .is_some_and(|l| l.thickness_mm.is_none());
    Ok(Sheet {
        once,
        multiple,
        open_behind: !endless && medium.eta_below == medium.eta_above,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen at an angle, a leaf under light along its normal has the radiance of adding and
    /// doubling, on the lit side and on the other. (Light along the normal has no azimuth.)
    #[test]
    fn a_leaf_is_seen_as_it_is_solved() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        let medium = read("leaf", Path::new(""), &mut vec![]).unwrap();
        let cos = 40.0_f64.to_radians().cos();
        let solved = ::layers::solve(&medium, &[1.0], &[cos]).unwrap();
        for (z, expected) in [(-1, solved.brdf[0][0]), (1, solved.btdf[0][0])] {
            let from = [0.0, -50.0 * 40.0_f64.to_radians().sin(), 50.0 * cos];
            let scene = format!(
                "channels = [\"Y\"]\n[camera]\nkind = \"orthographic\"\nfrom_mm = {from:?}\n\
                 to_mm = [0, 0, 0]\nheight_mm = 1\nwidth_px = 1\nheight_px = 1\n\
                 [[light]]\nkind = \"distant\"\ndirection = [0, 0, {z}]\nstrength = 3\n\
                 [[object]]\nshape = \"block\"\nmin_mm = [-9, -9, -0.5]\nmax_mm = [9, 9, 0]\n\
                 medium = {{ sigma_a_per_mm = 1, sigma_s_per_mm = 9 }}\neta = 1.33\n\
                 layers = \"leaf\"\n"
            );
            std::fs::write(&path, scene).unwrap();
            let loaded = crate::rendering::load(&path).unwrap();
            let options = crate::rendering::RenderOptions {
                method: crate::rendering::MethodChoice::Layered,
                rounds: 2,
                until_error: None,
                photons: 1,
                seed: 1,
                components: false,
                exposure: None,
            };
            let picture =
                crate::rendering::render(&loaded, &options, None, &crate::Silent).unwrap();
            let seen = picture.radiance.estimate(0).value / 3.0;
            assert!(
                (seen / expected - 1.0).abs() < 5e-3,
                "{seen} for {expected}"
            );
        }
    }

    /// Over both hemispheres a sheet gives back what adding and doubling says.
    #[test]
    fn a_sheet_has_the_energy_of_its_layers() {
        let rule = GaussLegendre::new(NonZeroUsize::new(40).expect("40 is not zero"));
        for name in ["leaf", "skin"] {
            let medium = read(name, Path::new(""), &mut vec![]).unwrap();
            let sheet = sheet(&medium).unwrap();
            assert_eq!(sheet.open_behind, name == "leaf");
            for cos_in in [0.25, 0.72, 1.0] {
                let solved = ::layers::solve(&medium, &[cos_in], &[]).unwrap();
                let hemisphere = |of: &dyn Fn(&Directions) -> (f64, f64)| {
                    rule.integrate(0.0, 1.0, |cos_out| {
                        let around = rule.integrate(0.0, PI, |azimuth: f64| {
                            let (once, more) = of(&Directions {
                                cos_in,
                                cos_out,
                                cos_azimuth: azimuth.cos(),
                            });
                            once + more
                        });
                        2.0 * cos_out * around
                    })
                };
                let scattered = [
                    solved.reflectance[0] - {
                        // Unscattered light that comes back is no part of the BRDF.
                        sheet.once.unscattered(cos_in).0
                    },
                    solved.transmittance[0] - sheet.once.unscattered(cos_in).1,
                ];
                let found = [
                    hemisphere(&|d| sheet.brdf(d)),
                    hemisphere(&|d| sheet.btdf(d)),
                ];
                println!("{name} {cos_in}: {found:?} of {scattered:?}");
                for (found, expected) in found.into_iter().zip(scattered) {
                    // Between cosines the rest is a line.
                    assert!(
                        (found - expected).abs() < 0.01 * expected + 1e-6,
                        "{name} {cos_in}: {found} for {expected}"
                    );
                }
            }
        }
    }
}
