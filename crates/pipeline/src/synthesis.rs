//! Synthetic captures as files: what a laboratory would have on its disk.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::Outputs;
use crate::library::{self, ModelChoice};
use crate::monitor::Monitor;
use formats::capture as manifest;
use physics::{Coefficients, ForwardModel};
use std::io::Write;
use std::path::{Path, PathBuf};
use synth::{Camera, Capture, Role, Sample, Shot};

/// The shipped material called `name`, as a sample.
///
/// # Errors
///
/// No material is called so.
pub fn sample_of(name: &str) -> Result<Sample> {
    let rows = library::material(name)?;
    Ok(Sample {
        material: rows[0].material.clone(),
        eta: rows[0].medium.eta,
        channels: rows
            .iter()
            .map(|row| (row.channel.clone(), row.medium.coefficients()))
            .collect(),
    })
}

/// The sample of a medium file.
///
/// # Errors
///
/// The file cannot be read or used.
pub fn sample_from(path: &Path) -> Result<Sample> {
    let text = crate::files::read_text(path)?;
    let file = formats::sample_toml::parse(&text).input(path.display())?;
    Ok(Sample {
        material: file.material.clone(),
        eta: file.eta,
        channels: file
            .channel
            .iter()
            .map(|c| {
                let Coefficients {
                    sigma_a,
                    sigma_s_prime,
                } = file.medium(c).coefficients();
                (
                    c.name.clone(),
                    Coefficients {
                        sigma_a,
                        sigma_s_prime,
                    },
                )
            })
            .collect(),
    })
}

/// The synthetic camera of a file.
///
/// # Errors
///
/// The file cannot be read or used.
pub fn camera_from(path: &Path) -> Result<Camera> {
    let text = crate::files::read_text(path)?;
    let camera: Camera = formats::parse_toml(&text).input(path.display())?;
    camera.validated().input(path.display())
}

/// Folder and prefix of each role.
fn stem(role: Role) -> (&'static str, &'static str) {
    match role {
        Role::Sample => ("sample", "sample"),
        Role::SampleDark => ("sample", "dark"),
        Role::Reference => ("reference", "reference"),
        Role::ReferenceDark => ("reference", "dark"),
    }
}

fn file_name(shot: &Shot) -> String {
    let (folder, prefix) = stem(shot.role);
    let repeat = if shot.repeat > 0 {
        format!("_{}", shot.repeat + 1)
    } else {
        String::new()
    };
    format!("{folder}/{prefix}_{:02}{repeat}.tif", shot.exposure + 1)
}

/// Writes the capture of `sample` by `camera` into `folder`: frames as 16-bit TIFF,
/// `capture.toml` and `truth.json`.
///
/// # Errors
///
/// The camera or the sample is impossible, the model unknown, or the folder holds such files.
pub fn write(
    sample: &Sample,
    camera: Camera,
    model: &ModelChoice,
    seed: u64,
    folder: &Path,
    force: bool,
    monitor: &dyn Monitor,
) -> Result<PathBuf> {
    library::model(model, sample.eta)?;
    let sample = &seen_by(&camera, sample);
    let at = |eta: f64| -> Box<dyn ForwardModel> {
        library::model(model, eta).expect("the name was tried above")
    };
    let capture =
        Capture::new(sample, camera, &at, seed).input(format!("synth {}", sample.material))?;
    let shots = capture.shots();
    let names = shots
        .iter()
        .map(file_name)
        .chain(["capture.toml".into(), "truth.json".into()]);
    let outputs = Outputs::new(folder, names, &[], force)?;
    monitor.begin("exposing", shots.len() as u64);
    for shot in &shots {
        monitor.check()?;
        let frame = capture.expose(shot);
        outputs.write(file_name(shot), |out| {
            Ok(formats::encode_tiff(&frame, out)?)
        })?;
        monitor.step();
    }
    let manifest = manifest_of(sample, &capture, &shots, model);
    outputs.write("capture.toml", |out| {
        Ok(out.write_all(manifest.to_toml().as_bytes())?)
    })?;
    let truth = serde_json::to_string_pretty(capture.truth())
        .map_err(|e| Error::new(Kind::Fault, e))?
        + "\n";
    outputs.write("truth.json", |out| Ok(out.write_all(truth.as_bytes())?))?;
    outputs.commit()?;
    Ok(folder.join("capture.toml"))
}

