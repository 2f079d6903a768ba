//! The sum over exposures.

mod dead;
mod rows;
mod sets;

use crate::dark::{DarkFrame, check_exposure, check_frame, check_size};
use crate::error::MergeError;
use crate::hot::{HOT, Level, WARM, levels};
use physics::frame::{Rounding, channel_names};
use physics::{ChannelMap, Frame, RadianceMap, Sensor};
use rayon::prelude::*;
use rows::{Block, CHUNK, Common, Layout, Outcome, Rows, Step};
use sets::{Set, Sets};

/// Standard deviations of a full pixel that a prediction stays below the white level. Were it
/// fewer, samples would be dropped because their own noise was high, and the mean biased low: by
/// 0.3 % at one of them.
const ROOM: f64 = 5.0;

/// Share of the range from black to white up to which a sample may be predicted in any case:
/// many a sensor bends in the last few percents. Each percent of the range that is not used costs
/// 0.7 % of the standard deviation of the merged picture.
const PREDICTED_FULL: f64 = 0.95;

/// The least share, for sensors that are nothing but noise.
const LEAST_FULL: f64 = 0.5;

/// Standard deviations of a pixel's own estimate that it may lie above what its neighbours may
/// predict: a guard for spots so narrow that the neighbours say little, and far enough above that
/// noise does not reach it in a smooth picture.
const OWN_ROOM: f64 = 5.0;

/// Share of a channel's pixels that, saturated in every frame, make the merge an error.
const TOO_MANY_SATURATED: f64 = 0.5;

/// Samples by which it is judged whether a frame lies above its dark.
const LOOKED_AT: usize = 10_000;

/// Standard deviations, and share of the dark, that a sample must lie below its dark to count as
/// below: a pedestal drifts by some percent.
const BELOW: f64 = 6.0;
const DRIFT: f64 = 0.1;

/// Share of such samples from which a frame does not belong to its dark.
const TOO_MANY_BELOW: f64 = 0.25;

/// Rows that are merged in one go by one thread.
const BLOCK_ROWS: usize = 64;

/// Merges exposures that arrive one by one, by increasing exposure.
///
/// Value of a pixel: Σ(DN − dark)/Σt over the frames that measured it, in DN/s. Weighting with
/// the exposure time is within 2 % of the best possible down to 1e-5 of the peak and needs no
/// estimate of the noise.
///
/// Takes 6 bytes for each sample of a frame, however many frames there are.
#[derive(Clone, Debug)]
pub struct Merge {
    size: (usize, usize, usize),
    sensor: Sensor,
    /// Σ(DN − dark) of the used frames, DN.
    sum: Vec<f32>,
    /// Which frames were used, as a number in `sets`, of the samples of chunks that have no set in
    /// common.
    set: Vec<u16>,
    /// What the samples of each chunk of each row have in common.
    common: Vec<Common>,
    sets: Sets,
    dark: LastDark,
    /// Σt of all frames, s.
    time: f64,
    /// Σ(dark − black) of an ordinary sample, DN, all channels together.
    dark_sum: f64,
    /// How the last frame was rounded when it was stored.
    rounding: Rounding,
    /// The frames whose rounding depends on the sample.
    rounded: Vec<Rounded>,
    frames: Vec<FrameReport>,
}

/// A frame whose samples are the coarser the larger they are.
#[derive(Clone, Debug)]
struct Rounded {
    rounding: Rounding,
    /// The exposure by which it counts, s.
    measured_s: f64,
    /// Of how many frames its dark is the mean.
    darks: f64,
    /// The dark of an ordinary sample of each channel, DN.
    dark_dn: Vec<f64>,
}

impl Rounded {
    /// Variance that rounding adds to the sample of a pixel of `rate_dn_per_s`, less its dark, DN².
    fn variance(&self, channel: usize, rate_dn_per_s: f64) -> f64 {
        let dark = self.dark_dn[channel];
        let sample = dark + rate_dn_per_s * self.measured_s;
        self.rounding.variance(sample) + self.rounding.variance(dark) / self.darks
    }
}

