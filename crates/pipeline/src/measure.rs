//! The main job: frames to materials.

use crate::beam::{self, ChosenBeam};
use crate::bootstrap::{self, Bootstrap};
use crate::capture::{self, FrameUse, Input, Loaded, Merged, Subject, Workspace, exposure_lines};
use crate::comparison::{self, Compared};
use crate::confirm::{self, Confirmation, PHOTONS, confirm};
use crate::error::{Blame, Error, Kind, Result};
use crate::exit;
use crate::fit_json::{self, FitDocument};
use crate::fitting::{self, Given, ScaleInput};
use crate::geometry;
use crate::library::{ModelChoice, SlabChoice};
use crate::monitor::Monitor;
use crate::regions;
use crate::response::Curves;
use crate::sensing::{Found, Sensing};
use crate::stray::Veil;
use crate::unknown_g;
use crate::verdict::{self, Verdict};
use fit::{Constraint, Direction, DirectionKind, Fit};
use formats::capture as manifest;
use formats::exr::{ChannelScale, RadianceFile};
use hdr::Comparison;
use physics::{Material, ProfilePoint, RadialProfile, RadianceMap, TotalReflectance, fresnel};
use profile::{Exit, Measured, ProfileOptions, ReferenceOptions, Scale, View, White};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Relative standard uncertainty of the scale up to which its cause goes without saying.
const NO_LINE: f64 = 1e-6;

/// What the caller of a measurement chooses.
#[derive(Clone, Debug, PartialEq)]
pub struct Choices {
    /// The model.
    pub model: ModelChoice,
    /// Whether a closed form's error against transport takes part; `None`: as the manifest says.
    pub discrepancy: Option<bool>,
    /// What the total does.
    pub constraint: Constraint,
    /// Whether the scale is taken as unknown: the white reference then does not matter.
    pub free_scale: bool,
    /// First and last radius, mm; `None` lets the fit choose.
    pub range_mm: Option<(f64, f64)>,
    /// Whether every other model that applies is fitted as well.
    pub compare: bool,
    /// Replicas of each channel to draw and fit again; 0 for none.
    pub bootstrap: usize,
    /// Whether the fitted medium is simulated and laid over data and model.
    pub confirm: bool,
}

impl Default for Choices {
    fn default() -> Self {
        Self {
            model: ModelChoice::default(),
            discrepancy: None,
            constraint: Constraint::Joint,
            free_scale: false,
            range_mm: None,
            compare: false,
            bootstrap: 0,
            confirm: true,
        }
    }
}

/// Sample and reference merged, and the scale that the one gives the other.
#[derive(Clone, Debug)]
pub struct Radiance {
    /// The sample, in units of R_d, mm⁻².
    pub map: RadianceMap,
    /// The scale of each channel.
    pub scales: Vec<Scale>,
    /// What makes each uncertain.
    pub scale_inputs: Vec<Vec<ScaleInput>>,
    /// The white of each channel as matter that glows, where the manifest knows it.
    pub whites: Vec<Option<White>>,
    /// Stray light in the picture of the sample, channel by channel, in units of R_d, mm⁻²:
    /// already subtracted.
    pub veils: Vec<Veil>,
    /// The sample's exposures beside each other.
    pub exposures: Comparison,
    /// From black to white, DN.
    pub range_dn: f64,
    /// The response of a camera of 8 bits, and the white's exposures, s.
    pub curves: Option<(Curves, Vec<f64>)>,
    /// Every file that took part.
    pub inputs: Vec<Input>,
    /// What each frame gave.
    pub frames: Vec<FrameUse>,
    /// What else was dropped, and where, in sentences.
    pub merge_lines: Vec<String>,
    /// What the manifest left out of the camera and the frames had to say, in sentences.
    pub estimated: Vec<String>,
    /// Where each pixel looks.
    pub view: View,
    /// How radiance became exitance.
    pub exit: Exit,
}

/// Everything that a measurement finds.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Name of the material.
    pub material: String,
    /// The picture behind it.
    pub radiance: Radiance,
    /// Profile and total of each channel.
    pub measured: Vec<Measured>,
    /// What the fit of each channel took as given: all the same but for the beam.
    pub given: Vec<Given>,
    /// The beam of each channel.
    pub beams: Vec<ChosenBeam>,
    /// The fit of each channel.
    pub fits: Vec<Fit>,
    /// How far each fit can be trusted.
    pub verdicts: Vec<Verdict>,
    /// What replicas of each channel gave; empty where none were asked.
    pub bootstraps: Vec<Bootstrap>,
    /// What photon counting says of each fit; empty where it was not asked.
    pub confirmations: Vec<Option<Confirmation>>,
    /// The fits of every model that applies; empty where it was not asked.
    pub compared: Vec<Compared>,
    /// The rows for a table.
    pub materials: Vec<Material>,
    /// Defaults that stood in for what the manifest left out.
    pub assumptions: Vec<String>,
    /// What a user should know of the measurement as a whole, in sentences.
    pub warnings: Vec<String>,
}

