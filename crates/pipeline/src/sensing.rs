//! The numbers of the camera: as the manifest states them, or as the frames show them.

use crate::capture::{Loaded, Room, Subject, Workspace, by_exposure};
use crate::consistency::Consistency;
use crate::error::{Blame, Result};
use crate::monitor::Monitor;
use hdr::EstimateError;
use hdr::estimate::Estimate;
use hdr::estimate::darks::Darks;
use hdr::estimate::transfer::{Noise, Transfer};
use hdr::estimate::white::White;
use physics::Sensor;

/// What is known of the sensor, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensing {
    /// The numbers themselves.
    pub sensor: Sensor,
    /// Those that the manifest left out.
    pub found: Vec<Found>,
}

/// A number of the camera that was found from the frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Its field of the manifest.
    pub field: &'static str,
    /// What it is, with its standard uncertainty; `None` for one that the frames do not show.
    pub estimate: Option<Estimate>,
    /// What stands for it then, and where that is from.
    pub instead: (f64, Instead),
}

/// What stands for a white level that the frames do not show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instead {
    /// The largest count that a file can hold.
    Largest,
    /// What the files state.
    Stated,
}

impl Found {
    /// A number that the frames show.
    fn shown(field: &'static str, estimate: Estimate) -> Self {
        Self {
            field,
            estimate: Some(estimate),
            instead: (estimate.value, Instead::Stated),
        }
    }

    /// The line of the report.
    pub fn line(&self) -> String {
        match self.estimate {
            Some(Estimate { value, u }) => {
                // One digit beyond the first of the uncertainty.
                let digits = if u > 0.0 {
                    (1.0 - u.log10().floor()).clamp(0.0, 9.0) as usize
                } else {
                    0
                };
                format!(
                    "{} was not given; {value:.digits$} ± {u:.digits$} was estimated from the frames",
                    self.field
                )
            }
            None => {
                let (value, from) = self.instead;
                let from = match from {
                    Instead::Largest => " was assumed",
                    Instead::Stated => ", which the files state, was taken",
                };
                format!(
                    "{} was not given and no samples pile up at the top; {value}{from}",
                    self.field
                )
            }
        }
    }
}

impl Loaded {
    /// The sensor: what the manifest states of it, and the rest from the frames of sample and
    /// reference together, which are read up to twice for it.
    ///
    /// # Errors
    ///
    /// A frame cannot be read, or the frames do not show a number that is missing; the error
    /// names the field.
    pub fn sensing(&self, monitor: &dyn Monitor) -> Result<Sensing> {
        let camera = &self.capture.camera;
        if let Some(curves) = &self.curves {
            return Ok(Sensing {
                sensor: curves.sensor(camera.prnu_relative),
                found: vec![],
            });
        }
        let mut found = vec![];
        let wants_noise = camera.gain_e_per_dn.is_none() || camera.read_noise_e.is_none();
        let wants_darks = wants_noise || camera.black_level_dn.is_none();
        if wants_darks || camera.white_level_dn.is_none() {
            let passes = u64::from(wants_darks)
                + u64::from(camera.white_level_dn.is_none())
                + u64::from(wants_noise);
            let both = self.frame_count(Subject::Sample) + self.frame_count(Subject::Reference);
            monitor.begin("estimating the sensor", both * passes / 2);
        }
        let missing = |field: &'static str| {
            let place = self.input.path.display();
            format!("{place}: field `camera.{field}` is missing and cannot be estimated")
        };

