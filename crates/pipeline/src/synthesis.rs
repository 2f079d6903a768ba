//! Synthetic captures as files: what a laboratory would have on its disk.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::Outputs;
use crate::library::{self, ModelChoice};
use crate::monitor::Monitor;
use formats::RadianceFile;
use formats::capture as manifest;
use physics::{ChannelMap, Coefficients, ForwardModel, Medium, RadianceMap};
use render::camera::Lens;
use render::{
    Film, HalfSpace, Lamp, Material, Method, MonteCarlo, Object, Options, Scene, Shape, Spot, Vec3,
    View,
};
use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use synth::{Camera, Capture, PictureOf, Role, Sample, Shot, Wanted};

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

/// What makes the light of a capture.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// A model of the profile.
    Model(ModelChoice),
    /// The renderer: a half-space of the sample under the beam, by volume transport.
    Rendered {
        /// Mean cosine of the scattering angle.
        g: f64,
        /// Photons of each channel.
        photons: u64,
    },
}

impl Light {
    /// The model of the white, and of what `truth.json` says of the sample.
    fn model(&self) -> ModelChoice {
        match self {
            Self::Model(model) => model.clone(),
            Self::Rendered { g, .. } => ModelChoice {
                g: Some(*g),
                ..ModelChoice::default().called("monte-carlo")
            },
        }
    }
}

/// [`photograph`] in the light of a model.
///
/// # Errors
///
/// As [`photograph`].
pub fn write(
    sample: &Sample,
    camera: Camera,
    model: &ModelChoice,
    seed: u64,
    folder: &Path,
    force: bool,
    monitor: &dyn Monitor,
) -> Result<PathBuf> {
    let light = Light::Model(model.clone());
    photograph(sample, camera, &light, seed, folder, force, monitor)
}

