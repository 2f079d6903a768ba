//! What frames of different exposure say of one another: how long they really were exposed, and
//! whether the scene moved between them.
//!
//! Each frame is compared with the next longer one over the pixels that both show well. Ratios
//! multiply, and shifts add, along a run of frames each of which could be compared with the next;
//! both are then taken relative to the median frame of the run, which a few bad ones do not move.
//! Two runs say nothing of each other: were they one chain, a bad frame at the end of one would
//! move all of the other.

mod shift;

use crate::dark::{DarkFrame, check_size};
use crate::error::MergeError;
use crate::estimate::Estimate;
use crate::net::{Net, Pair, Spare};
use physics::{Frame, Sensor};
use shift::Blocks;
use std::ops::Range;

/// Share of the range from black to white below which a sample says little of a ratio, and a
/// dark that has drifted too much.
const DIM: f64 = 0.01;

/// Share of the range up to which a frame measures a pixel, for what its exposure's error does.
const MEASURED: f64 = 0.95;

/// Fewest samples that make a ratio.
const LEAST: u64 = 100;

/// Standard uncertainties beyond which a deviation is no chance.
const SURE: f64 = 5.0;

/// Relative deviation, as a root mean square over the frames, up to which nominal exposures are as
/// good as measured ones: other uncertainties of a measurement are larger.
const NEGLIGIBLE: f64 = 1e-3;

/// What two neighbouring frames say of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Measured ratio of exposures over the nominal one; `None` without enough overlap.
    pub ratio: Option<Estimate>,
    /// How far the longer frame is shifted to the right and down, px; `None` where the frames
    /// show too little.
    pub shift_px: Option<[Estimate; 2]>,
}

/// A frame as the other frames see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Exposure as stated, s.
    pub nominal_s: f64,
    /// Exposure that the overlap shows, s, on a scale on which the median frame of its run is as
    /// stated.
    pub measured_s: f64,
    /// Relative standard uncertainty of that.
    pub u_relative: f64,
    /// Shift right and down against the median frame, px, each axis by itself.
    pub shift_px: [Estimate; 2],
}

impl Placed {
    /// ln(measured/nominal).
    pub fn deviation(&self) -> f64 {
        (self.measured_s / self.nominal_s).ln()
    }

    /// Whether the exposure is off by more than `limit` and by more than chance.
    pub fn is_off(&self, limit: f64) -> bool {
        let found = self.deviation().abs();
        found > limit && found > SURE * self.u_relative
    }

    /// The length of the shift, px, where it is above `limit_px` and no chance.
    pub fn shifted(&self, limit_px: f64) -> Option<f64> {
        let [x, y] = self.shift_px;
        let length = x.value.hypot(y.value);
        (length > limit_px && length > SURE * x.u.hypot(y.u)).then_some(length)
    }
}

/// What is wrong with the stated exposures of a run of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contradiction {
    /// The frame of this number is off: most of those that it could be compared with agree.
    Frame(usize),
    /// This frame and the next contradict each other, and no majority tells which one is off.
    Pair(usize),
}

/// All frames of one scene, side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The frames, as they were added.
    pub frames: Vec<Placed>,
    /// What each says of the next: one fewer than frames.
    pub links: Vec<Link>,
}

/// Frames that arrive one by one, by increasing exposure.
#[derive(Clone, Debug)]
pub struct Overlap {
    black_dn: f64,
    white_dn: f64,
    previous: Option<Net>,
    spare: Spare,
    blocks: Option<Blocks>,
    exposures_s: Vec<f64>,
    links: Vec<Link>,
}

impl Overlap {
    /// Nothing yet, of a sensor with these levels.
    pub fn new(sensor: &Sensor) -> Self {
        Self {
            black_dn: sensor.black_level_dn,
            white_dn: sensor.white_level_dn,
            previous: None,
            spare: Spare::default(),
            blocks: None,
            exposures_s: vec![],
            links: vec![],
        }
    }

