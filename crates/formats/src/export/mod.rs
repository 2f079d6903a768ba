//! Materials as other programs read them.
//!
//! A renderer takes one material with three colours or a spectrum ([`Shade`]); a photon simulator
//! takes media one by one ([`OpticalProperties`]). Both come with every number that a target may
//! ask for already worked out: nothing here knows a formula, a unit other than the millimetre of
//! the numbers and the scene's own, or where the rows came from. What the numbers are is said at
//! the head of every file, by [`Header`].
//!
//! | module | program |
//! |---|---|
//! | [`crate::pbrt`], [`crate::mitsuba`] | pbrt-v4, Mitsuba 3: coefficients, and back |
//! | [`openpbr`] | MaterialX with OpenPBR surfaces |
//! | [`blender`] | a script that makes materials for Cycles |
//! | [`arnold`], [`renderman`] | standard_surface, PxrSurface |
//! | [`mcx`], [`vts`] | photon simulators |
//! | [`datapackage`] | what the columns of `materials.csv` mean, for programs |

pub mod arnold;
pub mod blender;
pub mod datapackage;
pub mod mcx;
pub mod openpbr;
pub mod renderman;
pub mod vts;

use physics::{Material, ReducedMedium};

/// What stands at the head of a written file, one sentence a line, whatever a comment looks like
/// there.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Who wrote it and from what.
    pub lines: Vec<String>,
    /// Length of one unit of the scene, mm.
    pub scene_unit_mm: f64,
}

impl Header {
    /// The lines, each behind `mark`.
    pub(crate) fn marked(&self, mark: &str) -> String {
        self.lines
            .iter()
            .map(|line| format!("{mark} {line}\n"))
            .collect()
    }
}

/// A material as a renderer takes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Shade {
    /// Name, made of letters, digits and underscores, another for every material of a file.
    pub name: String,
    /// What a reader wants to know of it, one sentence a line.
    pub notes: Vec<String>,
    /// Index of the material over that of what is around it.
    pub eta: f64,
    /// Red, green and blue, or one band a wavelength.
    pub bands: Bands,
}

/// The colours of a [`Shade`].
#[derive(Clone, Debug, PartialEq)]
pub enum Bands {
    /// Red, green and blue.
    Rgb(Box<[Band; 3]>),
    /// Wavelengths, nm, increasing, and what holds there.
    Spectrum(Vec<(f64, Band)>),
}

impl Bands {
    /// Every colour.
    pub fn all(&self) -> impl Iterator<Item = &Band> {
        let (rgb, spectrum) = match self {
            Self::Rgb(bands) => (bands.as_slice(), &[][..]),
            Self::Spectrum(bands) => (&[][..], bands.as_slice()),
        };
        rgb.iter().chain(spectrum.iter().map(|(_, band)| band))
    }
}

/// One colour of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// σₐ, mm⁻¹.
    pub sigma_a_per_mm: f64,
    /// σₛ′, mm⁻¹; scattering is taken as isotropic.
    pub sigma_s_prime_per_mm: f64,
    /// Transport mean free path 1/σₜ′, mm.
    pub mean_free_path_mm: f64,
    /// Reduced albedo α′.
    pub albedo_prime: f64,
    /// Albedo of a half-space without a surface that reflects: what renderers call the colour of
    /// subsurface scattering.
    pub color: f64,
    /// Diffusion length 1/σₜᵣ, mm; `None` where nothing absorbs.
    pub diffusion_length_mm: Option<f64>,
    /// Total diffuse reflectance per power that enters, of the dipole.
    pub total_reflectance: f64,
    /// The same medium for a program that does not reflect back inside at the surface.
    pub index_matched: IndexMatched,
}

/// A medium without a reflecting surface that gives back as much of the light that enters along the
/// normal as another one under its surface, and falls off over the same diffusion length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndexMatched {
    /// Its albedo under diffuse light.
    pub color: f64,
    /// Its transport mean free path, mm.
    pub mean_free_path_mm: f64,
}

/// A medium as a photon simulator takes it.
#[derive(Clone, Debug, PartialEq)]
pub struct OpticalProperties {
    /// Material and channel.
    pub name: String,
    /// σₐ, mm⁻¹.
    pub sigma_a_per_mm: f64,
    /// σₛ, mm⁻¹, not reduced.
    pub sigma_s_per_mm: f64,
    /// Mean cosine of the scattering angle.
    pub g: f64,
    /// Index of the material over that of what is around it.
    pub eta: f64,
}