/// What is kept of the dark of the last, longest frame.
#[derive(Clone, Debug, Default)]
struct LastDark {
    exposure_s: f64,
    /// The dark of an ordinary sample of each channel.
    levels: Vec<Level>,
    /// The samples that are out of the ordinary: where, in order, and their level, DN.
    warm: Vec<(usize, f32)>,
}

/// What one frame gave to the merge.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameReport {
    /// Its exposure, s.
    pub exposure_s: f64,
    /// Samples used, per channel.
    pub used: Vec<u64>,
    /// Samples left out as saturated or beside a saturated one, or so bright in the shorter
    /// exposures that they had to be, per channel.
    pub saturated: Vec<u64>,
}

/// What a channel lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelReport {
    /// Pixels masked for their dark current.
    pub hot: u64,
    /// Other pixels that are saturated in every frame.
    pub saturated_everywhere: u64,
    /// Pixels masked because they see nothing where all that surround them see light.
    pub dead: u64,
}

/// What was left out of a merge, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct MergeReport {
    /// The frames, as they were added.
    pub frames: Vec<FrameReport>,
    /// The channels, in the order of the camera.
    pub channels: Vec<ChannelReport>,
    /// What the darks took off an ordinary sample that every frame measured, DN/s.
    pub dark_dn_per_s: f64,
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
            set: vec![],
            common: vec![],
            sets: Sets::new(),
            dark: LastDark::default(),
            time: 0.0,
            dark_sum: 0.0,
            rounding: Rounding::default(),
            rounded: vec![],
            frames: vec![],
        })
    }

    /// The same with its sums in `memory`, say that of a picture that has served: fresh memory
    /// costs as much as a frame does.
    #[must_use]
    pub fn in_memory(mut self, memory: Vec<f32>) -> Self {
        self.sum = memory;
        self.sum.clear();
        self
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
            return Err(MergeError::DarkSize {
                dark: dark.size(),
                frame: self.size,
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
        self.check_above(frame, dark)?;
        let (width, height, channels) = self.size;
        // Only now: a size is not trusted with memory before a frame of that size has come.
        if self.frames.is_empty() {
            let count = frame.samples.len();
            self.sum.resize(count, 0.0);
            // Zeros that nobody has to write: few chunks ever need them.
            self.set = vec![0; count];
            let chunks = (frame.width * frame.channels).div_ceil(CHUNK);
            self.common = vec![Common::EMPTY; chunks * frame.height];
        }
        let rounding = frame.samples.rounding();
        self.rounding = rounding;

        let sensor = &self.sensor;
        let darks = f64::from(dark.count());
        let levels = levels(dark, channels, rounding.step_dn, |level| {
            let level = f64::from(level);
            let read = read_variance(sensor, rounding, level);
            let charge = (level - sensor.black_level_dn).max(0.0);
            (((read + charge / sensor.gain_e_per_dn) / darks).sqrt()) as f32
        });
        // What depends on the sample waits for the sum to tell how large that was.
        let (common, frames) = if rounding.half {
            let number = u16::try_from(self.rounded.len()).unwrap_or(u16::MAX);
            self.rounded.push(Rounded {
                rounding,
                measured_s,
                darks,
                dark_dn: levels.iter().map(|level| level.middle.into()).collect(),
            });
            (Rounding::default(), vec![number])
        } else {
            (rounding, vec![])
        };
        let read = read_variance(sensor, common, sensor.black_level_dn);
        let level = levels.iter().map(|level| level.mean).sum::<f64>() / channels as f64;
        let warm: Vec<f32> = levels.iter().map(|level| level.beyond(WARM)).collect();
        let tables = self.sets.extend(&Set {
            time: measured_s,
            // The dark that was subtracted has the same noise, less where several were averaged.
            read: read * (1.0 + 1.0 / darks),
            dark_time: exposure_s * (1.0 + 1.0 / darks),
            frames,
        });
        let [neighbours_limit, own_limit] = self.limits(measured_s);
        let layout = Layout {
            row: width * channels,
            channels,
            right: channels,
            down: 1,
        };
        let step = Step {
            layout,
            samples: &frame.samples,
            dark,
            tables: &tables,
            exposure: measured_s as f32,
            white: self.sensor.white_level_dn as f32,
            neighbours_limit: neighbours_limit as f32,
            own_limit: own_limit as f32,
            warm: &warm,
        };
        let outcomes = add_in_blocks(&step, &mut self.sum, &mut self.set, &mut self.common);

        let mut used = vec![0; channels];
        let mut of_set = vec![0; tables.len()];
        self.dark = LastDark {
            exposure_s,
            levels,
            warm: vec![],
        };
        for outcome in outcomes {
            for (sum, count) in used.iter_mut().zip(outcome.used) {
                *sum += count;
            }
            for (sum, count) in of_set.iter_mut().zip(outcome.of_set) {
                *sum += count;
            }
            self.dark.warm.extend(outcome.warm);
        }
        self.sets.retain(&of_set);
        self.time += measured_s;
        self.dark_sum += level - self.sensor.black_level_dn;
        let pixels = (width * height) as u64;
        self.frames.push(FrameReport {
            exposure_s,
            saturated: used.iter().map(|used| pixels - used).collect(),
            used,
        });
        Ok(())
    }

    /// Refuses a frame that lies below its dark: light adds to it.
    fn check_above(&self, frame: &Frame, dark: &DarkFrame) -> Result<(), MergeError> {
        let Sensor {
            gain_e_per_dn: gain,
            black_level_dn: black,
            ..
        } = self.sensor;
        let rounding = frame.samples.rounding();
        let darks = f64::from(dark.count());
        let count = frame.samples.len();
        // An odd step meets every channel and every row.
        let step = (count / LOOKED_AT).max(1) | 1;
        let (mut seen, mut below) = (0_u32, 0_u32);
        let (mut sample, mut level) = ([0.0_f32], [0.0_f32]);
        for at in (0..count).step_by(step) {
            frame.samples.copy_to(at..at + 1, &mut sample);
            dark.copy_mean_to(at..at + 1, &mut level);
            let (sample, level) = (f64::from(sample[0]), f64::from(level[0]));
            let read = read_variance(&self.sensor, rounding, level);
            let variance = (read + (level - black).max(0.0) / gain) * (1.0 + 1.0 / darks);
            let limit = BELOW * variance.sqrt() + DRIFT * level.abs();
            seen += 1;
            below += u32::from(sample - level < -limit);
        }
        let share = f64::from(below) / f64::from(seen.max(1));
        if share > TOO_MANY_BELOW {
            return Err(MergeError::BelowDark { share });
        }
        Ok(())
    }

    /// The most that the neighbours, and a sample's own estimate, may let expect of a sample of
    /// the next frame, DN.
    fn limits(&self, exposure_s: f64) -> [f64; 2] {
        let Sensor {
            gain_e_per_dn: gain,
            white_level_dn: white,
            black_level_dn: black,
            prnu_relative: prnu,
            ..
        } = self.sensor;
        let span = white - black;
        let read = read_variance(&self.sensor, self.rounding, white);
        let full = read + span / gain + (prnu * span).powi(2);
        // What the frames so far say of a full pixel has the noise of their light.
        let own = if self.time > 0.0 {
            span / gain * exposure_s / self.time
        } else {
            0.0
        };
        let room = ROOM * (full + own / 8.0).sqrt();
        let share = (1.0 - room / span).clamp(LEAST_FULL, PREDICTED_FULL);
        let limit = black + share * span;
        [limit, limit + OWN_ROOM * own.sqrt()]
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
        let noise = Noise::new(&self);
        let Self {
            mut sum,
            mut set,
            common,
            dark,
            rounded,
            frames,
            time,
            dark_sum,
            ..
        } = self;

        let row = width * channels;
        if channels > 1 {
            // Taken apart, no chunk is left.
            for (set, common) in in_chunks(&mut set, &common, row) {
                if let Some(number) = common.set {
                    set.fill(number);
                }
            }
        }
        let mut maps = Vec::with_capacity(channels);
        let mut reports = Vec::with_capacity(channels);
        for (channel, name) in channel_names(channels).iter().enumerate() {
            // The only channel is where its values will be; more of them are taken apart.
            let (mut value, set) = if channels == 1 {
                (std::mem::take(&mut sum), std::mem::take(&mut set))
            } else {
                (
                    of_channel(&sum, channel, channels),
                    of_channel(&set, channel, channels),
                )
            };
            let mut variance = vec![0.0; value.len()];
            let of_channel = noise.of_channel(channel);
            let measured = if channels == 1 {
                let rows = value.par_chunks_mut(row).zip(variance.par_chunks_mut(row));
                let numbers = set
                    .par_chunks(row)
                    .zip(common.par_chunks(row.div_ceil(CHUNK)));
                rows.zip(numbers)
                    .map(|((value, variance), (set, common))| {
                        of_channel.apply_to_row(value, variance, set, common)
                    })
                    .sum()
            } else {
                of_channel.apply(&mut value, &mut variance, &set)
            };
            let number = |at: usize| {
                let chunk = at / row * row.div_ceil(CHUNK) + at % row / CHUNK;
                let common = common[chunk].set.filter(|_| channels == 1);
                usize::from(common.unwrap_or(set[at]))
            };
            if !rounded.is_empty() {
                let pixels = value.par_iter().zip(&mut variance).enumerate();
                pixels.for_each(|(at, (value, variance))| {
                    *variance += noise.of_rounding(&rounded, channel, *value, number(at)) as f32;
                });
            }
            let mut report = ChannelReport {
                hot: 0,
                saturated_everywhere: (value.len() - measured) as u64,
                dead: 0,
            };
            for (at, level) in dark.warm.iter().filter(|warm| warm.0 % channels == channel) {
                let at = at / channels;
                let of_set = &noise.sets[number(at)];
                if *level > dark.levels[channel].beyond(HOT) {
                    report.hot += 1;
                    report.saturated_everywhere -= u64::from(of_set.time == 0.0);
                    value[at] = 0.0;
                    variance[at] = f32::INFINITY;
                } else {
                    let excess = f64::from(level - dark.levels[channel].middle);
                    variance[at] += noise.of_charge(excess, of_set) as f32;
                }
            }
            for at in dead::find(&value, &variance, width) {
                report.dead += 1;
                value[at] = 0.0;
                variance[at] = f32::INFINITY;
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
                mosaic: None,
            },
            MergeReport {
                frames,
                channels: reports,
                dark_dn_per_s: dark_sum / time,
            },
        ))
    }
}