/// Sample and reference must come from one camera, as far as their files tell.
fn refuse_other_camera(loaded: &Loaded, sample: &Merged, reference: &Merged) -> Result<()> {
    let told = |merged: &Merged| {
        let of = &merged.of_camera;
        let depth = of.depth.map(|depth| depth.to_string());
        let mosaic = merged.map.mosaic.map(|mosaic| format!("mosaic {mosaic}"));
        let iso = of.iso.map(|iso| format!("ISO {iso}"));
        let all = [depth, mosaic, of.camera.clone(), iso];
        all.into_iter().flatten().collect::<Vec<_>>().join(" ")
    };
    let alike = sample.map.mosaic == reference.map.mosaic;
    if alike && sample.of_camera.agrees(&reference.of_camera) {
        return Ok(());
    }
    let message = format!(
        "{}: the frames of the sample ({}) and of the reference ({}) differ: expected the same \
         camera, counts and gain for both, so photograph both alike",
        loaded.input.path.display(),
        told(sample),
        told(reference)
    );
    Err(Error::new(Kind::Input, message))
}

/// Merges sample and reference, and scales the one by the other.
///
/// # Errors
///
/// See [`Loaded::merge`]; the reference must show a spot with room around it.
pub fn radiance(loaded: &Loaded, monitor: &dyn Monitor) -> Result<Radiance> {
    let loaded = &*loaded.with_response(monitor)?;
    let Sensing { sensor, found } = loaded.sensing(monitor)?;
    let steps = loaded.frame_count(Subject::Sample) + loaded.frame_count(Subject::Reference);
    monitor.begin("merging", steps);
    // One after the other: each uses all threads, and one picture at a time is in memory.
    let mut workspace = Workspace::default();
    let mut reference = loaded.merge(Subject::Reference, &sensor, &mut workspace, monitor)?;
    loaded.leave_out(Subject::Reference, &mut reference)?;
    let view = loaded.view()?;
    let camera_angle = geometry::camera_angle(loaded, &view, &reference.map)?;
    let exit = exit(&loaded.capture, camera_angle.angle);
    let whites = reference_scales(loaded, &reference, view, exit)?;
    workspace.take_back(&mut reference.map);
    let mut sample = loaded.merge(Subject::Sample, &sensor, &mut workspace, monitor)?;
    drop(workspace);
    loaded.add_noise_of_rendering(&mut sample)?;
    loaded.leave_out(Subject::Sample, &mut sample)?;
    let count = sample.map.names().len();
    if count != whites.len() {
        let message = format!(
            "{}: the sample has {count} channels and the reference {}: expected the same camera for both",
            loaded.input.path.display(),
            whites.len(),
        );
        return Err(Error::new(Kind::Input, message));
    }
    refuse_other_camera(loaded, &sample, &reference)?;
    let mut merge_lines = loaded.notes.clone();
    let mut frames = vec![];
    for (subject, merged) in [(Subject::Sample, &sample), (Subject::Reference, &reference)] {
        frames.extend(FrameUse::of(subject, merged));
        merge_lines.extend(exposure_lines(subject, merged));
        merge_lines.extend(capture::merge_lines(subject, merged));
    }
    // Each picture is on the scale of its own median exposure.
    let u_exposure = if sample.uses_measured || reference.uses_measured {
        hdr::overlap::u_between(&sample.comparison, &reference.comparison)
    } else {
        0.0
    };

    let u_dark = u_dark(&sample, &reference);
    let [u_view, u_beam] = u_angles(&loaded.capture, camera_angle.angle);
    let means = sample.map.means();
    let reflectance = &loaded.capture.reference;
    let mut scales = vec![];
    let mut scale_inputs = vec![];
    let mut veils = vec![];
    let mut media = vec![];
    for (index, (mut scale, name)) in whites.into_iter().zip(sample.map.names()).enumerate() {
        let mut inputs = vec![
            ScaleInput {
                source: "white reference: certificate",
                u_relative: reflectance.u_reflectance() / reflectance.reflectance,
            },
            ScaleInput {
                source: "white reference: noise",
                u_relative: scale.u_noise_relative,
            },
            ScaleInput {
                source: "white reference: stray light",
                u_relative: scale.u_stray_relative,
            },
            ScaleInput {
                source: "white reference: dark residual",
                u_relative: u_dark * scale.even_relative,
            },
            ScaleInput {
                source: "exposure ratios: scale",
                u_relative: u_exposure,
            },
            ScaleInput {
                source: "angle of view",
                u_relative: u_view,
            },
            ScaleInput {
                source: "angle of the beam",
                u_relative: u_beam,
            },
        ];
        // What changes nothing is no line of a budget.
        inputs.retain(|input| input.u_relative > NO_LINE);
        veils.push(Veil::of(means[index], &scale, u_dark));
        // What the white's coefficients change is no factor alone: the fit is told of it as it is.
        scale.u_relative = (scale.by_white.iter()).fold(fitting::u_relative(&inputs), |u, off| {
            u.hypot(off.factor_relative)
        });
        scale_inputs.push(inputs);
        let (rejected, unmeasured) = (scale.rejected_pixels, scale.unmeasured_pixels);
        let line = crate::capture::left_out(Subject::Reference, name, rejected, unmeasured);
        merge_lines.extend(line);
        scales.push(scale);
        media.push(known_white(loaded, index, count)?);
    }
    let mut estimated: Vec<String> = found.iter().map(Found::line).collect();
    if u_exposure > 0.0 {
        estimated.push(format!(
            "exposures are off by more than chance: those measured from the overlap of the frames \
             were used, and {:.2} % were added to u of the scale, which they leave open",
            100.0 * u_exposure
        ));
    }
    estimated.extend(camera_angle.lines);
    estimated.extend(loaded.curves.iter().map(Curves::line));
    let range_dn = sensor.white_level_dn - sensor.black_level_dn;
    let mut inputs = vec![loaded.input.clone()];
    inputs.extend(sample.inputs);
    inputs.extend(reference.inputs);
    let offsets: Vec<f64> = veils.iter().map(|veil| veil.offset).collect();
    let factors: Vec<f64> = scales.iter().map(|s| s.factor_per_mm2).collect();
    Ok(Radiance {
        veils: (veils.iter().zip(&factors))
            .map(|(veil, factor)| veil.scaled(*factor))
            .collect(),
        map: sample.map.less(&offsets).scaled(&factors),
        scales,
        scale_inputs,
        whites: media,
        exposures: sample.comparison,
        range_dn,
        curves: loaded.curves.clone().map(|curves| {
            let frames = reference.comparison.frames.iter();
            (curves, frames.map(|frame| frame.nominal_s).collect())
        }),
        inputs,
        frames,
        merge_lines,
        estimated,
        view,
        exit,
    })
}

