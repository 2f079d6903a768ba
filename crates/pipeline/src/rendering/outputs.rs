//! What a rendering leaves behind.

use super::{Loaded, MethodChoice, RenderOptions, srgb};
use crate::error::{Error, Kind, Result};
use crate::files::{Outputs, read, split};
use crate::fit_json::SCHEMA_VERSION;
use formats::{RadianceFile, encode_png, write_radiance};
use physics::{ChannelMap, Frame, RadianceMap};
use render::method::COMPONENTS;
use render::{Blocks, Entry, Film, Gather, Ledger, Picture, Scene};
use serde::Serialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A number and its standard error.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Number {
    /// The number.
    pub value: f64,
    /// Its standard error.
    pub u: f64,
}

/// Light through one face of one solid.
#[derive(Clone, Debug, Serialize)]
pub struct FaceLine {
    /// Name of the solid.
    pub object: String,
    /// Name of the face.
    pub face: &'static str,
    /// Name of the channel.
    pub channel: String,
    /// Power that left through it, W.
    pub power: Number,
}

/// One ring of leaving light.
#[derive(Clone, Debug, Serialize)]
pub struct RingLine {
    /// Name of the channel.
    pub channel: String,
    /// Its edges, mm.
    pub radius_mm: [f64; 2],
    /// Power per area, W mm⁻².
    pub exitance_per_mm2: Number,
}

/// Noise that neighbouring pixels of one plane share.
#[derive(Clone, Debug, Serialize)]
pub struct SharedLine {
    /// Name of the plane: a channel, or component and channel.
    pub channel: String,
    /// So many pixels ...
    pub pixels: Vec<f64>,
    /// ... have a sum whose variance is that of its pixels times this.
    pub variance_factor: Vec<f64>,
}

/// `image.json`: what was made and how.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    schema_version: u32,
    beamspot_version: &'static str,
    /// The method in a word.
    pub method: String,
    seed: u64,
    /// Rounds that were made.
    pub rounds: u64,
    /// Rms of the standard errors of all pixels over the mean pixel.
    pub relative_error: f64,
    /// What that leaves out: noise that neighbouring pixels share.
    pub shared_noise: Vec<SharedLine>,
    /// What the PNG shows: radiance times this, through the sRGB curve.
    pub png_exposure: f64,
    /// Powers of light that was followed from its lamp, by face.
    pub faces: Vec<FaceLine>,
    /// The same by ring.
    pub rings: Vec<RingLine>,
    /// Power that surfaces reflected before it entered, by channel, W.
    pub specular: Vec<Number>,
    /// Power that fell through holes of meshes, by channel, W.
    pub lost: Vec<Number>,
    /// What is odd.
    pub warnings: Vec<String>,
    /// Whether the user stopped it before its time.
    pub interrupted: bool,
}

/// The files of one picture: `NAME.exr`, with `NAME.png`, `NAME.json` and `NAME.state` beside it.
#[derive(Debug)]
pub struct PictureFiles {
    folder: PathBuf,
    /// exr, png, json, state.
    names: [PathBuf; 4],
    goes_on: bool,
}

const MAGIC: &[u8; 16] = b"beamspot render2";

impl PictureFiles {
    /// Beside `path`, whose ending is `.exr`. With `resume` they may exist.
    ///
    /// # Errors
    ///
    /// The path has another ending.
    pub fn new(path: &Path, resume: bool) -> Result<Self> {
        let (folder, name) = split(path)?;
        if name.extension().is_none_or(|e| e != "exr") {
            let message = format!("{}: expected a name that ends in .exr", path.display());
            return Err(Error::new(Kind::Usage, message));
        }
        let names = ["exr", "png", "json", "state"].map(|e| name.with_extension(e));
        let goes_on = resume && folder.join(&names[3]).exists();
        Ok(Self {
            folder,
            names,
            goes_on,
        })
    }

    /// Refuses what is in the way.
    ///
    /// # Errors
    ///
    /// One of the files exists and is not to be replaced.
    pub fn open(&self, inputs: &[PathBuf], force: bool) -> Result<Outputs> {
        Outputs::new(
            &self.folder,
            self.names.iter(),
            inputs,
            force || self.goes_on,
        )
    }