/// Adds a frame to all rows, on as many threads as there are.
fn add_in_blocks(
    step: &Step<'_>,
    sum: &mut [f32],
    set: &mut [u16],
    common: &mut [Common],
) -> Vec<Outcome> {
    let Layout { row, down, .. } = step.layout;
    let (height, chunks) = (sum.len() / row, row.div_ceil(CHUNK));
    // A block changes rows that its neighbours look at: each takes them as they were.
    let edges: Vec<[Edge; 2]> = (0..height)
        .step_by(BLOCK_ROWS)
        .map(|start| {
            let end = (start + BLOCK_ROWS).min(height);
            let copy = |from: usize, to: usize| Edge {
                sum: sum[from * row..to * row].to_vec(),
                set: set[from * row..to * row].to_vec(),
                common: common[from * chunks..to * chunks].to_vec(),
            };
            [
                copy(start.saturating_sub(down), start),
                copy(end, (end + down).min(height)),
            ]
        })
        .collect();
    let blocks = sum
        .par_chunks_mut(BLOCK_ROWS * row)
        .zip(set.par_chunks_mut(BLOCK_ROWS * row))
        .zip(common.par_chunks_mut(BLOCK_ROWS * chunks));
    blocks
        .zip(&edges)
        .enumerate()
        .map(|(number, (((sum, set), common), [above, below]))| {
            pulp::Arch::new().dispatch(Block {
                step,
                first: number * BLOCK_ROWS,
                sum,
                set,
                common,
                above: above.rows(),
                below: below.rows(),
            })
        })
        .collect()
}

