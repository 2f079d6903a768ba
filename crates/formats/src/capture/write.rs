//! A manifest as a person would write it: a frame a line, and only what is stated.

use super::{
    Beam, BeamProfile, Camera, Capture, Exit, FrameEntry, Model, PerChannel, PixelSize, Region,
    Response,
};
use crate::toml_text::quoted;
use std::fmt::Write;

impl Capture {
    /// The text of the manifest; it reads back to an equal [`Capture`].
    pub fn to_toml(&self) -> String {
        let Self {
            geometry,
            beam,
            camera,
            model,
            sample,
            reference,
            ..
        } = self;
        let mut text = Text(String::new());
        text.line("material", quoted(&self.material));
        text.number("eta", self.eta);
        text.optional("u_eta", self.u_eta);

        text.section("geometry");
        match geometry.mm_per_pixel {
            Some(PixelSize::Square(side)) => text.number("mm_per_pixel", side),
            Some(PixelSize::Rectangular(sides)) => text.line("mm_per_pixel", format!("{sides:?}")),
            None => {}
        }
        text.optional("u_mm_per_pixel", geometry.u_mm_per_pixel);
        for (key, corners) in [
            ("corners_px", &geometry.corners_px),
            ("corners_mm", &geometry.corners_mm),
        ] {
            if let Some(corners) = corners {
                text.line(key, format!("{corners:?}"));
            }
        }
        text.optional("u_corners_mm", geometry.u_corners_mm);
        if let Some([column, row]) = geometry.center_px {
            text.line("center_px", format!("[{column:?}, {row:?}]"));
        }
        if *beam != Beam::default() {
            text.section("beam");
            text.optional("fwhm_mm", beam.fwhm_mm);
            text.optional("u_fwhm_mm", beam.u_fwhm_mm);
            let profile = match beam.profile {
                BeamProfile::Gaussian => "gaussian",
                BeamProfile::Disk => "disk",
            };
            text.line("profile", quoted(profile));
            text.number("angle_deg", beam.angle_deg);
            text.optional("u_angle_deg", beam.u_angle_deg);
        }
        if *camera != Camera::default() {
            text.section("camera");
            text.optional("angle_deg", camera.angle_deg);
            text.optional("u_angle_deg", camera.u_angle_deg);
            text.optional("gain_e_per_dn", camera.gain_e_per_dn);
            text.optional("read_noise_e", camera.read_noise_e);
            text.optional("black_level_dn", camera.black_level_dn);
            text.optional("white_level_dn", camera.white_level_dn);
            text.number("prnu_relative", camera.prnu_relative);
            if let Some(response) = camera.response {
                let name = match response {
                    Response::Linear => "linear",
                    Response::Recover => "recover",
                };
                text.line("response", quoted(name));
            }
            if let Some(mosaic) = camera.mosaic {
                text.line("mosaic", quoted(&mosaic.to_string()));
            }
            if let Some(unit) = camera.fits_exposure_unit {
                text.line("fits_exposure_unit", quoted(unit.name()));
            }
        }
        if *model != Model::default() {
            text.section("model");
            text.line("entry_loss", model.entry_loss.to_string());
            let exit = match model.exit {
                Exit::Fresnel => "fresnel",
                Exit::Lambert => "lambert",
            };
            text.line("exit", quoted(exit));
            text.optional("g", model.g);
            if !model.discrepancy {
                text.line("discrepancy", "false");
            }
        }

        text.section("sample");
        text.optional("thickness_mm", sample.thickness_mm);
        text.left_out(sample.mask.as_deref(), &sample.leave_out);
        if !sample.sectors_deg.is_empty() {
            text.line("sectors_deg", format!("{:?}", sample.sectors_deg));
        }
        text.optional("eta_below", sample.eta_below);
        if let Some(rendering) = &sample.rendering {
            text.line("rendering", quoted(rendering));
        }
        text.frames("frames", &sample.frames);
        text.frames("dark", &sample.dark);

        text.section("reference");
        text.number("reflectance", reference.reflectance);
        text.optional("u_reflectance", reference.u_reflectance);
        text.per_channel(
            "sigma_s_prime_per_mm",
            reference.sigma_s_prime_per_mm.as_ref(),
        );
        text.optional(
            "u_sigma_s_prime_relative",
            reference.u_sigma_s_prime_relative,
        );
        text.per_channel("sigma_a_per_mm", reference.sigma_a_per_mm.as_ref());
        text.per_channel("u_sigma_a_per_mm", reference.u_sigma_a_per_mm.as_ref());
        text.optional("eta", reference.eta);
        text.left_out(reference.mask.as_deref(), &reference.leave_out);
        text.frames("frames", &reference.frames);
        text.frames("dark", &reference.dark);
        text.0
    }
}

struct Text(String);

impl Text {
    fn section(&mut self, name: &str) {
        self.0.push_str("\n[");
        self.0.push_str(name);
        self.0.push_str("]\n");
    }

    fn line(&mut self, key: &str, value: impl AsRef<str>) {
        for part in [key, " = ", value.as_ref(), "\n"] {
            self.0.push_str(part);
        }
    }

    fn number(&mut self, key: &str, value: f64) {
        self.line(key, format!("{value:?}"));
    }

    fn optional(&mut self, key: &str, value: Option<f64>) {
        if let Some(value) = value {
            self.number(key, value);
        }
    }

    fn per_channel(&mut self, key: &str, value: Option<&PerChannel>) {
        match value {
            None => {}
            Some(PerChannel::All(value)) => self.number(key, *value),
            Some(PerChannel::Each(values)) => self.line(key, format!("{values:?}")),
        }
    }

    fn left_out(&mut self, mask: Option<&str>, regions: &[Region]) {
        if let Some(mask) = mask {
            self.line("mask", quoted(mask));
        }
        let one = |region: &Region| match region {
            Region::Circle { circle_px } => format!("{{ circle_px = {circle_px:?} }}"),
            Region::Polygon { polygon_px } => format!("{{ polygon_px = {polygon_px:?} }}"),
        };
        if !regions.is_empty() {
            let list: Vec<String> = regions.iter().map(one).collect();
            self.line("leave_out", format!("[{}]", list.join(", ")));
        }
    }

    fn frames(&mut self, key: &str, frames: &[FrameEntry]) {
        let list = frames.iter().fold("[\n".to_owned(), |mut list, frame| {
            let FrameEntry { file, exposure_s } = frame;
            let file = quoted(file);
            // Writing to a String cannot fail.
            let _ = writeln!(list, "  {{ file = {file}, exposure_s = {exposure_s:?} }},");
            list
        });
        self.line(key, list + "]");
    }
}