    /// Compares a frame of `exposure_s` with the one before it.
    ///
    /// # Errors
    ///
    /// As [`crate::Merge::add`].
    pub fn add(
        &mut self,
        frame: &Frame,
        dark: &DarkFrame,
        exposure_s: f64,
    ) -> Result<(), MergeError> {
        // Before its dark is looked at: the frame itself may be the one that differs.
        if let Some(previous) = &self.previous {
            check_size(frame, previous.size)?;
        }
        let mut spare = std::mem::take(&mut self.spare);
        if let Some(previous) = &mut self.previous {
            spare.take_dark(previous);
        }
        let net = Net::new(frame, dark, exposure_s, self.white_dn, spare)?;
        if let Some(previous) = self.previous.take() {
            let pair = Pair::new(&previous, &net, self.black_dn, self.white_dn)?;
            let blocks = self.blocks.get_or_insert_with(|| Blocks::new(net.size));
            blocks.clear();
            self.links
                .push(link(&pair, blocks, self.black_dn, self.white_dn));
            self.spare.take_back(previous);
        }
        self.exposures_s.push(exposure_s);
        self.previous = Some(net);
        Ok(())
    }

    /// The frames beside each other.
    pub fn finish(self) -> Comparison {
        let steps = |of: &dyn Fn(&Link) -> Option<(f64, f64)>| {
            let steps = self.links.iter().map(of);
            placed(self.exposures_s.len(), steps)
        };
        let ratios = steps(&|link| link.ratio.map(|r| (r.value.ln(), r.u / r.value)));
        let [in_x, in_y] =
            [0, 1].map(|axis| steps(&|link| link.shift_px.map(|s| (s[axis].value, s[axis].u))));
        let frames = self.exposures_s.iter().enumerate();
        let frames = frames
            .map(|(k, nominal_s)| Placed {
                nominal_s: *nominal_s,
                measured_s: nominal_s * ratios[k].value.exp(),
                u_relative: ratios[k].u,
                shift_px: [in_x[k], in_y[k]],
            })
            .collect();
        Comparison {
            frames,
            links: self.links,
        }
    }
}

/// Where each of `count` frames stands against the median of its run: from the steps between
/// neighbours, each with its standard uncertainty, that one that is not known ends a run.
fn placed(count: usize, steps: impl Iterator<Item = Option<(f64, f64)>>) -> Vec<Estimate> {
    let mut runs = vec![vec![(0.0, 0.0); count.min(1)]];
    for step in steps {
        let run = runs.last_mut().expect("there is one from the beginning");
        match (step, run.last()) {
            (Some((step, u)), Some((value, variance))) => {
                run.push((value + step, variance + u * u));
            }
            _ => runs.push(vec![(0.0, 0.0)]),
        }
    }
    let in_run = |run: Vec<(f64, f64)>| {
        let (middle, from) = median(&run);
        run.into_iter().map(move |(value, variance)| Estimate {
            value: value - middle,
            u: (variance - from).abs().sqrt(),
        })
    };
    let filled = runs.into_iter().filter(|run| !run.is_empty());
    filled.flat_map(in_run).collect()
}

/// The middle value, with the variance that the chain has there.
fn median(chain: &[(f64, f64)]) -> (f64, f64) {
    let mut sorted = chain.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (low, high) = (sorted[(sorted.len() - 1) / 2], sorted[sorted.len() / 2]);
    (0.5 * (low.0 + high.0), 0.5 * (low.1 + high.1))
}

impl Comparison {
    /// Relative standard uncertainty with which each ratio of neighbouring exposures took part in
    /// a merge: that of the overlap where measured exposures were used; where stated ones were,
    /// how far the overlap contradicts them, if it does beyond chance.
    fn u_links(&self) -> Vec<f64> {
        let measured = self.prefers_measured();
        let contradicted = self.contradicts();
        self.links
            .iter()
            .map(|link| match link.ratio {
                Some(ratio) if measured => ratio.u / ratio.value,
                Some(ratio) if contradicted => ratio.value.ln().abs(),
                _ => 0.0,
            })
            .collect()
    }