    /// The picture so far, if it is to go on.
    ///
    /// # Errors
    ///
    /// The state is damaged, or belongs to another scene or other options.
    pub fn before(&self, loaded: &Loaded, options: &RenderOptions) -> Result<Option<Picture>> {
        if !self.goes_on {
            return Ok(None);
        }
        let path = self.folder.join(&self.names[3]);
        let bytes = read(&path)?;
        let other = |what: &str| {
            let message = format!("{}: {what}; render anew with --force", path.display());
            Error::new(Kind::Input, message)
        };
        let mut rest = bytes.as_slice();
        let mut take = |count: usize| {
            let (head, tail) = rest.split_at_checked(count)?;
            rest = tail;
            Some(head)
        };
        let damaged = || other("is no state of a picture, or a damaged one");
        if take(16).ok_or_else(damaged)? != MAGIC {
            return Err(damaged());
        }
        if take(32).ok_or_else(damaged)? != identity(loaded, options).as_bytes() {
            return Err(other("belongs to another scene, method or seed"));
        }
        let mut film = || {
            let mut word = || {
                let bytes: [u8; 8] = take(8)?.try_into().ok()?;
                Some(u64::from_le_bytes(bytes))
            };
            let (rounds, count) = (word()?, word()?);
            let mut sums = vec![];
            for _ in 0..count {
                sums.push([f64::from_bits(word()?), f64::from_bits(word()?)]);
            }
            Some(Film::restore(rounds, sums))
        };
        let mut picture = Picture {
            radiance: film().ok_or_else(damaged)?,
            powers: film().ok_or_else(damaged)?,
            blocks: blocks(loaded, options),
        };
        for of_side in picture.blocks.films_mut() {
            let read = film().ok_or_else(damaged)?;
            if read.len() != of_side.len() {
                return Err(damaged());
            }
            *of_side = read;
        }
        Ok(Some(picture))
    }

    /// Writes everything and moves it into place.
    ///
    /// # Errors
    ///
    /// The disk is full, or an output has appeared meanwhile.
    pub fn write(
        &self,
        files: Outputs,
        loaded: &Loaded,
        options: &RenderOptions,
        picture: &Picture,
        interrupted: bool,
    ) -> Result<Outcome> {
        let [exr, png, json, state] = &self.names;
        let planes = planes(loaded, options);
        let picture_map = map(loaded, &planes, picture);
        let file = radiance_file(loaded, options, picture, &picture_map);
        files.write(exr, |out| Ok(write_radiance(&file, out)?))?;
        let (frame, exposure) = developed(&loaded.scene, planes.len(), picture, options.exposure);
        files.write(png, |out| Ok(encode_png(&frame, out)?))?;
        files.write(state, |out| {
            out.write_all(MAGIC)?;
            out.write_all(identity(loaded, options).as_bytes())?;
            let films = [&picture.radiance, &picture.powers];
            for film in films.into_iter().chain(picture.blocks.films()) {
                let (rounds, sums) = film.state();
                out.write_all(&rounds.to_le_bytes())?;
                out.write_all(&(sums.len() as u64).to_le_bytes())?;
                for number in sums.iter().flatten() {
                    out.write_all(&number.to_bits().to_le_bytes())?;
                }
            }
            Ok(())
        })?;
        let outcome = outcome(loaded, options, picture, exposure, interrupted);
        files.write(json, |out| {
            serde_json::to_writer_pretty(&mut *out, &outcome)?;
            Ok(out.write_all(b"\n")?)
        })?;
        files.commit()?;
        Ok(outcome)
    }
}

/// Sums over blocks of a picture without light.
fn blocks(loaded: &Loaded, options: &RenderOptions) -> Blocks {
    Blocks::new(loaded.scene.camera.size(), planes(loaded, options).len())
}

/// What neighbouring pixels share, plane by plane.
fn shared_noise(loaded: &Loaded, options: &RenderOptions, picture: &Picture) -> Vec<SharedLine> {
    let line = |(plane, channel): (usize, String)| {
        let shared = picture.blocks.shared_noise(&picture.radiance, plane);
        let (pixels, variance_factor) = shared.factors.into_iter().unzip();
        SharedLine {
            channel,
            pixels,
            variance_factor,
        }
    };
    let planes = planes(loaded, options).into_iter().enumerate();
    planes.map(line).collect()
}

