//! The sum over exposures.

use crate::dark::{DarkFrame, check_exposure, check_frame, check_size};
use crate::error::MergeError;
use crate::hot::hot_pixels;
use crate::predict::Neighbours;
use physics::frame::channel_names;
use physics::{ChannelMap, Frame, RadianceMap, Sensor};

/// Share of the range from black to white up to which a sample may be predicted. The 10 % that
/// are left are more than ten standard deviations of a full pixel, so that no sample is dropped
/// because its own noise was high: that would bias the mean low by up to 0.3 %.
const PREDICTED_FULL: f64 = 0.9;

/// The same for the pixel's own estimate, a guard for spots so narrow that the neighbours say
/// little. Far enough above [`PREDICTED_FULL`] that noise does not reach it in a smooth picture.
const OWN_FULL: f64 = 0.96;

/// Share of a channel's pixels that, saturated in every frame, make the merge an error.
const TOO_MANY_SATURATED: f64 = 0.5;

/// Merges exposures that arrive one by one, by increasing exposure.
///
/// Value of a pixel: Σ(DN − dark)/Σt over the frames that measured it, in DN/s. Weighting with
/// the exposure time is within 2 % of the best possible down to 1e-5 of the peak and needs no
/// estimate of the noise.
#[derive(Clone, Debug)]
pub struct Merge {
    size: (usize, usize, usize),
    sensor: Sensor,
    /// Σ(DN − dark) of the used frames, DN.
    sum: Vec<f32>,
    /// Σt of the used frames, s.
    time: Vec<f32>,
    /// Σ of the variance that the used frames have without light, DN².
    floor: Vec<f32>,
    /// The dark of the last, longest frame, DN, and how many frames it is the mean of.
    dark: (Vec<f32>, u32),
    /// What rounding adds to the variance of the last frame, DN².
    rounding_variance: f64,
    frames: Vec<FrameReport>,
}

/// What one frame gave to the merge.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameReport {
    /// Its exposure, s.
    pub exposure_s: f64,
    /// Samples used, per channel.
    pub used: Vec<u64>,
    /// Samples left out as saturated, or so bright in the shorter exposures that they had to
    /// be, per channel.
    pub saturated: Vec<u64>,
}

/// What a channel lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelReport {
    /// Pixels masked for their dark current.
    pub hot: u64,
    /// Other pixels that are saturated in every frame.
    pub saturated_everywhere: u64,
}

/// What was left out of a merge, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct MergeReport {
    /// The frames, as they were added.
    pub frames: Vec<FrameReport>,
    /// The channels, in the order of the camera.
    pub channels: Vec<ChannelReport>,
}

impl Merge {
    /// An empty merge of frames of this size.
    ///
    /// # Errors
    ///
    /// The size is zero, the channels are neither 1 nor 3, or a number of the sensor is out of its range.
    pub fn new(
        width: usize,
        height: usize,
        channels: usize,
        sensor: &Sensor,
    ) -> Result<Self, MergeError> {
        let samples = width.saturating_mul(height).saturating_mul(channels);
        if samples == 0 {
            return Err(MergeError::EmptyFrame(width, height, channels));
        }
        if channel_names(channels).len() != channels {
            return Err(MergeError::Channels(channels));
        }
        check_sensor(sensor)?;
        Ok(Self {
            size: (width, height, channels),
            sensor: *sensor,
            sum: vec![],
            time: vec![],
            floor: vec![],
            dark: (vec![], 0),
            rounding_variance: 0.0,
            frames: vec![],
        })
    }

    /// Adds `frame`, less `dark`, which must be of the same exposure.
    ///
    /// # Errors
    ///
    /// Frame or dark has another size, the exposure is not positive and finite or is shorter
    /// than the one before, or the dark has another exposure. The merge is unchanged then.
    pub fn add(
        &mut self,
        frame: &Frame,
        dark: &DarkFrame,
        exposure_s: f64,
    ) -> Result<(), MergeError> {
        self.add_measured(frame, dark, exposure_s, exposure_s)
    }