    /// Relative error that one standard uncertainty of each link leaves in the merged value of a
    /// pixel of `rate_dn_per_s`, by a sensor of `range_dn` from black to white.
    ///
    /// A pixel is measured by the frames that it does not saturate. Exposures are on the scale on
    /// which the median frame of a run is as stated, so that a link moves those of its run that are
    /// on its far side.
    pub fn relative_errors(&self, rate_dn_per_s: f64, range_dn: f64) -> Vec<f64> {
        let order: Vec<f64> = self.frames.iter().map(|f| f.deviation().abs()).collect();
        let runs = self.runs();
        let used: Vec<f64> = self
            .frames
            .iter()
            .map(|f| {
                let seen = rate_dn_per_s * f.measured_s <= MEASURED * range_dn;
                if seen { f.measured_s } else { 0.0 }
            })
            .collect();
        let time: f64 = used.iter().sum();
        self.u_links()
            .into_iter()
            .enumerate()
            .map(|(link, u)| {
                if time == 0.0 {
                    return 0.0;
                }
                // A link that was not measured is in no run, and takes part with nothing.
                let Some(run) = runs.iter().find(|r| r.contains(&link) && link + 1 < r.end) else {
                    return 0.0;
                };
                // The frame that is nearest to its own statement is the median of its run.
                let median = run.clone().min_by(|a, b| order[*a].total_cmp(&order[*b]));
                // Frames up to `link` are on the near side, those after it on the far side.
                let moved: f64 = if median <= Some(link) {
                    used[link + 1..run.end].iter().sum()
                } else {
                    -used[run.start..=link].iter().sum::<f64>()
                };
                -u * moved / time
            })
            .collect()
    }

    /// The runs of frames each of which could be compared with the next.
    fn runs(&self) -> Vec<Range<usize>> {
        let count = self.frames.len();
        let ends = self.links.iter().enumerate();
        let ends = ends.filter(|(_, link)| link.ratio.is_none());
        let mut starts = vec![0];
        starts.extend(ends.map(|(k, _)| k + 1));
        let ends = starts.iter().skip(1).copied().chain([count]);
        starts.iter().zip(ends).map(|(a, b)| *a..b).collect()
    }

    /// The frames whose exposures are off by more than `limit`, relative, and by more than chance.
    ///
    /// One is named where most of its run agree on a scale on which it is off. Where the frames
    /// are two, or fall into halves, either side of the step between them may be off.
    pub fn contradictions(&self, limit: f64) -> Vec<Contradiction> {
        let mut found = vec![];
        for run in self.runs() {
            let off = run.clone().filter(|k| self.frames[*k].is_off(limit));
            let off: Vec<usize> = off.collect();
            if !off.is_empty() && 2 * off.len() < run.len() {
                found.extend(off.into_iter().map(Contradiction::Frame));
                continue;
            }
            let steps = run.start..run.end.saturating_sub(1);
            let split = steps.filter(|k| {
                self.links[*k].ratio.is_some_and(|ratio| {
                    let step = ratio.value.ln().abs();
                    step > limit && step > SURE * ratio.u / ratio.value
                })
            });
            found.extend(split.map(Contradiction::Pair));
        }
        found
    }

    /// Whether the measured exposures are significantly better than the nominal ones.
    ///
    /// Nominal exposures are exact or off by what a shutter makes; measured ones have the noise of
    /// the overlap, which adds up along the chain. So they are worth it where χ² of the ratios is
    /// beyond chance and the deviations are larger than matters nowhere else.
    pub fn prefers_measured(&self) -> bool {
        let deviations = self.frames.iter().map(|f| f.deviation().powi(2));
        let rms = (deviations.sum::<f64>() / self.frames.len().max(1) as f64).sqrt();
        self.contradicts() && rms > NEGLIGIBLE
    }

    /// Whether the overlap contradicts the nominal exposures beyond chance, by however little.
    fn contradicts(&self) -> bool {
        let squares: Vec<f64> = self
            .links
            .iter()
            .filter_map(|l| l.ratio)
            .map(|r| (r.value.ln() / (r.u / r.value)).powi(2))
            .collect();
        let n = squares.len() as f64;
        squares.iter().sum::<f64>() > n + SURE * (2.0 * n).sqrt()
    }
}