/// What to look for where a picture shows nothing.
fn dark(picture: &Picture) -> Option<String> {
    // Numbers that are less are left over from logarithms.
    const NOTHING: f64 = 1e-100;
    let film = &picture.radiance;
    let black = (0..film.len()).all(|index| film.estimate(index).value.abs() < NOTHING);
    black.then(|| {
        "the picture is black: no light found its way from a lamp to the camera. Is a solid in view \
         (`from_mm`, `to_mm`, `field_deg` or `height_mm`), does its medium scatter, and does light fall \
         on it? An area light shines from the side to which u_mm x v_mm points, a beam along its \
         `direction`"
            .to_owned()
    })
}

/// What a state belongs to.
fn identity(loaded: &Loaded, options: &RenderOptions) -> blake3::Hash {
    let mut hash = blake3::Hasher::new();
    hash.update(loaded.text.as_bytes());
    for input in &loaded.inputs {
        // What cannot be read any more was read before; then the text alone has to do.
        hash.update(&std::fs::read(input).unwrap_or_default());
    }
    let RenderOptions {
        method,
        photons,
        seed,
        components,
        ..
    } = options;
    hash.update(format!("{method:?} {photons} {seed} {components}").as_bytes());
    hash.finalize()
}

fn name(method: MethodChoice) -> String {
    match method {
        MethodChoice::MonteCarlo => "monte-carlo".to_owned(),
        MethodChoice::Brdf(kind) => format!("brdf {kind:?}").to_lowercase(),
        MethodChoice::Layered => "brdf layered".to_owned(),
        MethodChoice::Bssrdf(model, _) => format!("bssrdf {}", model.name()),
        MethodChoice::PointCloud(model, gather) => {
            let gather = match gather {
                Gather::Hierarchy { .. } => "hierarchy",
                Gather::Smoothstep { .. } => "smoothstep",
            };
            format!("point-cloud {gather} {}", model.name())
        }
    }
}

/// Names of the planes: channels, or component and channel.
pub(super) fn planes(loaded: &Loaded, options: &RenderOptions) -> Vec<String> {
    let channels = &loaded.scene.channels;
    if !options.components {
        return channels.clone();
    }
    let of = |part: &&str| {
        let part = (*part).to_owned();
        channels
            .iter()
            .map(move |channel| format!("{part}.{channel}"))
    };
    COMPONENTS.iter().flat_map(of).collect()
}

/// The picture as a file, with what it is.
pub(super) fn radiance_file<'a>(
    loaded: &Loaded,
    options: &RenderOptions,
    picture: &Picture,
    map: &'a RadianceMap,
) -> RadianceFile<'a> {
    RadianceFile {
        map: Cow::Borrowed(map),
        mm_per_pixel: loaded.scene.camera.mm_per_pixel(),
        view_mm: None,
        scale: vec![],
        provenance: BTreeMap::from([
            ("unit".to_owned(), "radiance, W mm^-2 sr^-1".to_owned()),
            ("method".to_owned(), name(options.method)),
            ("seed".to_owned(), options.seed.to_string()),
            ("rounds".to_owned(), picture.radiance.rounds().to_string()),
        ]),
    }
}

pub(super) fn map(loaded: &Loaded, planes: &[String], picture: &Picture) -> RadianceMap {
    let [width, height] = loaded.scene.camera.size();
    let pixels = width * height;
    let channels = planes.iter().enumerate().map(|(plane, name)| {
        let all = (0..pixels).map(|pixel| picture.radiance.estimate(plane * pixels + pixel));
        let (value, variance) = all.map(|e| (e.value as f32, (e.u * e.u) as f32)).unzip();
        ChannelMap {
            name: name.clone(),
            value,
            variance,
        }
    });
    RadianceMap {
        width,
        height,
        channels: channels.collect(),
        mosaic: None,
    }
}