/// Standard uncertainty of what darks leave of themselves in the sample's picture, DN/s: as far as
/// those of sample and reference, taken at other times, differ.
fn u_dark(sample: &Merged, reference: &Merged) -> f64 {
    let exposures = |merged: &Merged| -> Vec<f64> {
        let frames = merged.report.frames.iter();
        frames.map(|frame| frame.exposure_s).collect()
    };
    if exposures(sample) != exposures(reference) {
        return 0.0;
    }
    (sample.report.dark_dn_per_s - reference.report.dark_dn_per_s).abs()
}

/// Relative standard uncertainty of the light that leaves toward the camera, at `view` rad, and of
/// that which enters, from the angles' own.
fn u_angles(capture: &manifest::Capture, view: f64) -> [f64; 2] {
    let relative = |angle: f64, u_deg: f64, factor: &dyn Fn(f64) -> f64| {
        // Away from the surface, where there is always a little more of the angle.
        let steeper = (angle - u_deg.to_radians()).abs();
        (factor(steeper) / factor(angle) - 1.0).abs()
    };
    let (beam, camera) = (&capture.beam, &capture.camera);
    let leaves = |angle: f64| exit(capture, angle).factor();
    let enters = |angle: f64| {
        if capture.model.entry_loss {
            fresnel::entry_factor(capture.eta, angle.cos())
        } else {
            1.0
        }
    };
    [
        relative(view, camera.u_angle_deg(), &leaves),
        relative(beam.angle_deg.to_radians(), beam.u_angle_deg(), &enters),
    ]
}

/// Relative errors of a profile and of the light inside it, for one standard deviation.
struct Off {
    profile: Vec<f64>,
    total: f64,
}

impl Off {
    fn direction(self, source: &'static str) -> Direction {
        Direction {
            source,
            kind: DirectionKind::Relative,
            profile: self.profile,
            total: self.total,
        }
    }
}