/// Relative standard uncertainty of the ratio of radiances of two scenes whose frames were each
/// put on the scale of their median.
///
/// A shutter that is off in the same way in both drops out, so that the scatter of the
/// *difference* counts; frames of other exposures cannot be paired, and count with their own
/// scatter. A median of n has 1.25/√n of it.
pub fn u_between(a: &Comparison, b: &Comparison) -> f64 {
    let paired: Vec<(f64, f64)> = a
        .frames
        .iter()
        .filter_map(|f| {
            let other = b.frames.iter().find(|o| o.nominal_s == f.nominal_s)?;
            Some((f.deviation() - other.deviation(), 0.0))
        })
        .collect();
    let own = |c: &Comparison| {
        c.frames
            .iter()
            .map(|f| (f.deviation(), 0.0))
            .collect::<Vec<_>>()
    };
    let of_median = |deviations: &[(f64, f64)]| {
        let (middle, _) = median(deviations);
        let distances: Vec<(f64, f64)> = deviations
            .iter()
            .map(|d| ((d.0 - middle).abs(), 0.0))
            .collect();
        // 1.4826 median absolute deviations are one standard deviation of a Gaussian.
        1.25 * 1.4826 * median(&distances).0 / (deviations.len() as f64).sqrt()
    };
    if 2 * paired.len() > a.frames.len().min(b.frames.len()) {
        of_median(&paired)
    } else {
        of_median(&own(a)).hypot(of_median(&own(b)))
    }
}

/// Ratio and shift of a pair, in one pass over its samples.
fn link(pair: &Pair<'_>, blocks: &mut Blocks, black_dn: f64, white_dn: f64) -> Link {
    let mut sums = Sums::default();
    let dim = dim(black_dn, white_dn);
    pair.for_each(dim, |both| {
        sums.add(both.short, both.long);
        blocks.add(&both);
    });
    let nominal = pair.nominal_ratio();
    let ratio = sums.ratio();
    let shift_px = ratio.and_then(|r| blocks.shift(r.value, f64::from(dim)));
    Link {
        ratio: ratio.map(|r| Estimate {
            value: r.value / nominal,
            u: r.u / nominal,
        }),
        shift_px,
    }
}

/// Measured ratio of the exposures of a pair.
pub(crate) fn ratio(pair: &Pair<'_>, black_dn: f64, white_dn: f64) -> Option<f64> {
    let mut sums = Sums::default();
    let dim = dim(black_dn, white_dn);
    pair.for_each(dim, |both| sums.add(both.short, both.long));
    sums.ratio().map(|r| r.value)
}

fn dim(black_dn: f64, white_dn: f64) -> f32 {
    (DIM * (white_dn - black_dn)) as f32
}

/// What a ratio is made of.
#[derive(Default)]
struct Sums {
    samples: u64,
    short: f64,
    long: f64,
    /// Σ of short², short·long and long², for the scatter about whatever ratio comes out.
    squares: [f64; 3],
}

impl Sums {
    fn add(&mut self, short: f32, long: f32) {
        let (s, l) = (f64::from(short), f64::from(long));
        self.samples += 1;
        self.short += s;
        self.long += l;
        for (sum, term) in self.squares.iter_mut().zip([s * s, s * l, l * l]) {
            *sum += term;
        }
    }

    /// Σlong/Σshort: the maximum-likelihood ratio of Poisson counts. Its uncertainty comes from
    /// the scatter of the samples about it.
    fn ratio(&self) -> Option<Estimate> {
        if self.samples < LEAST || self.short <= 0.0 || self.long <= 0.0 {
            return None;
        }
        let value = self.long / self.short;
        let [ss, sl, ll] = self.squares;
        let scatter = (ll - 2.0 * value * sl + value * value * ss).max(0.0);
        Some(Estimate {
            value,
            u: scatter.sqrt() / self.short,
        })
    }
}

#[cfg(test)]
mod tests;