        let mut darks = Darks::new();
        if wants_darks {
            self.add_darks(&mut darks, monitor)?;
        }
        let black_level_dn = match camera.black_level_dn {
            Some(black) => black,
            None => {
                let black = darks.black_level().input(missing("black_level_dn"))?;
                found.push(Found::shown("camera.black_level_dn", black));
                black.value
            }
        };
        let white_level_dn = match camera.white_level_dn {
            Some(white) => white,
            None => {
                let (estimate, stated) = self.white_level(black_level_dn, monitor)?;
                let instead = match stated {
                    Some(stated) => (stated, Instead::Stated),
                    None => (f64::from(u16::MAX), Instead::Largest),
                };
                found.push(Found {
                    field: "camera.white_level_dn",
                    estimate,
                    instead,
                });
                estimate.map_or(instead.0, |e| e.value)
            }
        };
        let (mut gain, mut read) = (camera.gain_e_per_dn, camera.read_noise_e);
        if wants_noise {
            let field = if gain.is_none() {
                "gain_e_per_dn"
            } else {
                "read_noise_e"
            };
            let noise = self
                .noise(&darks, black_level_dn, white_level_dn, monitor)?
                .input(missing(field))?;
            if gain.is_none() {
                gain = Some(noise.gain_e_per_dn.value);
                found.push(Found::shown("camera.gain_e_per_dn", noise.gain_e_per_dn));
            }
            if read.is_none() {
                // What the frames show is the noise in DN; a gain that is given makes it
                // electrons.
                let factor = gain.map_or(1.0, |gain| gain / noise.gain_e_per_dn.value);
                let estimate = Estimate {
                    value: noise.read_noise_e.value * factor,
                    u: noise.read_noise_e.u * factor,
                };
                read = Some(estimate.value);
                found.push(Found::shown("camera.read_noise_e", estimate));
            }
        }
        Ok(Sensing {
            sensor: Sensor {
                gain_e_per_dn: gain.expect("it was given, or estimated just above"),
                read_noise_e: read.expect("it was given, or estimated just above"),
                black_level_dn,
                white_level_dn,
                prnu_relative: camera.prnu_relative,
            },
            found,
        })
    }

    /// Every dark of sample and reference, each file once.
    fn add_darks(&self, darks: &mut Darks, monitor: &dyn Monitor) -> Result<()> {
        let of = |subject| self.entries(subject).1.iter();
        let mut entries: Vec<_> = of(Subject::Sample).chain(of(Subject::Reference)).collect();
        entries.sort_by(|a, b| {
            let by_file = a.file.cmp(&b.file);
            a.exposure_s.total_cmp(&b.exposure_s).then(by_file)
        });
        entries.dedup_by(|a, b| a.file == b.file);
        let mut room = Room::default();
        for entry in entries {
            monitor.check()?;
            let mut seen = Consistency::default();
            let frame = self.frame(entry, &mut room, &mut vec![], &mut seen)?;
            darks
                .add(frame, entry.exposure_s)
                .input(self.place(&entry.file))?;
            monitor.step();
        }
        Ok(())
    }

    /// What the frames show of the white level, and what their files state of it.
    fn white_level(
        &self,
        black_dn: f64,
        monitor: &dyn Monitor,
    ) -> Result<(Option<Estimate>, Option<f64>)> {
        let mut white = White::new(black_dn);
        let mut seen = [Consistency::default(), Consistency::default()];
        let mut room = Room::default();
        for (subject, seen) in [Subject::Sample, Subject::Reference]
            .into_iter()
            .zip(&mut seen)
        {
            white.restart();
            for entry in by_exposure(self.entries(subject).0) {
                monitor.check()?;
                let frame = self.frame(entry, &mut room, &mut vec![], seen)?;
                white
                    .add(&frame, entry.exposure_s)
                    .input(self.place(&entry.file))?;
                room.take_back(frame);
                monitor.step();
            }
        }
        let stated = seen.iter().filter_map(Consistency::white_level_dn);
        Ok((white.white_level(), stated.reduce(f64::min)))
    }

    fn noise(
        &self,
        darks: &Darks,
        black_dn: f64,
        white_dn: f64,
        monitor: &dyn Monitor,
    ) -> Result<std::result::Result<Noise, EstimateError>> {
        let mut transfer = Transfer::new(black_dn, white_dn);
        let mut workspace = Workspace::default();
        for subject in [Subject::Sample, Subject::Reference] {
            transfer.restart();
            self.with_darks(subject, &mut workspace, monitor, |entry, frame, dark, _| {
                transfer
                    .add(frame, dark, entry.exposure_s)
                    .input(self.place(&entry.file))
            })?;
        }
        Ok(transfer.noise(&darks.noise_points(black_dn)))
    }
}