/// One for each of the ways in which a point may be off, as `errors` lists them.
fn off(points: &[ProfilePoint], errors: impl Fn(&ProfilePoint) -> Vec<f64>) -> Vec<Off> {
    let of_points: Vec<Vec<f64>> = points.iter().map(errors).collect();
    let light: Vec<f64> = points
        .iter()
        .map(|p| p.area_mm2() * p.reflectance_per_mm2)
        .collect();
    let all: f64 = light.iter().sum();
    let ways = of_points.first().map_or(0, Vec::len);
    let of_way = |way: usize| {
        let profile: Vec<f64> = of_points.iter().map(|errors| errors[way]).collect();
        let sum: f64 = profile
            .iter()
            .zip(&light)
            .map(|(off, light)| off * light)
            .sum();
        Off {
            profile,
            total: sum / all,
        }
    };
    (0..ways).map(of_way).collect()
}

/// The white as a medium, in channel `index` of `count`, where the manifest knows it.
fn known_white(loaded: &Loaded, index: usize, count: usize) -> Result<Option<White>> {
    let reference = &loaded.capture.reference;
    let place = || loaded.input.path.display();
    let medium = reference.medium(index, count).input(place())?;
    let u_sigma_a = reference.u_sigma_a_per_mm(index, count).input(place())?;
    Ok(medium.map(|medium| White {
        medium,
        u_sigma_a,
        u_sigma_s_prime: reference.u_sigma_s_prime_relative() * medium.sigma_s_prime,
    }))
}

/// The scale that each channel of the merged white sets.
fn reference_scales(
    loaded: &Loaded,
    reference: &Merged,
    view: View,
    exit: Exit,
) -> Result<Vec<Scale>> {
    let capture = &loaded.capture;
    let RadianceMap { width, height, .. } = reference.map;
    let count = reference.map.names().len();
    let of_channel = |index: usize| {
        let white = reference.map.channel(index);
        let options = ReferenceOptions {
            view,
            center_px: None,
            reflectance: capture.reference.reflectance,
            u_reflectance: capture.reference.u_reflectance(),
            white: known_white(loaded, index, count)?,
            exit,
        };
        profile::reference_scale(&white, width, height, &options).input(format!(
            "{}: reference, channel {}",
            loaded.input.path.display(),
            white.name
        ))
    };
    (0..count).map(of_channel).collect()
}

impl Radiance {
    /// Standard uncertainty of the even light that each channel may have or lack, mm⁻².
    pub fn u_offsets(&self) -> Vec<f64> {
        self.veils.iter().map(Veil::u_offset).collect()
    }

    /// The ways in which the data of channel `index` may be off together.
    fn directions(&self, index: usize, measured: &Measured) -> Vec<Direction> {
        let mut all = self.veils[index].directions(measured);
        let scale = &self.scales[index];
        all.extend(self.veils[index].of_white(scale, measured));
        // What the sensor saw, DN/s: stray light included.
        let (veil, per_dn) = (self.veils[index].offset, scale.factor_per_mm2);
        let sample = |p: &ProfilePoint| (p.reflectance_per_mm2 + veil) / per_dn;
        let errors = off(&measured.profile.points, |p| {
            self.exposures.relative_errors(sample(p), self.range_dn)
        });
        all.extend(
            errors
                .into_iter()
                .map(|off| off.direction("exposure ratios")),
        );
        if let Some((curves, white_s)) = &self.curves {
            let curve = &curves.channels[index];
            let exposures_s: Vec<f64> = self.exposures.frames.iter().map(|f| f.nominal_s).collect();
            let stray = scale.stray.map_or(0.0, |stray| stray.offset);
            let of_sample = off(&measured.profile.points, |p| {
                curve.relative_errors(sample(p), &exposures_s)
            });
            let of_white = off(&scale.white.points, |p| {
                curve.relative_errors(p.reflectance_per_mm2 + stray, white_s)
            });
            // One curve for both: the white's total is off by the same ways.
            for (mut sample, white) in of_sample.into_iter().zip(of_white) {
                for off in &mut sample.profile {
                    *off -= white.total;
                }
                sample.total -= white.total;
                all.push(sample.direction("response of the camera"));
            }
        }
        all.retain(|direction| direction.profile.iter().any(|off| *off != 0.0));
        all
    }

    /// What was dropped, and where, in sentences.
    pub fn left_out(&self) -> Vec<String> {
        let frames = self.frames.iter().filter_map(FrameUse::sentence);
        frames.chain(self.merge_lines.iter().cloned()).collect()
    }