/// Rows beside a block.
struct Edge {
    sum: Vec<f32>,
    set: Vec<u16>,
    common: Vec<Common>,
}

impl Edge {
    fn rows(&self) -> Option<Rows<'_>> {
        (!self.sum.is_empty()).then_some(Rows {
            sum: &self.sum,
            set: &self.set,
            common: &self.common,
        })
    }
}

/// The chunks of samples in rows of `row`, each with what they have in common.
fn in_chunks<'a, T>(
    samples: &'a mut [T],
    common: &'a [Common],
    row: usize,
) -> impl Iterator<Item = (&'a mut [T], &'a Common)> {
    let chunks = samples
        .chunks_mut(row)
        .flat_map(|row| row.chunks_mut(CHUNK));
    chunks.zip(common)
}

fn of_channel<T: Copy>(samples: &[T], channel: usize, channels: usize) -> Vec<T> {
    let own = samples.iter().skip(channel).step_by(channels);
    own.copied().collect()
}

/// The variance of merged values.
///
/// A pixel's dark current is taken from the dark of the longest frame: the ordinary one of its
/// channel, or its own where that stands out. A single dark tells less of an ordinary pixel than
/// all of them together do, and an offset of the pixel, which has no noise, would be counted as
/// charge in every frame.
struct Noise {
    sets: Vec<Set>,
    per_electron: f64,
    prnu_relative: f64,
    read: f64,
    /// Ordinary dark current of each channel, DN/s.
    current: Vec<f64>,
    dark_exposure_s: f64,
}

