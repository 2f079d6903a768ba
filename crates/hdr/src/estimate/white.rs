//! The white level, from the pile-up of saturated samples.

use super::Estimate;
use crate::dark::{check_exposure, check_frame};
use crate::error::EstimateError;
use physics::Frame;

/// Width of the window at the top in which saturated samples pile up, as a share of the level.
const WINDOW: f64 = 0.005;

/// Samples that make a pile.
const LEAST: u64 = 10;

/// How many times denser than the samples just below it a pile is.
const DENSER: f64 = 4.0;

/// Standard deviations below the middle of the pile at which samples count as saturated.
const MARGIN: f64 = 7.0;

/// By how much more than the pile a saturated pixel must have shown in the shorter frame.
const BEYOND: f64 = 1.1;

/// Share of the pile that must have shown so.
const PREDICTED: f64 = 0.1;

/// Frames that arrive one by one, by increasing exposure; those of another scene after
/// [`White::restart`].
#[derive(Clone, Debug)]
pub struct White {
    black_dn: f64,
    previous: Option<(Vec<u64>, f64)>,
    best: Option<Pile>,
}

#[derive(Clone, Copy, Debug)]
struct Pile {
    count: u64,
    level_dn: f64,
    spread_dn: f64,
}

impl White {
    /// Nothing yet, of a sensor with this black level.
    pub fn new(black_dn: f64) -> Self {
        Self {
            black_dn,
            previous: None,
            best: None,
        }
    }

    /// Another scene begins.
    pub fn restart(&mut self) {
        self.previous = None;
    }

    /// Adds a frame of `exposure_s`.
    ///
    /// # Errors
    ///
    /// The frame does not hold what its size says, or its exposure is not positive and finite.
    pub fn add(&mut self, frame: &Frame, exposure_s: f64) -> Result<(), EstimateError> {
        check_exposure(exposure_s)?;
        check_frame(frame)?;
        let mut histogram = vec![0_u64; usize::from(u16::MAX) + 1];
        for sample in super::counts(frame)? {
            histogram[usize::from(*sample)] += 1;
        }
        if let Some(pile) = Pile::at_the_top(&histogram)
            && self.saturated(&pile, exposure_s)
            && self.best.is_none_or(|best| best.count < pile.count)
        {
            self.best = Some(pile);
        }
        self.previous = Some((histogram, exposure_s));
        Ok(())
    }

    /// Whether a pile is saturation rather than an evenly lit surface: the shorter frame showed
    /// pixels that should be well beyond it. The very first frame has nothing to say of that,
    /// unless it piles up at the last code of a converter.
    fn saturated(&self, pile: &Pile, exposure_s: f64) -> bool {
        if pile.spread_dn == 0.0 && (pile.level_dn + 1.0).log2().fract() == 0.0 {
            return true;
        }
        let Some((histogram, before_s)) = &self.previous else {
            return false;
        };
        let beyond = BEYOND * (pile.level_dn - self.black_dn) * before_s / exposure_s;
        let from = (self.black_dn + beyond).ceil().max(0.0) as usize;
        let count: u64 = histogram.iter().skip(from).sum();
        count as f64 > PREDICTED * pile.count as f64
    }

    /// The count at and above which a sample is saturated, DN, or `None` where nothing piled up:
    /// then no sample is saturated, or too few to matter. Its uncertainty is the spread of the
    /// pile, which the level stays clear of.
    pub fn white_level(&self) -> Option<Estimate> {
        self.best.map(|pile| Estimate {
            value: (pile.level_dn - MARGIN * pile.spread_dn).floor(),
            u: pile.spread_dn,
        })
    }
}

impl Pile {
    /// The pile at the top of `histogram`, if there is one.
    fn at_the_top(histogram: &[u64]) -> Option<Self> {
        let top = histogram.iter().rposition(|n| *n > 0)?;
        let width = ((WINDOW * top as f64) as usize).max(4);
        let edge = top.checked_sub(3 * width)?;
        let pile = &histogram[top + 1 - width..=top];
        let count: u64 = pile.iter().sum();
        let below: u64 = histogram[edge..top + 1 - width].iter().sum();
        // The window below is twice as wide.
        let alike = 0.5 * below as f64;
        if count < LEAST || (count as f64) < DENSER * alike + 5.0 * (alike + 1.0).sqrt() {
            return None;
        }
        let at = |share: f64| {
            let wanted = (share * count as f64) as u64;
            let mut seen = 0;
            let position = pile.iter().position(|n| {
                seen += n;
                seen > wanted
            });
            (top + 1 - width + position.unwrap_or(width - 1)) as f64
        };
        let level_dn = at(0.5);
        // From the upper half alone: the lower one is mixed with bright pixels that are not
        // saturated. 84.1 % of a Gaussian lie below one standard deviation.
        let spread_dn = at(0.841) - level_dn;
        Some(Self {
            count,
            level_dn,
            spread_dn,
        })
    }
}