/// The sum of all components through the sRGB curve. Without an exposure the brightest
/// hundredth of the pixels with light begins to burn out.
pub(crate) fn developed(
    scene: &Scene,
    planes: usize,
    picture: &Picture,
    exposure: Option<f64>,
) -> (Frame, f64) {
    let [width, height] = scene.camera.size();
    let pixels = width * height;
    let channels = scene.channels.len();
    let mut values = vec![0.0; channels * pixels];
    for plane in 0..planes {
        for pixel in 0..pixels {
            let value = picture.radiance.estimate(plane * pixels + pixel).value;
            values[plane % channels * pixels + pixel] += value;
        }
    }
    let exposure = exposure.unwrap_or_else(|| {
        let mut lit: Vec<f64> = values.iter().copied().filter(|v| *v > 0.0).collect();
        lit.sort_by(f64::total_cmp);
        let bright = lit.get(lit.len() * 99 / 100).copied().unwrap_or(1.0);
        1.0 / bright
    });
    let shown = if channels == 3 { 3 } else { 1 };
    let code = |value: f64| {
        let y = srgb::encoded((value * exposure).clamp(0.0, 1.0));
        (y * f64::from(u16::MAX)).round() as u16
    };
    let samples: Vec<u16> = (0..pixels)
        .flat_map(|pixel| (0..shown).map(move |channel| (pixel, channel)))
        .map(|(pixel, channel)| code(values[channel * pixels + pixel]))
        .collect();
    let frame = Frame {
        width,
        height,
        channels: shown,
        samples: samples.into(),
    };
    (frame, exposure)
}

/// A power of the ledger, W.
fn power(ledger: &Ledger, picture: &Picture, channel: usize, entry: Entry) -> Number {
    let found = picture.powers.estimate(ledger.index(channel, entry));
    Number {
        value: found.value,
        u: found.u,
    }
}

/// Powers through every face of every solid, channel by channel, where light was followed from its
/// lamp.
pub(super) fn faces(loaded: &Loaded, picture: &Picture) -> Vec<FaceLine> {
    let scene = &loaded.scene;
    let ledger = Ledger::new(scene, loaded.rings.as_ref());
    let mut faces = vec![];
    // Light that was followed from the camera alone is in no power.
    let counted = (0..picture.powers.len()).any(|k| picture.powers.estimate(k).value > 0.0);
    for (channel, name) in scene.channels.iter().enumerate().filter(|_| counted) {
        for (object, o) in scene.objects.iter().enumerate() {
            for (face, face_name) in o.shape.face_names().iter().enumerate() {
                faces.push(FaceLine {
                    object: o.name.clone(),
                    face: face_name,
                    channel: name.clone(),
                    power: power(&ledger, picture, channel, Entry::Face { object, face }),
                });
            }
        }
    }
    faces
}

fn outcome(
    loaded: &Loaded,
    options: &RenderOptions,
    picture: &Picture,
    png_exposure: f64,
    interrupted: bool,
) -> Outcome {
    let scene = &loaded.scene;
    let ledger = Ledger::new(scene, loaded.rings.as_ref());
    let counted = !picture.powers.is_empty();
    let number = |channel: usize, entry: Entry| power(&ledger, picture, channel, entry);
    let faces = faces(loaded, picture);
    let mut rings = vec![];
    let (mut specular, mut lost) = (vec![], vec![]);
    for (channel, name) in scene.channels.iter().enumerate().filter(|_| counted) {
        let edges = loaded.rings.as_ref().map_or(&[][..], |r| &r.edges_mm);
        for (k, ends) in edges.windows(2).enumerate() {
            let area = PI * (ends[1] * ends[1] - ends[0] * ends[0]);
            let Number { value, u } = number(channel, Entry::Ring(k));
            rings.push(RingLine {
                channel: name.clone(),
                radius_mm: [ends[0], ends[1]],
                exitance_per_mm2: Number {
                    value: value / area,
                    u: u / area,
                },
            });
        }
        specular.push(number(channel, Entry::Specular));
        lost.push(number(channel, Entry::Lost));
    }
    Outcome {
        schema_version: SCHEMA_VERSION,
        beamspot_version: env!("CARGO_PKG_VERSION"),
        method: name(options.method),
        seed: options.seed,
        rounds: picture.radiance.rounds(),
        relative_error: picture.radiance.relative_error(),
        shared_noise: shared_noise(loaded, options, picture),
        png_exposure,
        faces,
        rings,
        specular,
        lost,
        warnings: loaded
            .warnings
            .iter()
            .cloned()
            .chain(dark(picture))
            .collect(),
        interrupted,
    }
}
