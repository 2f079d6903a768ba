//! Material tables for other programs, and back.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::read;
use formats::export::{
    Band, Bands, Header, IndexMatched, OpticalProperties, Shade, arnold, blender, mcx, openpbr,
    renderman, vts,
};
use formats::{materials_csv, materials_json, mitsuba, pbrt};
use physics::{Coefficients, DiffuseFresnel, ForwardModel, Material};
use std::collections::BTreeSet;
use std::path::Path;
use tables::{Derived, albedo_without_surface, derived, fresnel_of};
use transport::TransportModel;

/// A program that materials are written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// pbrt-v4.
    Pbrt,
    /// Mitsuba 3.
    Mitsuba,
    /// MaterialX with OpenPBR surfaces.
    OpenPbr,
    /// Blender's Cycles.
    Blender,
    /// Arnold's `standard_surface`.
    Arnold,
    /// RenderMan's `PxrSurface`.
    RenderMan,
    /// MCX.
    Mcx,
    /// The Virtual Tissue Simulator.
    Vts,
}

/// A file for another program.
#[derive(Clone, Debug, PartialEq)]
pub struct Export {
    /// What the file holds.
    pub text: String,
    /// What the program cannot represent or does in its own way, one sentence each.
    pub warnings: Vec<String>,
}

/// Largest ratio of σₜ′ between colours that a walk through all colours at once takes well.
const EVEN_COLORS: f64 = 2.0;
/// Above this colour Cycles' random walk loses more than 5 % of the light.
const CYCLES_CEILING: f64 = 0.90;
/// The rows of the table in `path`: csv, json, a scene of pbrt or one of Mitsuba, by its ending.
///
/// Scenes do not state how long their unit is, so that `scene_unit_mm` has to; tables do.
///
/// # Errors
///
/// A file that is none of these or cannot be read, a scene without its unit.
pub fn read_table(path: &Path, scene_unit_mm: Option<f64>) -> Result<Vec<Material>> {
    let ending = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let unit = || {
        scene_unit_mm.ok_or_else(|| {
            let message = format!(
                "{}: a scene does not say how long its unit is, and coefficients depend on it: give \
                 --scene-unit-mm (1 if a unit is a millimetre, 10 for a centimetre, 1000 for a metre)",
                path.display()
            );
            Error::new(Kind::Usage, message)
        })
    };
    match ending.as_str() {
        "json" => materials_json::read(&read(path)?[..]).input(path.display()),
        "pbrt" => pbrt::read(&read(path)?, unit()?).input(path.display()),
        "xml" => mitsuba::read(&read(path)?, unit()?).input(path.display()),
        _ => materials_csv::read(&read(path)?[..]).input(path.display()),
    }
}

/// `rows` for `target`, in whose scene one unit is `scene_unit_mm` long. `from` names the table.
///
/// # Errors
///
/// Rows that do not make materials of the target: colours that are not R, G and B, a spectrum where
/// none is taken, coefficients that no medium has.
pub fn export(rows: &[Material], target: Target, scene_unit_mm: f64, from: &str) -> Result<Export> {
    for row in rows {
        row.medium
            .validated()
            .input(format!("{from}: {} {}", row.material, row.channel))?;
    }
    let mut warnings = vec![];
    let header = header(target, scene_unit_mm, from);
    let text = match target {
        Target::Mcx | Target::Vts => {
            let media = media(rows, &mut warnings);
            match target {
                Target::Mcx => mcx::write(&header, &media),
                _ => vts::write(&header, &media),
            }
        }
        _ => {
            let shades = shades(rows, from, &mut warnings)?;
            for shade in &shades {
                warnings.extend(limits(shade, target));
            }
            match target {
                Target::Pbrt => Ok(pbrt::write(&header, &shades)),
                Target::Mitsuba => Ok(mitsuba::write(&header, &shades)),
                Target::OpenPbr => openpbr::write(&header, &shades),
                Target::Blender => blender::write(&header, &shades),
                Target::Arnold => arnold::write(&header, &shades),
                _ => renderman::write(&header, &shades),
            }
            .input(from)?
        }
    };
    Ok(Export { text, warnings })
}

