//! Monte Carlo simulations as files.

use crate::brdf::follow;
use crate::error::{Blame, Error, Kind, Result};
use crate::files::{Outputs, read, read_text};
use crate::fit_json::SCHEMA_VERSION;
use crate::medium::layered_medium;
use crate::monitor::Monitor;
use crate::tallies::{SIDES, tables};
use formats::medium_toml::{self, BeamEntry, BeamKind, MediumFile, TallyEntry};
use montecarlo::{
    CannotMerge, Direction, Estimate, Incidence, PHOTONS_PER_BLOCK, Side, SimdPath, Simulation,
    Tally, TallySpec, TallyState, Walk,
};
use physics::footprint::Beam;
use physics::{LayeredMedium, RadialProfile, Slab};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::ops::{ControlFlow, Range};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// How long to follow photons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// At most so many photons, those of earlier runs included.
    pub photons: u64,
    /// Stop once the larger standard error of reflectance and transmittance is below this.
    pub until_u: Option<f64>,
}

/// `state.json`: what a run needs to go on, and what it belongs to.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct State {
    schema_version: u32,
    simd: String,
    seed: u64,
    medium: MediumFile,
    fingerprint: u64,
    blocks: Vec<(u64, u64)>,
    events: u64,
    sums: Vec<[i128; 2]>,
}

impl State {
    fn of(file: &MediumFile, seed: u64, path: SimdPath, tally: &Tally) -> Self {
        let TallyState {
            fingerprint,
            blocks,
            events,
            sums,
        } = tally.state();
        Self {
            schema_version: SCHEMA_VERSION,
            simd: path.name().to_owned(),
            seed,
            medium: file.clone(),
            fingerprint,
            blocks,
            events,
            sums,
        }
    }

    /// What it holds, of the simulation that it belongs to.
    fn tally(self, simulation: &Simulation) -> std::result::Result<Tally, CannotMerge> {
        simulation.restore(TallyState {
            fingerprint: self.fingerprint,
            blocks: self.blocks,
            events: self.events,
            sums: self.sums,
        })
    }
}

/// `totals.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Totals {
    schema_version: u32,
    beamspot_version: &'static str,
    simd: String,
    seed: u64,
    photons: u64,
    events: u64,
    specular: Number,
    diffuse_reflectance: Number,
    transmittance: Number,
    unscattered_transmittance: Number,
    absorbed: Number,
    absorbed_by_layer: Vec<Number>,
    cut_off: Number,
    roulette: Number,
    energy_error: f64,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Number {
    value: f64,
    u: f64,
}

impl From<Estimate> for Number {
    fn from(e: Estimate) -> Self {
        Self {
            value: e.value,
            u: e.u,
        }
    }
}

/// A finished run.
#[derive(Debug)]
pub struct Run {
    /// What came of it.
    pub totals: Totals,
    /// Whether the user stopped it before its time.
    pub interrupted: bool,
}

impl Totals {
    /// Name, value and standard error of each total, for a person.
    pub fn rows(&self) -> Vec<(&'static str, f64, f64)> {
        [
            ("specular", self.specular),
            ("diffuse reflectance", self.diffuse_reflectance),
            ("transmittance", self.transmittance),
            ("absorbed", self.absorbed),
            ("cut off", self.cut_off),
        ]
        .map(|(name, n)| (name, n.value, n.u))
        .to_vec()
    }

    /// Photons and scatterings followed.
    pub fn counts(&self) -> (u64, u64) {
        (self.photons, self.events)
    }
}

/// Names of the files of a simulation that counts everything.
const NAMES: [&str; 15] = [
    "totals.json",
    "state.json",
    "reflectance_r.csv",
    "transmittance_r.csv",
    "reflectance_angle.csv",
    "transmittance_angle.csv",
    "reflectance_order.csv",
    "transmittance_order.csv",
    "reflectance_path.csv",
    "transmittance_path.csv",
    "absorbed_z.csv",
    "reflectance_r_angle.csv",
    "transmittance_r_angle.csv",
    "absorbed_z_r.csv",
    "medium.toml",
];