/// The sample as the camera sees it: a mono camera sees the green of an RGB sample.
fn seen_by(camera: &Camera, sample: &Sample) -> Sample {
    let mut seen = sample.clone();
    if camera.channels == synth::Channels::Mono && sample.channels.len() > 1 {
        seen.channels.retain(|(name, _)| name == "G");
    }
    seen
}

/// What the laboratory would have written down.
fn manifest_of(
    sample: &Sample,
    capture: &Capture,
    shots: &[Shot],
    model: &ModelChoice,
) -> manifest::Capture {
    let camera = capture.camera();
    let sensor = camera.sensor();
    let white = &camera.reference;
    let corners = capture.corners();
    let entries = |role: Role| {
        shots
            .iter()
            .filter(|s| s.role == role)
            .map(|s| manifest::FrameEntry {
                file: file_name(s),
                exposure_s: s.exposure_s,
            })
            .collect()
    };
    manifest::Capture {
        material: sample.material.clone(),
        eta: sample.eta,
        u_eta: Some(camera.u_eta),
        geometry: manifest::Geometry {
            mm_per_pixel: match corners {
                Some(_) => None,
                None if camera.pixel_aspect == 1.0 => {
                    Some(manifest::PixelSize::Square(camera.mm_per_pixel))
                }
                None => {
                    let down = camera.mm_per_pixel * camera.pixel_aspect;
                    Some(manifest::PixelSize::Rectangular([
                        camera.mm_per_pixel,
                        down,
                    ]))
                }
            },
            u_mm_per_pixel: corners.is_none().then_some(camera.u_mm_per_pixel),
            corners_px: corners.map(|(px, _)| px),
            corners_mm: corners.map(|(_, mm)| mm),
            // The scale of all corners together is off, by the same share as a pixel's.
            u_corners_mm: corners.map(|(_, mm)| {
                let side = (mm[1][0] - mm[0][0]).hypot(mm[1][1] - mm[0][1]);
                camera.u_mm_per_pixel / camera.mm_per_pixel * side
            }),
            center_px: None,
        },
        beam: manifest::Beam {
            fwhm_mm: Some(camera.beam_fwhm_mm),
            u_fwhm_mm: Some(0.0),
            profile: match camera.beam_profile {
                synth::BeamProfile::Gaussian => manifest::BeamProfile::Gaussian,
                synth::BeamProfile::Disk => manifest::BeamProfile::Disk,
            },
            angle_deg: camera.beam_angle_deg,
            u_angle_deg: (camera.beam_angle_deg > 0.0).then_some(0.0),
        },
        camera: manifest::Camera {
            angle_deg: corners.is_none().then_some(camera.camera_angle_deg),
            u_angle_deg: (camera.camera_angle_deg > 0.0).then_some(0.0),
            gain_e_per_dn: Some(sensor.gain_e_per_dn),
            read_noise_e: Some(sensor.read_noise_e),
            black_level_dn: Some(sensor.black_level_dn),
            white_level_dn: Some(sensor.white_level_dn),
            prnu_relative: sensor.prnu_relative,
            response: None,
            mosaic: camera.mosaic,
            fits_exposure_unit: None,
        },
        model: manifest::Model {
            entry_loss: camera.entry_loss,
            exit: match camera.exit {
                synth::Exit::Fresnel => manifest::Exit::Fresnel,
                synth::Exit::Lambert => manifest::Exit::Lambert,
            },
            g: model.g,
            // A closed form is no error of the light that it has made.
            discrepancy: model.solves_transport(),
        },
        sample: manifest::Sample {
            thickness_mm: None,
            mask: None,
            leave_out: vec![],
            sectors_deg: vec![],
            eta_below: None,
            frames: entries(Role::Sample),
            dark: entries(Role::SampleDark),
        },
        reference: manifest::Reference {
            reflectance: white.reflectance,
            u_reflectance: Some(white.u_reflectance),
            sigma_s_prime_per_mm: per_channel(white.sigma_s_prime_per_mm(camera.channels)),
            u_sigma_s_prime_relative: Some(0.0),
            sigma_a_per_mm: per_channel(white.sigma_a_per_mm(camera.channels)),
            eta: Some(white.eta),
            mask: None,
            leave_out: vec![],
            frames: entries(Role::Reference),
            dark: entries(Role::ReferenceDark),
        },
    }
}

/// A list, or its one number where all are the same.
fn per_channel(values: Vec<f64>) -> Option<manifest::PerChannel> {
    let first = *values.first()?;
    Some(if values.iter().all(|v| *v == first) {
        manifest::PerChannel::All(first)
    } else {
        manifest::PerChannel::Each(values)
    })
}