/// What stands at the head of a file for `target`: source, units and the meaning of its numbers.
fn header(target: Target, scene_unit_mm: f64, from: &str) -> Header {
    let numbers: &[&str] = match target {
        Target::Pbrt => &[
            "sigma_a and sigma_s = sigma_s' (g = 0, by similarity) in 1/mm; scale = millimetres in a unit of the scene.",
            "NAME is the diffusion model; NAME_surface around NAME_medium is the full transport.",
        ],
        Target::Mitsuba => &[
            "sigma_t * scale = sigma_a + sigma_s' per unit of the scene, albedo = sigma_s'/(sigma_a + sigma_s') (isotropic, by similarity).",
            "<include> this file, then <ref id=\"NAME\"/> and <ref name=\"interior\" id=\"NAME_medium\"/> in a closed shape.",
            "volpath follows all colours on one path: where their sigma_t differ much, take volpathmis or one colour at a time.",
        ],
        Target::OpenPbr => &[
            "subsurface_radius * subsurface_radius_scale = mean free path 1/(sigma_a + sigma_s') in units of the scene (not the diffusion length).",
            "subsurface_color = albedo without a surface, (1 - s)(1 - 0.139 s)/(1 + 1.17 s) with s = sqrt(1 - albedo') (van de Hulst 1980).",
        ],
        Target::Blender => &[
            "Run it in Blender 4.0 or later (Scripting). Cycles' random walk lets out all that comes to the surface from inside:",
            "it is given the medium that, let out so, returns as much light along the normal as this one, and has its diffusion length.",
            "Color = albedo of that medium, (1 - s)(1 - 0.139 s)/(1 + 1.17 s) with s = sqrt(1 - its albedo') (van de Hulst 1980).",
            "Radius times scale = 4 pi/(its sigma_a + sigma_s') in units of the scene: it divides by 4 pi what it is given (bssrdf_setup_radius).",
        ],
        Target::Arnold => &[
            "subsurface_radius = mean free path 1/(sigma_a + sigma_s') in units of the scene.",
            "subsurface_color = albedo without a surface, (1 - s)(1 - 0.139 s)/(1 + 1.17 s) with s = sqrt(1 - albedo') (van de Hulst 1980).",
        ],
        Target::RenderMan => &[
            "The dipole of Jensen et al. 2001 (subsurfaceType 0): color = total diffuse reflectance,",
            "dmfp = diffusion length 1/sqrt(3 sigma_a (sigma_a + sigma_s')) in mm, unitLength = a millimetre in units of the scene.",
        ],
        Target::Mcx => &[
            "mua and mus = sigma_s'/(1 - g) in 1/mm; LengthUnit = edge of a voxel in mm, one unit of the scene.",
        ],
        Target::Vts => &["Mua and Mus = sigma_s'/(1 - g) in 1/mm, lengths in mm."],
    };
    let tool = concat!("beamspot ", env!("CARGO_PKG_VERSION"));
    let mut lines = vec![format!("Written by {tool} from {from}.")];
    if target != Target::Vts {
        lines.push(format!("One unit of the scene is {scene_unit_mm} mm."));
    }
    lines.extend(numbers.iter().map(|&line| line.to_owned()));
    Header {
        lines,
        scene_unit_mm,
    }
}

/// What `target` makes of `shade` that is not what the numbers say.
fn limits(shade: &Shade, target: Target) -> Vec<String> {
    let name = &shade.name;
    let most = |pick: fn(&Band) -> f64| shade.bands.all().map(pick).fold(0.0, f64::max);
    let mut found = vec![];
    match target {
        Target::Mitsuba => {
            let (longest, densest) = (
                most(|b| b.mean_free_path_mm),
                most(|b| b.mean_free_path_mm.recip()),
            );
            if longest * densest > EVEN_COLORS {
                found.push(format!(
                    "{name}: sigma_t' differs {:.1}-fold between colours: volpath will be noisy, take volpathmis",
                    longest * densest
                ));
            }
        }
        Target::Blender => {
            let color = most(|b| b.index_matched.color);
            if color > CYCLES_CEILING {
                found.push(format!(
                    "{name}: a colour of {color:.3} is more than Cycles' random walk gives back, which ends near \
                     {CYCLES_CEILING:.2} (a colour of 0.95 gave 0.897 under an even sky in Blender 4.5): that colour renders too dark"
                ));
            }
        }
        Target::RenderMan => {
            if shade.bands.all().any(|b| b.diffusion_length_mm.is_none()) {
                found.push(format!(
                    "{name}: a colour that absorbs nothing has no diffusion length; {} mm are written",
                    renderman::LONGEST_MM
                ));
            }
        }
        Target::OpenPbr | Target::Arnold | Target::Pbrt | Target::Mcx | Target::Vts => {}
    }
    found
}

