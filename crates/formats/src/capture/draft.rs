//! A manifest to be filled in: what a folder of frames tells, and marks where it does not.

use crate::toml_text::quoted;
use std::fmt::Write;

/// Stands for what nobody has filled in yet; a manifest that holds one is refused by its field.
pub(super) const PLACEHOLDER: &str = "?";

/// What a folder of frames tells of a capture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Draft {
    /// Name of the material.
    pub material: String,
    /// Frames of the sample.
    pub frames: Vec<DraftFrame>,
    /// Darks of the sample.
    pub dark: Vec<DraftFrame>,
    /// Frames of the white reference.
    pub reference_frames: Vec<DraftFrame>,
    /// Darks of the white reference.
    pub reference_dark: Vec<DraftFrame>,
    /// Whether the frames have 8 bits, and someone has to say that they are linear.
    pub eight_bits: bool,
}

/// A frame of a draft.
#[derive(Clone, Debug, PartialEq)]
pub struct DraftFrame {
    /// The file, relative to the folder of the manifest.
    pub file: String,
    /// Its exposure time, s, and where it is from; the reason where there is none.
    pub exposure: Result<(f64, String), String>,
}

impl Draft {
    /// The text of the manifest.
    pub fn to_toml(&self) -> String {
        let material = quoted(&self.material);
        let mark = quoted(PLACEHOLDER);
        let response = if self.eight_bits {
            "\n# The frames have 8 bits. If the camera wrote its counts as they are, without a curve, say so:\n# response = \"linear\""
        } else {
            ""
        };
        format!(
            "\
# Written by `beamspot init`. Fill in every {mark}; `beamspot measure` refuses what is left.
material = {material}
eta = {mark}                       # relative refractive index of the sample, as 1.3 or 1.5
# u_eta = 0.01                  # every u_* may be left out: a stated default is taken

[geometry]
mm_per_pixel = {mark}              # what one pixel sees of the sample: photograph a ruler
# u_mm_per_pixel =              # or, of a tilted view, corners_px and corners_mm: four [x, y] each

[beam]
# fwhm_mm =                     # full width at half maximum on the sample, 0 for a point; left
#                               # out: measured on the white, whose own glow is given below

[camera]                        # from the data sheet and a short dark frame
# gain_e_per_dn =               # electrons per count
# read_noise_e =                # standard deviation of one read-out, electrons
# black_level_dn =              # count that no light gives
# white_level_dn =              # count at which a pixel saturates{response}

[sample]
# thickness_mm =                # left out: so thick that no light comes out behind; else measure with --model multipole
frames = {}
dark = {}

[reference]
reflectance = {mark}               # total diffuse reflectance of the white, as 0.99
# u_reflectance = 0.01
# sigma_s_prime_per_mm =        # of the white itself, which glows too
# sigma_a_per_mm =
# u_sigma_a_per_mm =            # left out: half of it, or of what absorbs the light that is lost
frames = {}
dark = {}
",
            list(&self.frames),
            list(&self.dark),
            list(&self.reference_frames),
            list(&self.reference_dark),
        )
    }
}

fn list(frames: &[DraftFrame]) -> String {
    let mut text = "[\n".to_owned();
    for DraftFrame { file, exposure } in frames {
        let file = quoted(file);
        let (seconds, from) = match exposure {
            Ok((seconds, from)) => (format!("{seconds:?}"), from),
            Err(reason) => (quoted(PLACEHOLDER), reason),
        };
        // A comment ends with its line.
        let from = from.replace(|c: char| c.is_control(), " ");
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {{ file = {file}, exposure_s = {seconds} }},  # {from}"
        );
    }
    text + "]"
}

#[cfg(test)]
mod tests {
    use super::super::parse_capture;
    use super::*;

    #[test]
    fn a_draft_is_refused_field_by_field_until_it_is_filled_in() {
        let frame = |file: &str, exposure_s: f64| DraftFrame {
            file: file.to_owned(),
            exposure: Ok((exposure_s, "EXIF,\nExposureTime".to_owned())),
        };
        let draft = Draft {
            material: "a \"stone\"".to_owned(),
            frames: vec![frame("s.tif", 0.1)],
            dark: vec![frame("d.tif", 0.1)],
            reference_frames: vec![DraftFrame {
                file: "w.tif".to_owned(),
                exposure: Err("no time is stated".to_owned()),
            }],
            reference_dark: vec![frame("wd.tif", 0.1)],
            eight_bits: true,
        };
        let mut text = draft.to_toml();
        for (field, filled) in [
            ("eta", "1.5"),
            ("geometry.mm_per_pixel", "0.05"),
            ("reference.frames[0].exposure_s", "0.1"),
            ("reference.reflectance", "0.99"),
        ] {
            let message = parse_capture(&text).unwrap_err().to_string();
            assert!(message.contains(&format!("`{field}`")), "{message}");
            assert!(message.contains("is still \"?\""), "{message}");
            let key = field.rsplit('.').next().unwrap_or(field);
            text = text.replacen(&format!("{key} = \"?\""), &format!("{key} = {filled}"), 1);
        }
        let capture = parse_capture(&text).unwrap();
        assert_eq!(capture.material, draft.material);
        assert_eq!(capture.reference.frames[0].exposure_s, 0.1);
    }
}