/// Writes the capture of `sample` by `camera` into `folder`: frames as 16-bit TIFF,
/// `capture.toml` and `truth.json`.
///
/// A rendered picture has noise of its photons in all frames alike: it stands beside them as
/// `sample/rendering.exr`, whose variance `measure` adds to theirs.
///
/// # Errors
///
/// The camera or the sample is impossible, the model unknown, or the folder holds such files.
pub fn photograph(
    sample: &Sample,
    camera: Camera,
    light: &Light,
    seed: u64,
    folder: &Path,
    force: bool,
    monitor: &dyn Monitor,
) -> Result<PathBuf> {
    let model = &light.model();
    library::model(model, sample.eta)?;
    let sample = &seen_by(&camera, sample);
    let at = |eta: f64| -> Box<dyn ForwardModel> {
        library::model(model, eta).expect("the name was tried above")
    };
    if let Light::Rendered { photons, .. } = light {
        if *photons == 0 {
            return Err(Error::new(Kind::Usage, "expected at least one photon"));
        }
        if let Some((channel, _)) = sample.channels.iter().find(|(_, c)| c.sigma_a == 0.0) {
            let message = format!(
                "synth {}, channel {channel}: a half-space without absorption keeps light for ever, and cannot be rendered; give it some, or take model monte-carlo",
                sample.material
            );
            return Err(Error::new(Kind::Input, message));
        }
    }
    let made = camera.clone();
    let rendered = RefCell::new(vec![]);
    let picture = |wanted: &Wanted| match *light {
        Light::Rendered { g, photons } => {
            let channel = spot(&made, wanted, g, photons, seed, monitor);
            let value = channel.value.clone();
            rendered.borrow_mut().push(channel);
            value
        }
        Light::Model(_) => vec![],
    };
    let pictures: Option<PictureOf> = match light {
        Light::Rendered { .. } => Some(&picture),
        Light::Model(_) => None,
    };
    let capture = Capture::pictured(sample, camera, &at, pictures, seed)
        .input(format!("synth {}", sample.material))?;
    monitor.check()?;
    let shots = capture.shots();
    let names = shots
        .iter()
        .map(file_name)
        .chain(["capture.toml".into(), "truth.json".into()])
        .chain(pictures.map(|_| RENDERING.to_owned()));
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
    let mut manifest = manifest_of(sample, &capture, &shots, model);
    if pictures.is_some() {
        let map = as_seen(capture.camera(), rendered.take());
        let file = RadianceFile {
            map: Cow::Owned(map),
            mm_per_pixel: Some(capture.camera().mm_per_pixel),
            view_mm: None,
            scale: vec![],
            provenance: BTreeMap::new(),
        };
        outputs.write(RENDERING, |out| Ok(formats::write_radiance(&file, out)?))?;
        manifest.sample.rendering = Some(RENDERING.to_owned());
    }
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

/// The rendering beside the frames of the sample.
const RENDERING: &str = "sample/rendering.exr";

/// Pictures of all channels as the frames have them: one, of the photosites' own colours, where the
/// camera has a mosaic.
fn as_seen(camera: &Camera, channels: Vec<ChannelMap>) -> RadianceMap {
    let (width, height) = (camera.width, camera.height);
    let channels = match camera.mosaic {
        None => channels,
        Some(mosaic) => {
            let of = |list: fn(&ChannelMap) -> &Vec<f32>| {
                let pixels = 0..width * height;
                let own = |i: usize| &channels[mosaic.colour(i % width, i / width)];
                pixels.map(|i| list(own(i))[i]).collect()
            };
            vec![ChannelMap {
                name: "Y".to_owned(),
                value: of(|c| &c.value),
                variance: of(|c| &c.variance),
            }]
        }
    };
    RadianceMap {
        width,
        height,
        channels,
        mosaic: None,
    }
}

/// A rendered picture of a half-space under the beam, π times the radiance per incident power.
///
/// Pixels share photons, and so do rings of them: together they are less certain than they would be,
/// were they independent. Their variance is therefore such that the mean over a wide ring, as a
/// coefficient is found from, has the scatter that it has from round to round.
///
/// An interrupt ends it early, which the caller has to look for.
fn spot(
    camera: &Camera,
    wanted: &Wanted,
    g: f64,
    photons: u64,
    seed: u64,
    monitor: &dyn Monitor,
) -> ChannelMap {
    let side = wanted.mm_per_pixel;
    let (width, height) = (camera.width, camera.height);
    // Right is +x and down the picture -y, seen along -z with +y up.
    let [x, y] = wanted.spot_px;
    let from = Vec3::new(
        (x + 0.5 - 0.5 * width as f64) * side,
        -(y + 0.5 - 0.5 * height as f64) * side,
        100.0,
    );
    let view = View {
        from: Vec3::new(0.0, 0.0, 100.0),
        to: Vec3::ZERO,
        up: Vec3::Y,
        width,
        height,
    };
    let lens = Lens::Orthographic {
        height: height as f64 * side,
    };
    let fwhm = camera.beam_fwhm_mm;
    let Coefficients {
        sigma_a,
        sigma_s_prime,
    } = wanted.coefficients;
    let scene = Scene {
        channels: vec!["Y".to_owned()],
        objects: vec![Object {
            name: "sample".to_owned(),
            shape: Shape::HalfSpace(HalfSpace {
                point: Vec3::ZERO,
                normal: Vec3::Z,
            }),
            material: Material {
                media: vec![Medium {
                    sigma_a,
                    sigma_s: sigma_s_prime / (1.0 - g),
                    g,
                    eta: wanted.eta,
                }],
                texture: None,
            },
        }],
        lamps: vec![Lamp {
            light: render::Light::Beam {
                from,
                direction: Vec3::NEG_Z,
                spot: match camera.beam_profile {
                    synth::BeamProfile::Gaussian if fwhm > 0.0 => Spot::gaussian(fwhm),
                    _ => Spot::Disk(0.5 * fwhm),
                },
            },
            strength: vec![1.0],
        }],
        camera: render::Camera::new(view, lens).expect("a camera that was checked"),
    };
    const ROUNDS: u64 = 64;
    let options = Options {
        seed: seed.wrapping_add(wanted.channel as u64),
        photons: photons.div_ceil(ROUNDS),
        components: false,
        rings: None,
    };
    let method = MonteCarlo::new(&scene, options).expect("a beam on a half-space");
    let mut picture = method.empty();
    let rings = Rings::new(width, height, wanted.spot_px);
    let mut of_rings = Film::new(rings.pixels.len());
    let mut before = vec![0.0; rings.pixels.len()];
    monitor.begin("rendering", ROUNDS);
    method.run(0..ROUNDS, &mut picture, &mut |picture| {
        let (_, sums) = picture.radiance.state();
        let mut now = vec![0.0; before.len()];
        for (ring, [sum, _]) in rings.of_pixel.iter().zip(sums) {
            now[*ring] += sum;
        }
        let round: Vec<f64> = now
            .iter()
            .zip(&before)
            .map(|(now, old)| now - old)
            .collect();
        of_rings.add(&round);
        before = now;
        monitor.step();
        if monitor.stopped() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let pixels = 0..width * height;
    let value = |pixel: usize| (PI * picture.radiance.estimate(pixel).value) as f32;
    // Of the sum over a ring u², of each of its independent pixels a share of it.
    let variance = |pixel: usize| {
        let ring = rings.of_pixel[pixel];
        let u = PI * of_rings.estimate(ring).u;
        (u * u / rings.pixels[ring]) as f32
    };
    ChannelMap {
        name: wanted.channel.to_string(),
        value: pixels.clone().map(value).collect(),
        variance: pixels.map(variance).collect(),
    }
}

/// Wide rings about a spot.
struct Rings {
    /// Which each pixel is in.
    of_pixel: Vec<usize>,
    /// How many pixels each has.
    pixels: Vec<f64>,
}

impl Rings {
    fn new(width: usize, height: usize, [column, row]: [f64; 2]) -> Self {
        // Of the radius, and the least, px.
        const WIDTH: f64 = 0.4;
        const LEAST: f64 = 1.5;
        let turn = LEAST / WIDTH;
        let of = |i: usize| {
            let (x, y) = ((i % width) as f64 - column, (i / width) as f64 - row);
            let r = x.hypot(y);
            (r.min(turn) / LEAST + (r.max(turn) / turn).ln() / WIDTH) as usize
        };
        let of_pixel: Vec<usize> = (0..width * height).map(of).collect();
        let last = of_pixel.iter().copied().max().unwrap_or(0);
        let mut pixels = vec![0.0; last + 1];
        for ring in &of_pixel {
            pixels[*ring] += 1.0;
        }
        Self { of_pixel, pixels }
    }
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
            rendering: None,
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
            u_sigma_a_per_mm: Some(manifest::PerChannel::All(0.0)),
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