    /// The file `radiance.exr`.
    pub fn to_file(&self, loaded: &Loaded) -> RadianceFile<'_> {
        let names = self.map.names().into_iter();
        let scale = names
            .zip(self.scales.iter().zip(&self.veils))
            .map(|(channel, (scale, veil))| ChannelScale {
                channel: channel.to_owned(),
                u_scale_relative: scale.u_relative,
                u_offset_per_mm2: veil.u_offset(),
            })
            .collect();
        let provenance = BTreeMap::from([
            (
                "beamspot_version".to_owned(),
                env!("CARGO_PKG_VERSION").to_owned(),
            ),
            ("material".to_owned(), loaded.capture.material.clone()),
            ("manifest_blake3".to_owned(), loaded.input.blake3.clone()),
        ]);
        RadianceFile {
            map: Cow::Borrowed(&self.map),
            mm_per_pixel: self.view.square_mm(),
            view_mm: self.view.square_mm().is_none().then(|| self.view.to_rows()),
            scale,
            provenance,
        }
    }
}

/// Profile and total of every channel of a picture in mm⁻².
///
/// `u_scale_relative` has one number for each channel, and so have `u_offset_per_mm2`, the even light
/// that a channel may have or lack, and `centers_px`, `None` for a centre that is to be found; `sectors_deg` are the azimuths about the
/// spot that take part, all where there is none.
///
/// # Errors
///
/// The spot is missing or too near to the edge, a ring was not measured, or the sample is
/// brighter than any surface.
pub fn profiles(
    map: &RadianceMap,
    u_scale_relative: &[f64],
    u_offset_per_mm2: &[f64],
    view: View,
    centers_px: &[Option<[f64; 2]>],
    sectors_deg: &[[f64; 2]],
) -> Result<Vec<Measured>> {
    u_scale_relative
        .iter()
        .enumerate()
        .map(|(index, &u_scale_relative)| {
            let channel = &*map.channel(index);
            let center_px = centers_px.get(index).copied().flatten();
            let place = || format!("channel {}", channel.name);
            let size = (map.width, map.height);
            let kept = (!sectors_deg.is_empty())
                .then(|| regions::within_sectors(channel, size, &view, center_px, sectors_deg))
                .transpose()
                .input(place())?;
            let (seen, center_px) = match &kept {
                Some((seen, center)) => (seen, Some(*center)),
                None => (channel, center_px),
            };
            let options = ProfileOptions {
                view,
                center_px,
                u_scale_relative,
                ..ProfileOptions::default()
            };
            let mut measured =
                profile::radial_profile(seen, size.0, size.1, &options).input(place())?;
            measured.total.u_offset_per_mm2 = u_offset_per_mm2[index];
            Ok(measured)
        })
        .collect()
}