/// The target has no place for what it was given.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("material `{name}` is a spectrum, and {target} takes red, green and blue: {advice}")]
pub struct SpectrumError {
    /// The material.
    pub name: String,
    /// The program.
    pub target: &'static str,
    /// What to do.
    pub advice: &'static str,
}

impl Shade {
    /// Red, green and blue of a quantity, for a target that takes nothing else.
    pub(crate) fn rgb(&self, target: &'static str) -> Result<&[Band; 3], SpectrumError> {
        match &self.bands {
            Bands::Rgb(bands) => Ok(bands),
            Bands::Spectrum(_) => Err(SpectrumError {
                name: self.name.clone(),
                target,
                advice: "export to pbrt or mitsuba, which take spectra, or give three rows called R, G and B",
            }),
        }
    }
}

/// Wavelengths and numbers of a spectrum, `joint` between the two, `between` after each.
pub(crate) fn spectrum(
    bands: &[(f64, Band)],
    pick: impl Fn(&Band) -> f64,
    joint: &str,
    between: &str,
) -> String {
    let number = crate::csv_table::number;
    bands
        .iter()
        .map(|(wavelength, band)| format!("{}{joint}{}", number(*wavelength), number(pick(band))))
        .collect::<Vec<_>>()
        .join(between)
}

/// A row of which a scene says no more than `medium` and `g`; a g of 0 is as good as none.
pub(crate) fn bare_row(
    material: &str,
    (channel, wavelength_nm): (String, Option<f64>),
    medium: ReducedMedium,
    g: f64,
    source: &str,
) -> Material {
    Material {
        material: material.to_owned(),
        channel,
        wavelength_nm,
        medium,
        u_sigma_a_per_mm: None,
        u_sigma_s_prime_per_mm: None,
        correlation: None,
        total_reflectance: None,
        g: Some(g).filter(|g| *g != 0.0),
        model: String::new(),
        source: source.to_owned(),
    }
}

/// Lines of a comment in XML, which may not hold two hyphens.
pub(crate) fn xml_comment(lines: &[String], indent: &str) -> String {
    lines
        .iter()
        .map(|line| format!("{indent}{}\n", line.replace("--", "- -")))
        .collect()
}

/// Numbers of three bands with spaces between.
pub(crate) fn triple(bands: &[Band; 3], pick: impl Fn(&Band) -> f64, between: &str) -> String {
    bands
        .iter()
        .map(|band| crate::csv_table::number(pick(band)))
        .collect::<Vec<_>>()
        .join(between)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Two colours of marble and one that absorbs nothing.
    pub(crate) fn shade() -> Shade {
        let band = |sigma_a: f64, sigma_s_prime: f64, length| Band {
            sigma_a_per_mm: sigma_a,
            sigma_s_prime_per_mm: sigma_s_prime,
            mean_free_path_mm: 1.0 / (sigma_a + sigma_s_prime),
            albedo_prime: sigma_s_prime / (sigma_a + sigma_s_prime),
            color: 0.9,
            diffusion_length_mm: length,
            total_reflectance: 0.8,
            index_matched: IndexMatched {
                color: 0.85,
                mean_free_path_mm: 1.5 / (sigma_a + sigma_s_prime),
            },
        };
        Shade {
            name: "Marble".into(),
            notes: vec!["a note".into()],
            eta: 1.5,
            bands: Bands::Rgb(Box::new([
                band(0.25, 1.75, Some(4.0)),
                band(0.5, 1.5, Some(2.0)),
                band(0.0, 4.0, None),
            ])),
        }
    }

    pub(crate) fn milk() -> OpticalProperties {
        OpticalProperties {
            name: "milk G".into(),
            sigma_a_per_mm: 0.25,
            sigma_s_per_mm: 8.0,
            g: 0.75,
            eta: 1.3,
        }
    }

    pub(crate) fn header() -> Header {
        Header {
            lines: vec!["first".into(), "second".into()],
            scene_unit_mm: 10.0,
        }
    }

    #[test]
    fn a_spectrum_is_refused_where_it_has_no_place() {
        let mut spectral = shade();
        let Bands::Rgb(bands) = &shade().bands else {
            unreachable!()
        };
        spectral.bands = Bands::Spectrum(vec![(500.0, bands[0]), (600.0, bands[1])]);
        let one = std::slice::from_ref(&spectral);
        let refusals = [
            openpbr::write(&header(), one).unwrap_err(),
            blender::write(&header(), one).unwrap_err(),
            arnold::write(&header(), one).unwrap_err(),
            renderman::write(&header(), one).unwrap_err(),
        ];
        for refusal in refusals {
            let text = refusal.to_string();
            assert!(
                text.contains("Marble") && text.contains(refusal.target),
                "{text}"
            );
        }
    }
}