    /// The same for a frame that is stated to be of `exposure_s`, by which it is matched with its
    /// dark, and is known to be of `measured_s`, by which it counts: see [`crate::overlap`].
    ///
    /// # Errors
    ///
    /// As [`Self::add`].
    pub fn add_measured(
        &mut self,
        frame: &Frame,
        dark: &DarkFrame,
        exposure_s: f64,
        measured_s: f64,
    ) -> Result<(), MergeError> {
        check_exposure(exposure_s)?;
        check_exposure(measured_s)?;
        check_frame(frame)?;
        check_size(frame, self.size)?;
        if dark.size() != self.size {
            return Err(MergeError::Size {
                found: dark.size(),
                expected: self.size,
            });
        }
        if !dark.serves(exposure_s) {
            return Err(MergeError::NoDark {
                exposure_s,
                nearest_s: Some(dark.exposure_s()),
            });
        }
        if let Some(previous) = self.frames.last()
            && exposure_s < previous.exposure_s
        {
            return Err(MergeError::Order {
                found_s: exposure_s,
                previous_s: previous.exposure_s,
            });
        }
        let (width, height, channels) = self.size;
        // Only now: a size is not trusted with memory before a frame of that size has come.
        for buffer in [
            &mut self.sum,
            &mut self.time,
            &mut self.floor,
            &mut self.dark.0,
        ] {
            buffer.resize(frame.samples.len(), 0.0);
        }
        self.dark.1 = dark.count();
        self.rounding_variance = frame.samples.rounding_variance();

        let sensor = &self.sensor;
        let row = width * channels;
        let span = sensor.white_level_dn - sensor.black_level_dn;
        let step = Step {
            exposure: measured_s as f32,
            per_dark: 1.0 / dark.count() as f32,
            white: sensor.white_level_dn as f32,
            neighbours_limit: (sensor.black_level_dn + PREDICTED_FULL * span) as f32,
            own_limit: (sensor.black_level_dn + OWN_FULL * span) as f32,
            black: sensor.black_level_dn as f32,
            read_variance: read_variance(sensor, frame.samples.rounding_variance()) as f32,
            per_electron: (1.0 / sensor.gain_e_per_dn) as f32,
        };
        let mut used_samples = vec![0_u64; channels];
        let mut neighbours = Neighbours::new(row, channels);
        let (mut predicted, mut own) = (vec![0.0; row], vec![0.0; row]);
        let mut samples = vec![0.0; row];
        let mut used = vec![0.0; row];
        neighbours.advance(Some((&self.sum[..row], &self.time[..row])));
        for y in 0..height {
            let here = y * row..(y + 1) * row;
            let below = (y + 1) * row..(y + 2) * row;
            neighbours
                .advance((y + 1 < height).then(|| (&self.sum[below.clone()], &self.time[below])));
            neighbours.means(&mut predicted, &mut own);
            frame.samples.copy_to(here.clone(), &mut samples);
            step.add(
                &samples,
                &dark.sum()[here.clone()],
                &predicted,
                &own,
                &mut used,
                Sums {
                    sum: &mut self.sum[here.clone()],
                    time: &mut self.time[here.clone()],
                    floor: &mut self.floor[here.clone()],
                    dark: &mut self.dark.0[here],
                },
            );
            for (channel, count) in used_samples.iter_mut().enumerate() {
                *count += used
                    .iter()
                    .skip(channel)
                    .step_by(channels)
                    .filter(|used| **used != 0.0)
                    .count() as u64;
            }
        }
        let pixels = (width * height) as u64;
        self.frames.push(FrameReport {
            exposure_s,
            saturated: used_samples.iter().map(|used| pixels - used).collect(),
            used: used_samples,
        });
        Ok(())
    }