impl Noise {
    fn new(merge: &Merge) -> Self {
        let LastDark {
            exposure_s, levels, ..
        } = &merge.dark;
        let black = merge.sensor.black_level_dn;
        Self {
            sets: merge.sets.list().to_vec(),
            per_electron: 1.0 / merge.sensor.gain_e_per_dn,
            prnu_relative: merge.sensor.prnu_relative,
            read: read_variance(&merge.sensor, merge.rounding, black),
            current: levels
                .iter()
                .map(|level| (f64::from(level.middle) - black).max(0.0) / exposure_s)
                .collect(),
            dark_exposure_s: *exposure_s,
        }
    }

    /// Variance that a dark of `excess` DN more than ordinary adds to a mean over `set`.
    fn of_charge(&self, excess: f64, set: &Set) -> f64 {
        if set.time == 0.0 {
            return 0.0;
        }
        let charge = excess / self.dark_exposure_s * set.dark_time;
        charge * self.per_electron / (set.time * set.time)
    }

    /// Variance that the rounding of frames which are coarser for larger samples adds to a mean of
    /// `rate_dn_per_s` over the set of this number.
    fn of_rounding(
        &self,
        rounded: &[Rounded],
        channel: usize,
        rate_dn_per_s: f32,
        number: usize,
    ) -> f64 {
        let set = &self.sets[number];
        if set.time == 0.0 {
            return 0.0;
        }
        let frames = set.frames.iter().map(|k| &rounded[usize::from(*k)]);
        let sum: f64 = frames
            .map(|frame| frame.variance(channel, rate_dn_per_s.into()))
            .sum();
        sum / (set.time * set.time)
    }