/// Every row as a medium of its own.
fn media(rows: &[Material], warnings: &mut Vec<String>) -> Vec<OpticalProperties> {
    let mut without_g = 0;
    let media = rows
        .iter()
        .map(|row| {
            // 1 scatters nothing: not a g that σₛ follows from.
            let g = row.g.filter(|g| *g < 1.0);
            without_g += usize::from(g.is_none());
            let g = g.unwrap_or(0.0);
            OpticalProperties {
                name: format!("{} {}", row.material, row.channel),
                sigma_a_per_mm: row.medium.sigma_a,
                sigma_s_per_mm: row.medium.sigma_s_prime / (1.0 - g),
                g,
                eta: row.medium.eta,
            }
        })
        .collect();
    if without_g > 0 {
        warnings.push(format!(
            "{without_g} of {} rows do not state g: they are written as isotropic, mus = sigma_s' and g = 0, which \
             holds some mean free paths from the source and not nearer",
            rows.len()
        ));
    }
    media
}

/// Rows of one material together, in the order in which materials first occur.
fn shades(rows: &[Material], from: &str, warnings: &mut Vec<String>) -> Result<Vec<Shade>> {
    let mut materials: Vec<Vec<&Material>> = vec![];
    for row in rows {
        match materials.iter_mut().find(|m| m[0].material == row.material) {
            Some(found) => found.push(row),
            None => materials.push(vec![row]),
        }
    }
    let mut names = BTreeSet::new();
    let mut shades = vec![];
    for rows in materials {
        let material = &rows[0].material;
        let name = identifier(material);
        if !names.insert(name.clone()) {
            let message = format!(
                "{from}: material `{material}` would be called `{name}` as another one is; rename one"
            );
            return Err(Error::new(Kind::Input, message));
        }
        let bands = bands(&rows, from)?;
        let etas = || rows.iter().map(|r| r.medium.eta);
        let eta = etas().sum::<f64>() / rows.len() as f64;
        if etas().any(|e| (e - eta).abs() > 1e-9) {
            warnings.push(format!(
                "{material}: its colours have several eta and the target takes one: their mean, {eta:.4}, is written"
            ));
        }
        shades.push(Shade {
            name,
            notes: notes(&rows),
            eta,
            bands,
        });
    }
    Ok(shades)
}

/// Lengths, albedo and total of every colour, beside the source, for who reads the file.
fn notes(rows: &[&Material]) -> Vec<String> {
    let first = rows[0];
    let mut lines = vec![];
    if !first.source.is_empty() {
        lines.push(format!("{} ({})", first.material, first.source));
    }
    for row in rows {
        let band = band(row);
        let length = band
            .diffusion_length_mm
            .map_or("infinite".to_owned(), |l| format!("{l:.4} mm"));
        lines.push(format!(
            "{}: mean free path {:.4} mm, diffusion length {length}, albedo' {:.5}, R_d {:.4}",
            row.channel, band.mean_free_path_mm, band.albedo_prime, band.total_reflectance
        ));
    }
    lines
}

fn band(row: &Material) -> Band {
    let fresnel = fresnel_of(&row.model).unwrap_or(DiffuseFresnel::Exact);
    let follows = derived(&row.medium, fresnel);
    Band {
        sigma_a_per_mm: row.medium.sigma_a,
        sigma_s_prime_per_mm: row.medium.sigma_s_prime,
        mean_free_path_mm: follows.mean_free_path_mm,
        albedo_prime: follows.albedo_prime,
        color: follows.albedo_without_surface,
        diffusion_length_mm: follows.diffusion_length_mm,
        total_reflectance: follows.total_reflectance,
        index_matched: index_matched(row, &follows),
    }
}