    /// The merged picture in DN/s, and what was left out of it.
    ///
    /// The variance of each pixel is that of its sum of samples and darks, read noise and
    /// quantisation included, divided by (Σt)²; what the sensor's uneven sensitivity adds is
    /// common to all frames of a pixel and does not average down.
    ///
    /// # Errors
    ///
    /// [`MergeError::NoFrames`], or [`MergeError::Saturated`] where half of a channel or more is
    /// saturated in every frame.
    pub fn finish(self) -> Result<(RadianceMap, MergeReport), MergeError> {
        if self.frames.is_empty() {
            return Err(MergeError::NoFrames);
        }
        let (width, height, channels) = self.size;
        let sensor = &self.sensor;
        let (black, read) = (
            sensor.black_level_dn as f32,
            read_variance(sensor, self.rounding_variance) as f32,
        );
        let per_electron = (1.0 / sensor.gain_e_per_dn) as f32;
        let prnu = (sensor.prnu_relative * sensor.prnu_relative) as f32;
        let (dark, darks) = &self.dark;
        let hot = hot_pixels(dark, channels, |level| {
            ((read + (level - black).max(0.0) * per_electron) / *darks as f32).sqrt()
        });

        let mut maps = Vec::with_capacity(channels);
        let mut reports = Vec::with_capacity(channels);
        for (channel, name) in channel_names(channels).iter().enumerate() {
            let mut report = ChannelReport {
                hot: 0,
                saturated_everywhere: 0,
            };
            let mut value = Vec::with_capacity(width * height);
            let mut variance = Vec::with_capacity(width * height);
            for i in (channel..self.sum.len()).step_by(channels) {
                let (sum, time) = (self.sum[i], self.time[i]);
                if hot[i] || time == 0.0 {
                    if hot[i] {
                        report.hot += 1;
                    } else {
                        report.saturated_everywhere += 1;
                    }
                    value.push(0.0);
                    variance.push(f32::INFINITY);
                    continue;
                }
                let mean = sum / time;
                // The sum itself stands for its expectation, below zero too: clipped there, the
                // variances of a dark region would be too large on average. One read-out is
                // the least noise that any pixel has.
                let counted = (self.floor[i] + sum * per_electron).max(read);
                value.push(mean);
                variance.push(counted / (time * time) + prnu * mean * mean);
            }
            let pixels = (width * height) as u64;
            if report.saturated_everywhere as f64 >= TOO_MANY_SATURATED * pixels as f64 {
                return Err(MergeError::Saturated {
                    channel: name,
                    saturated: report.saturated_everywhere,
                    pixels,
                });
            }
            reports.push(report);
            maps.push(ChannelMap {
                name: (*name).to_owned(),
                value,
                variance,
            });
        }
        Ok((
            RadianceMap {
                width,
                height,
                channels: maps,
            },
            MergeReport {
                frames: self.frames,
                channels: reports,
            },
        ))
    }
}

/// The numbers of one frame that its samples share.
struct Step {
    exposure: f32,
    per_dark: f32,
    white: f32,
    neighbours_limit: f32,
    own_limit: f32,
    black: f32,
    read_variance: f32,
    per_electron: f32,
}

/// One row of the running sums.
struct Sums<'a> {
    sum: &'a mut [f32],
    time: &'a mut [f32],
    floor: &'a mut [f32],
    dark: &'a mut [f32],
}

impl Step {
    /// Adds one row. `used` says afterwards which samples had a weight: 1 or 0.
    fn add(
        &self,
        samples: &[f32],
        dark_sum: &[f32],
        predicted: &[f32],
        own: &[f32],
        used: &mut [f32],
        into: Sums<'_>,
    ) {
        // Equal lengths that the compiler can see, so that it needs no check in the loop.
        let n = samples.len();
        let (dark_sum, predicted, own) = (&dark_sum[..n], &predicted[..n], &own[..n]);
        let Sums {
            sum,
            time,
            floor,
            dark: level,
        } = into;
        let (used, sum, time) = (&mut used[..n], &mut sum[..n], &mut time[..n]);
        let (floor, level) = (&mut floor[..n], &mut level[..n]);
        for i in 0..n {
            let sample = samples[i];
            let dark = dark_sum[i] * self.per_dark;
            let good = (sample < self.white)
                & (dark + predicted[i] * self.exposure <= self.neighbours_limit)
                & (dark + own[i] * self.exposure <= self.own_limit);
            let weight = if good { 1.0 } else { 0.0 };
            // The measured dark stands for its expectation and is not clipped at the black
            // level, for the reason that holds for the signal. The dark that was subtracted
            // has the same noise, less where several were averaged.
            let variance = self.read_variance + (dark - self.black) * self.per_electron;
            sum[i] += weight * (sample - dark);
            time[i] += weight * self.exposure;
            floor[i] += weight * variance * (1.0 + self.per_dark);
            level[i] = dark;
            used[i] = weight;
        }
    }
}

/// Variance of one read-out without light, with that of rounding, DN².
fn read_variance(sensor: &Sensor, rounding_variance: f64) -> f64 {
    (sensor.read_noise_e / sensor.gain_e_per_dn).powi(2) + rounding_variance
}

fn check_sensor(sensor: &Sensor) -> Result<(), MergeError> {
    let Sensor {
        gain_e_per_dn: gain,
        read_noise_e: read,
        black_level_dn: black,
        white_level_dn: white,
        prnu_relative: prnu,
    } = *sensor;
    if !(gain > 0.0 && gain.is_finite()) {
        return Err(MergeError::Gain(gain));
    }
    if !(read >= 0.0 && read.is_finite()) {
        return Err(MergeError::ReadNoise(read));
    }
    if !(white > black && black.is_finite() && white.is_finite()) {
        return Err(MergeError::Levels { black, white });
    }
    if !(prnu >= 0.0 && prnu.is_finite()) {
        return Err(MergeError::Prnu(prnu));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