    fn of_channel(&self, channel: usize) -> ChannelNoise {
        let current = self.current[channel];
        let of_set = |set: &Set| OfSet {
            per_time: if set.time > 0.0 {
                (1.0 / set.time) as f32
            } else {
                0.0
            },
            floor: (set.read + current * set.dark_time * self.per_electron) as f32,
        };
        ChannelNoise {
            sets: self.sets.iter().map(of_set).collect(),
            per_electron: self.per_electron as f32,
            prnu: (self.prnu_relative * self.prnu_relative) as f32,
            read: self.read as f32,
        }
    }
}

/// What turns sums of one channel into means and variances.
struct ChannelNoise {
    sets: Vec<OfSet>,
    per_electron: f32,
    prnu: f32,
    /// Variance of one read-out, DN²: the least noise that any pixel has.
    read: f32,
}

#[derive(Clone, Copy)]
struct OfSet {
    /// 1/Σt, 1/s; 0 for the empty set.
    per_time: f32,
    /// Variance without light, DN².
    floor: f32,
}

impl ChannelNoise {
    /// Turns each sum of `value` into the mean, fills `variance`, and counts what was measured.
    fn apply(&self, value: &mut [f32], variance: &mut [f32], set: &[u16]) -> usize {
        const BLOCK: usize = 1 << 16;
        let blocks = value
            .par_chunks_mut(BLOCK)
            .zip(variance.par_chunks_mut(BLOCK));
        blocks
            .zip(set.par_chunks(BLOCK))
            .map(|((value, variance), set)| self.apply_each(value, variance, set))
            .sum()
    }

    /// The same for a row whose chunks may have a set in common.
    fn apply_to_row(
        &self,
        value: &mut [f32],
        variance: &mut [f32],
        set: &[u16],
        common: &[Common],
    ) -> usize {
        let rows = value.chunks_mut(CHUNK).zip(variance.chunks_mut(CHUNK));
        let chunks = rows.zip(set.chunks(CHUNK).zip(common));
        chunks
            .map(|((value, variance), (set, common))| match common.set {
                None => self.apply_each(value, variance, set),
                Some(number) => {
                    let set = self.sets[usize::from(number)];
                    if set.per_time == 0.0 {
                        value.fill(0.0);
                        variance.fill(f32::INFINITY);
                        return 0;
                    }
                    for (value, variance) in value.iter_mut().zip(variance) {
                        [*value, *variance] = self.mean(*value, set);
                    }
                    value.len()
                }
            })
            .sum()
    }

    fn apply_each(&self, value: &mut [f32], variance: &mut [f32], set: &[u16]) -> usize {
        let mut measured = 0;
        for ((value, variance), set) in value.iter_mut().zip(variance).zip(set) {
            let set = self.sets[usize::from(*set)];
            if set.per_time == 0.0 {
                [*value, *variance] = [0.0, f32::INFINITY];
                continue;
            }
            measured += 1;
            [*value, *variance] = self.mean(*value, set);
        }
        measured
    }

    /// Mean and variance of a sum over `set`.
    #[inline(always)]
    fn mean(&self, sum: f32, OfSet { per_time, floor }: OfSet) -> [f32; 2] {
        // The sum itself stands for its expectation, below zero too: clipped there, the variances
        // of a dark region would be too large on average.
        let counted = (floor + sum * self.per_electron).max(self.read);
        let mean = sum * per_time;
        let variance = counted * per_time * per_time + self.prnu * mean * mean;
        [mean, variance]
    }
}

/// Variance of one read-out without the light's own, with that of rounding at `level_dn`, DN².
fn read_variance(sensor: &Sensor, rounding: Rounding, level_dn: f64) -> f64 {
    (sensor.read_noise_e / sensor.gain_e_per_dn).powi(2) + rounding.variance(level_dn)
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