/// Measures a capture.
///
/// # Errors
///
/// See [`radiance`], [`profiles`] and [`fitting::fit_channel`]; each names the file and the
/// channel.
pub fn measure(loaded: &Loaded, choices: &Choices, monitor: &dyn Monitor) -> Result<Measurement> {
    let capture = &loaded.capture;
    // A model that is not there should not take a minute of merging to find out.
    let model = chosen_model(capture, choices);
    crate::library::model(&model.with_stand_in(), capture.eta)?;
    let mut radiance = radiance(loaded, monitor)?;
    let place = || loaded.input.path.display().to_string();
    monitor.check()?;
    monitor.begin("fitting", radiance.scales.len() as u64);
    let u_scales: Vec<f64> = radiance.scales.iter().map(|s| s.u_relative).collect();
    let centers = geometry::centers(loaded, &radiance, model.uses_beam())?;
    let measured = profiles(
        &radiance.map,
        &u_scales,
        &radiance.u_offsets(),
        radiance.view,
        &centers.px,
        &capture.sample.sectors_deg,
    )
    .map_err(|e| e.within(format!("{}: sample", place())))?;

    radiance.merge_lines.extend(measured.iter().filter_map(|m| {
        let (rejected, unmeasured) = (m.rejected_pixels, m.unmeasured_pixels);
        crate::capture::left_out(Subject::Sample, &m.total.channel, rejected, unmeasured)
    }));

    let beams = (radiance.scales.par_iter())
        .zip(&radiance.whites)
        .zip(&measured)
        .map(|((scale, known), m)| {
            let pixel_mm = radiance.view.blur_mm(m.center_px);
            let model = model.with_stand_in();
            beam::choose(capture, &scale.white, known.as_ref(), &model, pixel_mm)
        })
        .collect::<Result<Vec<_>>>()
        .map_err(|e| e.within(place()))?;
    let given = beams
        .iter()
        .zip(&measured)
        .zip(&radiance.scale_inputs)
        .enumerate()
        .map(|(index, ((beam, m), scale))| {
            let center_px = measured[0].center_px;
            let given = Given {
                directions: radiance.directions(index, m),
                ..given(capture, choices, &model, &radiance, center_px, beam)
            };
            unknown_g::settled(&m.profile, Some(&m.total), scale, &given)
        })
        .collect::<Result<Vec<Given>>>()
        .map_err(|e| e.within(place()))?;
    let mut exit_lines = vec![];
    let seen = (measured.par_iter())
        .zip(&radiance.scale_inputs)
        .zip(&given)
        .map(|((m, scale), given)| exit::of_transport(m, scale, given))
        .collect::<Result<Vec<_>>>()
        .map_err(|e| e.within(place()))?;
    // Every model is due the light that its own factor makes.
    let diffuse = measured;
    let measured: Vec<Measured> = diffuse
        .iter()
        .zip(seen)
        .map(|(diffuse, seen)| match seen {
            None => diffuse.clone(),
            Some((seen, line)) => {
                exit_lines.push(line);
                seen
            }
        })
        .collect();
    let fits = measured
        .iter()
        .zip(&radiance.scale_inputs)
        .zip(&given)
        .map(|((m, scale), given)| {
            monitor.check()?;
            let fit = fitting::fit_channel(&m.profile, Some(&m.total), scale, given)
                .map_err(|e| e.within(place()));
            monitor.step();
            fit
        })
        .collect::<Result<Vec<Fit>>>()?;
    let mut verdicts = vec![];
    let mut bootstraps = vec![];
    for (((m, scale), fit), given) in measured
        .iter()
        .zip(&radiance.scale_inputs)
        .zip(&fits)
        .zip(&given)
    {
        let (profile, total) = (&m.profile, Some(&m.total));
        verdicts.push(verdict::judge(profile, total, scale, given, fit)?);
        if choices.bootstrap > 0 {
            monitor.check()?;
            let channel = bootstrap::Channel {
                profile,
                total,
                scale,
                given,
            };
            let medium = fit.coefficients();
            bootstraps.push(channel.bootstrap(medium, choices.bootstrap, bootstrap::SEED)?);
        }
    }
    let mut confirmations = vec![];
    if choices.confirm {
        monitor.begin("confirming", fits.len() as u64);
        for ((fit, m), given) in fits.iter().zip(&measured).zip(&given) {
            monitor.check()?;
            let confirmed = confirm(fit, &m.profile, given).map_err(|e| e.within(place()))?;
            confirmations.push(confirmed);
            monitor.step();
        }
    }
    let compared = if choices.compare {
        let all = |model: &Given| {
            diffuse
                .iter()
                .zip(&radiance.scale_inputs)
                .zip(&given)
                .map(|((m, scale), given)| {
                    monitor.check()?;
                    let given = Given {
                        model: model.model.clone(),
                        ..given.unsettled()
                    };
                    let given = unknown_g::settled(&m.profile, Some(&m.total), scale, &given)?;
                    let turned = exit::of_transport(m, scale, &given)?;
                    let m = turned.as_ref().map_or(m, |(turned, _)| turned);
                    let (profile, total) = (&m.profile, Some(&m.total));
                    let fit = fitting::fit_channel(profile, total, scale, &given)?;
                    Ok((given, fit))
                })
                .collect::<Result<Vec<(Given, Fit)>>>()
        };
        comparison::compare(&known(capture, choices), &given[0], all)
            .map_err(|e| e.within(place()))?
    } else {
        vec![]
    };
    let materials = fitting::materials(&fits, &capture.material, &given)?;
    let mut warnings = channel_warnings(&fits, &beams);
    warnings.extend(radiance.curves.iter().map(|_| Curves::warning()));
    for ((fit, veil), m) in fits.iter().zip(&radiance.veils).zip(&measured) {
        let said = veil.warning(fit, &m.profile);
        warnings.extend(said.map(|w| format!("{}: {w}", fit.channel)));
    }
    Ok(Measurement {
        warnings,
        beams,
        material: capture.material.clone(),
        assumptions: {
            let mut lines = assumptions(capture, &given[0].model, &radiance.estimated);
            lines.extend(centers.lines);
            lines.extend(exit_lines);
            lines.extend(unseen(&radiance.scales, &measured));
            lines
        },
        radiance,
        measured,
        given,
        fits,
        verdicts,
        bootstraps,
        confirmations,
        compared,
        materials,
    })
}