/// Share of the light that may be absorbed so little that no program tells it from none.
const LEAST_ABSORBED: f64 = 1e-6;

/// See [`IndexMatched`]; the totals of both are those of transport.
fn index_matched(row: &Material, follows: &Derived) -> IndexMatched {
    let total = |albedo_prime: f64, model: &TransportModel| {
        let medium = Coefficients {
            sigma_a: 1.0 - albedo_prime,
            sigma_s_prime: albedo_prime,
        };
        model.within(medium, f64::INFINITY).value
    };
    let albedo_prime = follows.albedo_prime.min(1.0 - LEAST_ABSORBED);
    // Where the table does not reach, the dipole has to do.
    let g = row.g.unwrap_or(0.0);
    let wanted = TransportModel::new(row.medium.eta, g)
        .map_or(follows.total_reflectance, |model| {
            total(albedo_prime, &model)
        });
    let matched = TransportModel::new(1.0, 0.0).expect("a table that reaches to air");
    // Between what is black and what is white, in the root of what is absorbed.
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let root: f64 = 0.5 * (low + high);
        if total(1.0 - root * root, &matched) > wanted {
            low = root;
        } else {
            high = root;
        }
    }
    // 1/(mean free path x root) is what both have in common: sqrt(3) diffusion lengths.
    let longer = high / (1.0 - albedo_prime).sqrt();
    IndexMatched {
        color: albedo_without_surface(1.0 - high * high),
        mean_free_path_mm: longer * follows.mean_free_path_mm,
    }
}

/// The colours of one material: R, G and B, one that serves for all three, or a spectrum.
fn bands(rows: &[&Material], from: &str) -> Result<Bands> {
    let channel = |name: &str| rows.iter().find(|r| r.channel.eq_ignore_ascii_case(name));
    if let (3, Some(r), Some(g), Some(b)) = (rows.len(), channel("R"), channel("G"), channel("B")) {
        return Ok(Bands::Rgb(Box::new([band(r), band(g), band(b)])));
    }
    let mut spectrum: Vec<(f64, Band)> = rows
        .iter()
        .filter_map(|row| Some((row.wavelength_nm?, band(row))))
        .collect();
    if spectrum.len() == rows.len() && rows.len() > 1 {
        spectrum.sort_by(|a, b| a.0.total_cmp(&b.0));
        if spectrum.windows(2).all(|pair| pair[0].0 < pair[1].0) {
            return Ok(Bands::Spectrum(spectrum));
        }
    }
    if let [one] = rows {
        return Ok(Bands::Rgb(Box::new([band(one); 3])));
    }
    let channels: Vec<&str> = rows.iter().map(|r| r.channel.as_str()).collect();
    let message = format!(
        "{from}: material `{}` has channels {}; expected R, G and B, a single one, or a wavelength_nm in every row, \
         no two of them equal",
        rows[0].material,
        channels.join(", ")
    );
    Err(Error::new(Kind::Input, message))
}