/// Simulates the medium of the file `medium`, or goes on with a run that `folder` holds.
///
/// An interrupt keeps what is done. `say` is told once how long the rest will take if that is
/// over an hour.
///
/// # Errors
///
/// The medium cannot be used, the instruction path is unknown or not there, or `folder` holds
/// another simulation and `force` is not given.
#[expect(
    clippy::too_many_arguments,
    reason = "one for each thing that a user may say"
)]
pub fn simulate(
    medium: &Path,
    folder: &Path,
    effort: Effort,
    seed: u64,
    simd: Option<&str>,
    force: bool,
    monitor: &dyn Monitor,
    say: &mut dyn FnMut(&str),
) -> Result<Run> {
    let text = read_text(medium)?;
    let file = medium_toml::parse(&text).input(medium.display())?;
    let path = simd_path(simd)?;
    let simulation = simulation(&file, seed, path).map_err(|e| e.within(medium.display()))?;
    let blocks = Simulation::blocks_for(effort.photons).map_err(|e| Error::new(Kind::Usage, e))?;
    if effort.until_u.is_some_and(|u| !(u > 0.0 && u.is_finite())) {
        return Err(Error::new(
            Kind::Usage,
            "--until-u: expected a number above 0",
        ));
    }

    let state_path = folder.join("state.json");
    let goes_on = state_path.exists() && !force;
    let mut tally = if goes_on {
        let state = kept(&state_path)?;
        let same = state.medium == file && state.seed == seed && state.simd == path.name();
        if !same {
            let message = format!(
                "{}: holds a simulation of another medium, seed or instruction path ({}); choose \
                 another folder, or replace it with --force",
                folder.display(),
                state.simd
            );
            return Err(Error::new(Kind::Input, message));
        }
        state.tally(&simulation).input(state_path.display())?
    } else {
        simulation.empty()
    };
    let outputs = Outputs::new(folder, NAMES, &[medium.to_owned()], force || goes_on)?;

    let first = tally.next_block();
    let good_enough = |t: &Tally| {
        effort
            .until_u
            .is_some_and(|u| t.photons() > 0 && t.u() <= u)
    };
    monitor.begin("photons", blocks.end.saturating_sub(first));
    if first < blocks.end && !good_enough(&tally) {
        let start = Instant::now();
        let mut told = false;
        let mut done = 0;
        let before = tally.clone();
        let more = simulation.run(first..blocks.end, &AtomicBool::new(false), |so_far| {
            let finished = so_far.photons() / PHOTONS_PER_BLOCK;
            for _ in done..finished {
                monitor.step();
            }
            done = finished;
            if !told {
                told = true;
                let all = (blocks.end - first) as f64 / finished as f64 - 1.0;
                // The standard error falls with the root of the photons.
                let enough = effort
                    .until_u
                    .map_or(f64::INFINITY, |u| (so_far.u() / u).powi(2));
                let left = all.min(enough);
                say_how_long(start.elapsed().as_secs_f64() * left, effort, say);
            }
            // Only a run with a limit has to look at both parts together.
            let enough = effort.until_u.is_some()
                && before
                    .clone()
                    .merge(so_far)
                    .is_ok_and(|both| good_enough(&both));
            if monitor.stopped() || enough {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        tally = tally.merge(&more).fault("adding runs")?;
    }
    let interrupted = monitor.stopped();
    if tally.photons() == 0 {
        return Err(Error::interrupted());
    }
    let totals = totals(&tally, seed, path);
    write(&outputs, &file, &tally, seed, path, &totals, &text)?;
    outputs.commit()?;
    Ok(Run {
        totals,
        interrupted,
    })
}

/// Photons followed through a medium, without files: a run, or a part of one.
#[derive(Clone, Debug)]
pub struct Photons {
    medium: MediumFile,
    seed: u64,
    path: SimdPath,
    tally: Tally,
}

impl Photons {
    /// The medium with its light and its tallies.
    pub fn medium(&self) -> &MediumFile {
        &self.medium
    }

    /// What was counted.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Every total with its standard error.
    pub fn totals(&self) -> Totals {
        totals(&self.tally, self.seed, self.path)
    }

    /// Two parts of one run together, in any order: the same bytes as if they had been one.
    ///
    /// # Errors
    ///
    /// They are of different runs, or hold the same photons.
    pub fn merge(&self, other: &Self) -> Result<Self> {
        Ok(Self {
            tally: (self.tally.clone())
                .merge(&other.tally)
                .input("adding simulations")?,
            ..self.clone()
        })
    }

    /// Everything, in the form of `state.json`.
    ///
    /// # Errors
    ///
    /// A number of the medium has no form there.
    pub fn to_json(&self) -> Result<String> {
        let state = State::of(&self.medium, self.seed, self.path, &self.tally);
        serde_json::to_string(&state).fault("state of a simulation")
    }

    /// What [`Self::to_json`] wrote.
    ///
    /// # Errors
    ///
    /// It is damaged, of another version, or of an instruction path that is not there.
    pub fn from_json(text: &str) -> Result<Self> {
        let state = parsed(text.as_bytes())?;
        let path = simd_path(Some(&state.simd))?;
        let (medium, seed) = (state.medium.clone(), state.seed);
        let simulation = simulation(&medium, seed, path)?;
        Ok(Self {
            tally: state.tally(&simulation).input("state of a simulation")?,
            medium,
            seed,
            path,
        })
    }
}

/// Which part of a run: number `index`, from 0, of `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its number.
    pub index: u64,
    /// How many there are.
    pub count: u64,
}

impl Part {
    /// The whole run.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Its share of `all` blocks: of every block some part holds, and one alone.
    fn of(self, all: u64) -> Result<Range<u64>> {
        let Self { index, count } = self;
        if index >= count {
            let message = format!(
                "part {index} of {count}: expected a number from 0 to one below how many there are"
            );
            return Err(Error::new(Kind::Usage, message));
        }
        let edge = |i: u64| (u128::from(all) * u128::from(i) / u128::from(count)) as u64;
        Ok(edge(index)..edge(index + 1))
    }
}

/// Follows at least `photons` photons through `medium`, or `part` of them, without files.
///
/// # Errors
///
/// The medium cannot be used, the instruction path is unknown or not there, or the user stopped it.
pub fn run(
    medium: &MediumFile,
    photons: u64,
    part: Part,
    seed: u64,
    simd: Option<&str>,
    monitor: &dyn Monitor,
) -> Result<Photons> {
    let path = simd_path(simd)?;
    let simulation = simulation(medium, seed, path)?;
    let blocks = Simulation::blocks_for(photons).map_err(|e| Error::new(Kind::Usage, e))?;
    let blocks = part.of(blocks.end)?;
    monitor.begin("photons", blocks.end - blocks.start);
    let tally = follow(&simulation, blocks, monitor)?;
    Ok(Photons {
        medium: medium.clone(),
        seed,
        path,
        tally,
    })
}

fn say_how_long(seconds: f64, effort: Effort, say: &mut dyn FnMut(&str)) {
    if seconds < 3600.0 {
        return;
    }
    let (number, unit) = match seconds / 3600.0 {
        hours if hours < 48.0 => (hours, "hours"),
        hours if hours < 24.0 * 730.0 => (hours / 24.0, "days"),
        hours => (hours / 24.0 / 365.25, "years"),
    };
    say(&format!(
        "{} photons will take about {number:.0} {unit} on this machine; an interrupt keeps what is \
         done, and the same call goes on from there",
        effort.photons
    ));
}

/// The instruction path called `name`, or the fastest.
fn simd_path(name: Option<&str>) -> Result<SimdPath> {
    let Some(name) = name else {
        return Ok(SimdPath::best());
    };
    let names: Vec<&str> = SimdPath::ALL
        .iter()
        .filter(|p| p.is_available())
        .map(|p| p.name())
        .collect();
    SimdPath::from_name(name)
        .filter(|p| p.is_available())
        .ok_or_else(|| {
            let message = format!("--simd {name}: this machine has {}", names.join(", "));
            Error::new(Kind::Usage, message)
        })
}

fn kept(path: &Path) -> Result<State> {
    parsed(&read(path)?).map_err(|e| e.within(path.display()))
}

fn parsed(text: &[u8]) -> Result<State> {
    let state: State = serde_json::from_slice(text).input("state of a simulation")?;
    if state.schema_version != SCHEMA_VERSION {
        let message = format!(
            "schema_version {}; this version goes on from {SCHEMA_VERSION} only",
            state.schema_version
        );
        return Err(Error::new(Kind::Input, message));
    }
    Ok(state)
}

/// The simulation that a file describes.
fn simulation(file: &MediumFile, seed: u64, path: SimdPath) -> Result<Simulation> {
    let medium = layered_medium(file)?;
    let BeamEntry {
        kind,
        fwhm_mm,
        angle_deg,
        diffuse,
    } = file.beam;
    let incidence = Incidence {
        beam: match kind {
            BeamKind::Pencil => Beam::Point,
            BeamKind::Gaussian => Beam::Gaussian { fwhm_mm },
            BeamKind::Disk => Beam::Disk { fwhm_mm },
        },
        direction: if diffuse {
            Direction::Diffuse
        } else {
            Direction::Collimated {
                angle: angle_deg.to_radians(),
            }
        },
    };
    let simulation =
        Simulation::new(medium, incidence, &tally_spec(&file.tally), seed).input("simulation")?;
    Ok(simulation.with_walk(Walk::Lanes(path)))
}

fn tally_spec(tally: &TallyEntry) -> TallySpec {
    let edges = |max: f64, bins: usize| -> Vec<f64> {
        // More than any tally may have; the simulation refuses them by number.
        let bins = bins.min(1 << 23);
        if bins == 0 {
            return vec![];
        }
        (0..=bins).map(|i| max * i as f64 / bins as f64).collect()
    };
    TallySpec {
        radius_mm: edges(tally.r_max_mm, tally.r_bins),
        angle_bins: tally.angle_bins,
        radius_and_angle: tally.radius_and_angle,
        azimuth_bins: 0,
        depth_mm: edges(tally.z_max_mm, tally.z_bins),
        depth_and_radius: tally.depth_and_radius,
        orders: tally.orders,
        path_mm: edges(tally.path_max_mm, tally.path_bins),
        path_cutoff_mm: tally.path_cutoff_mm,
    }
}

fn totals(tally: &Tally, seed: u64, path: SimdPath) -> Totals {
    Totals {
        schema_version: SCHEMA_VERSION,
        beamspot_version: env!("CARGO_PKG_VERSION"),
        simd: path.name().to_owned(),
        seed,
        photons: tally.photons(),
        events: tally.events(),
        specular: tally.specular().into(),
        diffuse_reflectance: tally.reflectance().into(),
        transmittance: tally.transmittance().into(),
        unscattered_transmittance: tally.unscattered_transmittance().into(),
        absorbed: tally.absorbed().into(),
        absorbed_by_layer: tally
            .absorbed_by_layer()
            .into_iter()
            .map(Number::from)
            .collect(),
        cut_off: tally.cut_off().into(),
        roulette: tally.roulette().into(),
        energy_error: tally.energy_error(),
    }
}

fn write(
    outputs: &Outputs,
    file: &MediumFile,
    tally: &Tally,
    seed: u64,
    path: SimdPath,
    totals: &Totals,
    text: &str,
) -> Result<()> {
    let state = State::of(file, seed, path, tally);
    outputs.write("state.json", |out| Ok(serde_json::to_writer(out, &state)?))?;
    outputs.write("totals.json", |out| {
        serde_json::to_writer_pretty(&mut *out, totals)?;
        Ok(writeln!(out)?)
    })?;
    // The medium travels with its results, comments and all.
    outputs.write("medium.toml", |out| Ok(out.write_all(text.as_bytes())?))?;

    let spec = &file.tally;
    for (side, name) in SIDES {
        if spec.r_bins > 0 {
            let profile = RadialProfile {
                channel: "Y".to_owned(),
                points: tally.profile(side),
            };
            outputs.write(format!("{name}_r.csv"), |out| {
                Ok(formats::profile_csv::write(
                    std::slice::from_ref(&profile),
                    out,
                )?)
            })?;
        }
    }
    for table in tables(spec, tally) {
        outputs.write(format!("{}.csv", table.name), |out| {
            Ok(out.write_all(table.csv().as_bytes())?)
        })?;
    }
    Ok(())
}

/// What a photon count finds of one homogeneous half-space under a beam.
#[derive(Clone, Debug)]
pub struct SpotRun {
    /// Exitance per incident power in each of the rings.
    pub points: Vec<physics::ProfilePoint>,
    /// Photons followed.
    pub photons: u64,
}

/// Follows `photons` into a half-space, or a `slab` of it, and counts what leaves within `radius_mm`, edges of rings
/// from 0 outward. Paths longer than `path_cutoff_mm` are dropped.
///
/// # Errors
///
/// The medium cannot be simulated.
pub fn spot(
    medium: &physics::Medium,
    slab: Option<Slab>,
    beam: Beam,
    radius_mm: Vec<f64>,
    path_cutoff_mm: f64,
    photons: u64,
    seed: u64,
) -> Result<SpotRun> {
    let tally = TallySpec {
        radius_mm,
        path_cutoff_mm: Some(path_cutoff_mm),
        ..TallySpec::default()
    };
    let incidence = Incidence {
        beam,
        ..Incidence::PENCIL
    };
    let mut layers = LayeredMedium::half_space(medium);
    if let (Some(slab), [layer]) = (slab, &mut layers.layers[..]) {
        layer.thickness_mm = Some(slab.thickness_mm);
        layers.eta_below = medium.eta / slab.eta_below;
    }
    let simulation = Simulation::new(layers, incidence, &tally, seed).input("Monte Carlo")?;
    let tally = simulation.run_photons(photons).input("Monte Carlo")?;
    Ok(SpotRun {
        points: tally.profile(Side::Above),
        photons: tally.photons(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_in_units_that_mean_something() {
        let effort = Effort {
            photons: 1_000_000_000_000,
            until_u: None,
        };
        let mut said = vec![];
        for seconds in [10.0, 7200.0, 400_000.0, 1e9] {
            say_how_long(seconds, effort, &mut |text| said.push(text.to_owned()));
        }
        assert_eq!(said.len(), 3);
        assert!(said[0].contains("about 2 hours"), "{said:?}");
        assert!(said[1].contains("about 5 days"), "{said:?}");
        assert!(said[2].contains("about 32 years"), "{said:?}");
    }
}