impl Measurement {
    /// What photon counting says of the fit of channel `index`.
    pub fn confirmation(&self, index: usize) -> Option<&Confirmation> {
        self.confirmations.get(index)?.as_ref()
    }

    /// The same in a sentence for each channel.
    pub fn confirmation_lines(&self) -> Vec<String> {
        let said = self.fits.iter().enumerate().filter_map(|(index, fit)| {
            Some(format!(
                "{}: {}",
                fit.channel,
                self.confirmation(index)?.sentence()?
            ))
        });
        said.collect()
    }

    /// How far each channel can be trusted, in sentences.
    pub fn verdict_lines(&self) -> Vec<String> {
        let pairs = self.fits.iter().zip(&self.verdicts);
        let said = pairs.flat_map(|(fit, verdict)| {
            let word = if verdict.good { "good" } else { "bad" };
            let whole = format!("{}: {word}", fit.channel);
            let parts = verdict.sentences();
            std::iter::once(whole).chain(parts.map(|s| format!("{}: {s}", fit.channel)))
        });
        said.collect()
    }

    /// What beam and stray light of each channel are, and how they are known, in sentences.
    pub fn beam_lines(&self) -> Vec<String> {
        let each = self.fits.iter().zip(&self.beams);
        let beams = each.map(|(fit, beam)| format!("{}: {}", fit.channel, beam.sentence()));
        let veils = self.fits.iter().zip(&self.radiance.veils);
        let veils = veils.map(|(fit, veil)| format!("{}: {}", fit.channel, veil.sentence()));
        beams.chain(veils).collect()
    }

    /// What all fits took as given.
    pub fn common(&self) -> &Given {
        &self.given[0]
    }

    /// The document `fit.json`.
    pub fn document(&self) -> FitDocument {
        let document = FitDocument::new(
            &self.fits,
            Some(self.material.clone()),
            self.common().eta,
            &self.common().model.name,
            self.common().constraint,
            &self.radiance.inputs,
            &self.assumptions,
        );
        document
            .with_left_out(&self.radiance.left_out())
            .with_verdicts(&self.verdicts)
            .with_bootstraps(&self.bootstraps)
            .with_warnings(&self.warnings)
            .with_beams(&self.beams)
            .with_stray_light(&self.radiance.veils)
            .with_confirmations(&self.confirmations)
            .with_models(&self.compared)
    }

    /// What was chosen and what the chances of it hang on: a name and its value each.
    pub fn settings(&self) -> Vec<(String, String)> {
        let given = self.common();
        let yes = |it: bool| if it { "yes" } else { "no" }.to_owned();
        let range = match given.range_mm {
            Some((from, to)) => format!("{from} to {to} mm"),
            None => "chosen by the fit".to_owned(),
        };
        let exit = match given.exit {
            Exit::Fresnel { angle, .. } => format!("fresnel, at {} degrees", angle.to_degrees()),
            Exit::Lambert => "lambert".to_owned(),
        };
        let mut settings = vec![
            ("model", given.model.name.clone()),
            (
                "g",
                match (given.model.g, given.fitted_g()) {
                    (_, Some(_)) => "fitted along".to_owned(),
                    (Some(g), None) => g.to_string(),
                    (None, None) => "not used".to_owned(),
                },
            ),
            ("error of the model carried along", yes(given.discrepancy)),
            (
                "constraint",
                fit_json::constraint_name(given.constraint).to_owned(),
            ),
            (
                "scale",
                if given.free_scale { "free" } else { "known" }.to_owned(),
            ),
            ("range", range),
            ("entry loss", yes(given.entry_loss)),
            ("exit", exit),
        ];
        if self.confirmations.iter().any(Option::is_some) {
            let said = format!("{PHOTONS}, seed {}", confirm::SEED);
            settings.push(("photons of the confirmation", said));
        }
        if let Some(bootstrap) = self.bootstraps.first() {
            let said = format!("{}, seed {}", bootstrap.replicas, bootstrap::SEED);
            settings.push(("bootstrap replicas", said));
        }
        let named = settings.into_iter();
        named
            .map(|(name, value)| (name.to_owned(), value))
            .collect()
    }

    /// The profile of each channel.
    pub fn profiles(&self) -> Vec<RadialProfile> {
        self.measured.iter().map(|m| m.profile.clone()).collect()
    }

    /// The total of each channel.
    pub fn totals(&self) -> Vec<TotalReflectance> {
        self.measured.iter().map(|m| m.total.clone()).collect()
    }
}