/// `name` out of letters, digits and underscores, as every target takes it.
fn identifier(name: &str) -> String {
    let mut found: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if !found.starts_with(|c: char| c.is_ascii_alphabetic()) {
        found.insert(0, 'm');
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library;

    fn marble() -> Vec<Material> {
        library::material("marble").unwrap()
    }

    const ALL: [Target; 8] = [
        Target::Pbrt,
        Target::Mitsuba,
        Target::OpenPbr,
        Target::Blender,
        Target::Arnold,
        Target::RenderMan,
        Target::Mcx,
        Target::Vts,
    ];

    #[test]
    fn the_whole_shipped_table_goes_to_every_program() {
        let rows = library::materials();
        for target in ALL {
            let Export { text, warnings } = export(&rows, target, 1.0, "materials.csv").unwrap();
            assert!(text.contains("from materials.csv"), "{target:?}");
            for name in ["Skimmilk", "Spectralon", "Wholemilk"] {
                assert!(text.contains(name), "{target:?}: {name}");
            }
            let expected = match target {
                Target::Mitsuba => "Ketchup: sigma_t' differs",
                Target::Blender => "Spectralon: a colour of",
                Target::RenderMan => "Spectralon: a colour that absorbs",
                Target::Mcx | Target::Vts => "36 of 36 rows",
                _ => "",
            };
            let warned = warnings.join("\n");
            assert!(warned.contains(expected), "{warned}");
            assert_eq!(warned.is_empty(), expected.is_empty(), "{warned}");
        }
    }

    #[test]
    fn scenes_read_back_to_the_coefficients() {
        let rows = marble();
        for (target, ending) in [(Target::Pbrt, "pbrt"), (Target::Mitsuba, "xml")] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("marble").with_extension(ending);
            std::fs::write(&path, export(&rows, target, 10.0, "m").unwrap().text).unwrap();
            let unit = read_table(&path, None).unwrap_err();
            assert_eq!(unit.kind(), Kind::Usage);
            assert!(unit.to_string().contains("--scene-unit-mm"), "{unit}");
            let back = read_table(&path, Some(10.0)).unwrap();
            for (row, back) in rows.iter().zip(&back) {
                let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
                assert!(near(row.medium.sigma_a, back.medium.sigma_a), "{back:?}");
                assert!(
                    near(row.medium.sigma_s_prime, back.medium.sigma_s_prime),
                    "{back:?}"
                );
                assert_eq!(
                    (row.medium.eta, &row.channel),
                    (back.medium.eta, &back.channel)
                );
            }
            assert_eq!(back.len(), 3);
        }
    }

    #[test]
    fn scattering_for_photons_is_not_reduced() {
        let mut rows = marble();
        for row in &mut rows {
            row.g = Some(0.75);
        }
        let Export { text, warnings } = export(&rows, Target::Mcx, 1.0, "m").unwrap();
        assert!(
            text.contains("\"mus\": 8.76") && warnings.is_empty(),
            "{text}"
        );
    }

    #[test]
    fn a_spectrum_keeps_its_wavelengths_and_one_channel_serves_for_three() {
        let mut rows = marble();
        for (row, wavelength) in rows.iter_mut().zip([600.0, 500.0, 400.0]) {
            row.channel = format!("{wavelength}");
            row.wavelength_nm = Some(wavelength);
        }
        let text = export(&rows, Target::Pbrt, 1.0, "m").unwrap().text;
        assert!(
            text.contains("\"spectrum sigma_a\" [ 400 0.0071 500 0.0041 600 0.0021 ]"),
            "{text}"
        );
        let refused = export(&rows, Target::Blender, 1.0, "m").unwrap_err();
        assert!(refused.to_string().contains("is a spectrum"), "{refused}");
        let text = export(&rows[..1], Target::Pbrt, 1.0, "m").unwrap().text;
        assert!(
            text.contains("\"rgb sigma_a\" [ 0.0021 0.0021 0.0021 ]"),
            "{text}"
        );
    }

    #[test]
    fn rows_that_make_no_material_are_named() {
        let refused = |rows: &[Material]| {
            export(rows, Target::Pbrt, 1.0, "m.csv")
                .unwrap_err()
                .to_string()
        };
        let mut rows = marble();
        rows[1].channel = "near".to_owned();
        assert!(refused(&rows).contains("m.csv: material `Marble` has channels R, near, B"));
        let mut rows = marble();
        rows[0].medium.sigma_a = -1.0;
        assert!(
            refused(&rows).contains("m.csv: Marble R"),
            "{}",
            refused(&rows)
        );
        let mut twice = marble();
        twice.extend(marble().into_iter().map(|mut row| {
            row.material = "Mar ble".to_owned();
            row
        }));
        twice[0].material = "Mar_ble".to_owned();
        twice[1].material = "Mar_ble".to_owned();
        twice[2].material = "Mar_ble".to_owned();
        assert!(
            refused(&twice).contains("would be called `Mar_ble`"),
            "{}",
            refused(&twice)
        );
        let mut uneven = marble();
        uneven[0].medium.eta = 1.2;
        let warnings = export(&uneven, Target::Pbrt, 1.0, "m").unwrap().warnings;
        assert!(warnings[0].contains("their mean, 1.4000"), "{warnings:?}");
    }
}