/// What was left out of the white and of the sample, channel by channel.
fn unseen(scales: &[Scale], measured: &[Measured]) -> Vec<String> {
    let both = scales.iter().zip(measured).flat_map(|(scale, m)| {
        let name = &m.total.channel;
        [
            regions::unseen_line(name, "sample", m.unseen_share),
            regions::unseen_line(name, "reference", scale.unseen_share),
        ]
    });
    both.flatten().collect()
}

fn exit(capture: &manifest::Capture, angle: f64) -> Exit {
    match capture.model.exit {
        manifest::Exit::Fresnel => Exit::Fresnel {
            eta: capture.eta,
            angle,
        },
        manifest::Exit::Lambert => Exit::Lambert,
    }
}

/// The model that was asked for, with what the manifest knows of the sample where it uses that.
fn chosen_model(capture: &manifest::Capture, choices: &Choices) -> ModelChoice {
    let known = known(capture, choices);
    let mut model = known.called(&known.name);
    // A g that was typed and is not used is refused, not ignored; with all models one may use it.
    if !choices.compare {
        model.g = model.g.or(choices.model.g);
    }
    model
}

/// What any model could want to know of the sample: g, where none was typed, the thickness and the
/// way the beam falls.
fn known(capture: &manifest::Capture, choices: &Choices) -> ModelChoice {
    let mut model = choices.model.clone();
    model.g = model.g.or(capture.model.g);
    model.slab = capture.sample.thickness_mm.map(|thickness_mm| SlabChoice {
        thickness_mm,
        eta_below: capture.sample.eta_below,
    });
    model.beam.angle = capture.beam.angle_deg.to_radians();
    model
}

/// Warnings of the beams, each with its channel.
fn channel_warnings(fits: &[Fit], beams: &[ChosenBeam]) -> Vec<String> {
    fits.iter()
        .zip(beams)
        .flat_map(|(fit, beam)| {
            let name = &fit.channel;
            beam.warnings.iter().map(move |w| format!("{name}: {w}"))
        })
        .collect()
}

fn given(
    capture: &manifest::Capture,
    choices: &Choices,
    model: &ModelChoice,
    radiance: &Radiance,
    center_px: [f64; 2],
    beam: &ChosenBeam,
) -> Given {
    Given {
        model: model.clone(),
        discrepancy: choices.discrepancy.unwrap_or(capture.model.discrepancy),
        constraint: choices.constraint,
        free_scale: choices.free_scale,
        range_mm: choices.range_mm,
        eta: capture.eta,
        u_eta: capture.u_eta(),
        entry_loss: capture.model.entry_loss,
        cos_beam: capture.beam.angle_deg.to_radians().cos(),
        exit: radiance.exit,
        u_length_relative: geometry::u_length_relative(&capture.geometry, center_px),
        beam: beam.beam.clone(),
        u_fwhm_mm: beam.u_stated_mm,
        pixel_mm: radiance.view.blur_mm(center_px),
        variants: beam.variants.clone(),
        directions: vec![],
    }
}

fn assumptions(
    capture: &manifest::Capture,
    model: &ModelChoice,
    estimated: &[String],
) -> Vec<String> {
    let mut lines = vec![];
    lines.extend(
        capture
            .assumptions()
            .iter()
            .map(|a| format!("{} was not given; {} was assumed", a.field, a.value)),
    );
    lines.extend_from_slice(estimated);
    if capture.reference.sigma_s_prime_per_mm.is_none() {
        lines.push(
            "the white reference was taken as an ideal surface; a translucent one loses 1 % of its \
             light outside a 41 mm picture, which can be 20 % of sigma_a: give \
             reference.sigma_s_prime_per_mm and sigma_a_per_mm"
                .to_owned(),
        );
    }
    if let Some(thickness) = capture.sample.thickness_mm.filter(|_| !model.uses_slab()) {
        lines.push(format!(
            "the sample was taken as infinitely thick; sample.thickness_mm = {thickness} is not \
             used by this model: take --model multipole"
        ));
    }
    let untold = capture.camera.angle_deg.is_some_and(|angle| angle > 0.0)
        && capture.geometry.mm_per_pixel.is_some();
    if untold {
        lines.push(
            "camera.angle_deg acts on the light that leaves alone; the picture was taken as seen \
             from above: give geometry.corners_px and corners_mm in place of mm_per_pixel"
                .to_owned(),
        );
    }
    if model.uses_beam() {
        lines.push(
            "the centre of the profile was taken as the point where the beam enters".to_owned(),
        );
    } else if capture.beam.angle_deg > 0.0 {
        lines.push(
            "the glow of the oblique beam was taken as that of a beam along the normal, displaced: \
             its sources lie less deep, which no model here has"
                .to_owned(),
        );
    }
    lines
}
