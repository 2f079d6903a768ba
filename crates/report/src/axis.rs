//! Scales, and where their ticks stand.

use crate::number::{fixed, power_of_ten};

/// A straight map from numbers, or from their logarithms, to the length of a panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axis {
    kind: Kind,
    low: f64,
    high: f64,
    start_px: f64,
    end_px: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Logarithmic,
    Linear,
}

/// A tick; minor ones have no label.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) at_px: f64,
    pub(crate) label: Option<String>,
}

/// Less than this would leave an axis with a single label.
const LEAST_LOG_SPAN: f64 = 4.0;
/// More than this no eye can follow, and no arithmetic.
const MOST_LOG_SPAN: f64 = 1e30;
/// Up to here 1, 2 and 5 of each decade are labelled, where that takes no power of ten.
const PLAIN_125_DECADES: f64 = 3.5;
/// And where it does.
const POWER_125_DECADES: f64 = 2.0;
const MOST_LABELS: i32 = 7;

impl Axis {
    /// A logarithmic axis over all of `values` that are above 0, and a little more.
    pub(crate) fn logarithmic(values: impl IntoIterator<Item = f64>, px: (f64, f64)) -> Self {
        let usable = values.into_iter().filter(|v| v.is_normal() && *v > 0.0);
        let (low, high) = extent(usable).unwrap_or((0.1, 10.0));
        let high = high.clamp(1e-250, 1e290);
        let low = low.max(high / MOST_LOG_SPAN);
        let missing = (LEAST_LOG_SPAN / (high / low)).max(1.0).sqrt();
        let margin = (high / low).powf(0.03).max(1.05);
        Self {
            kind: Kind::Logarithmic,
            low: low / (missing * margin),
            high: high * missing * margin,
            start_px: px.0,
            end_px: px.1,
        }
    }

    /// A linear axis from −`limit` to `limit`.
    pub(crate) fn symmetric(limit: f64, px: (f64, f64)) -> Self {
        Self {
            kind: Kind::Linear,
            low: -limit,
            high: limit,
            start_px: px.0,
            end_px: px.1,
        }
    }

    /// A linear axis from `low` to `high`.
    pub(crate) fn linear((low, high): (f64, f64), px: (f64, f64)) -> Self {
        Self {
            low,
            high,
            ..Self::symmetric(1.0, px)
        }
    }

    /// Where `value` stands; `None` if it has no place, or one far outside the panel.
    pub(crate) fn place(&self, value: f64) -> Option<f64> {
        let share = match self.kind {
            Kind::Logarithmic if value > 0.0 => {
                (value / self.low).log10() / (self.high / self.low).log10()
            }
            Kind::Logarithmic => return None,
            Kind::Linear => (value - self.low) / (self.high - self.low),
        };
        let px = self.start_px + share * (self.end_px - self.start_px);
        px.is_finite().then(|| px.clamp(-1e4, 1e4))
    }

    /// Where `value` stands, or else the nearer end.
    pub(crate) fn place_inside(&self, value: f64) -> f64 {
        let (low, high) = (
            self.start_px.min(self.end_px),
            self.start_px.max(self.end_px),
        );
        self.place(value)
            .map_or(self.start_px, |px| px.clamp(low, high))
    }

    /// What the script of the page makes new ticks of: the kind of the axis and its ends, of a
    /// logarithmic one their powers of ten.
    pub(crate) fn data(&self) -> String {
        let (kind, ends) = match self.kind {
            Kind::Logarithmic => ("log", [self.low.log10(), self.high.log10()]),
            Kind::Linear => ("linear", [self.low, self.high]),
        };
        let [low, high] = ends.map(|v| if v.is_finite() { v } else { 0.0 });
        format!("{kind} {low} {high}")
    }

    /// The ticks, by increasing value.
    pub(crate) fn ticks(&self) -> Vec<Tick> {
        match self.kind {
            Kind::Logarithmic => self.log_ticks(),
            Kind::Linear => self.linear_ticks(),
        }
    }

    fn log_ticks(&self) -> Vec<Tick> {
        let decades = (self.high / self.low).log10();
        let (first, last) = (
            self.low.log10().floor() as i32,
            self.high.log10().ceil() as i32,
        );
        let every = ((last - first) / MOST_LABELS).max(1);
        // Powers of ten, unless all labels are short as they are.
        let plain = self.low > 0.000_9 && self.high < 10_001.0 && decades < 4.5;
        let all_125 = decades
            < if plain {
                PLAIN_125_DECADES
            } else {
                POWER_125_DECADES
            };
        let mut ticks = vec![];
        for decade in first..=last {
            for digit in 1..=9 {
                let value = f64::from(digit) * 10f64.powi(decade);
                if !(self.low..=self.high).contains(&value) {
                    continue;
                }
                let main = digit == 1 && decade.rem_euclid(every) == 0;
                let between = matches!(digit, 2 | 5) && all_125;
                let label = (main || between).then(|| match (plain, digit) {
                    (true, _) => fixed(value, (-decade).max(0)),
                    (false, 1) => power_of_ten(decade),
                    (false, _) => format!("{digit}×{}", power_of_ten(decade)),
                });
                // Nine lines for each of many decades would be a grey band.
                if label.is_some() || digit == 1 || every == 1 {
                    ticks.extend(self.place(value).map(|at_px| Tick { at_px, label }));
                }
            }
        }
        ticks
    }

    fn linear_ticks(&self) -> Vec<Tick> {
        let rough = (self.high - self.low) / f64::from(MOST_LABELS);
        let decade = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0]
            .map(|m| m * decade)
            .into_iter()
            .find(|s| *s >= rough);
        let step = step.unwrap_or(10.0 * decade);
        let places = (-step.log10().floor()).max(0.0) as i32;
        // A tick at an end that rounding has moved is still there.
        let first = (self.low / step - 1e-9).ceil() as i32;
        let last = (self.high / step + 1e-9).floor() as i32;
        let tick = |i: i32| {
            let value = f64::from(i) * step;
            let label = fixed(value, places).replace('-', "−");
            self.place(value).map(|at_px| Tick {
                at_px,
                label: Some(label),
            })
        };
        (first..=last).filter_map(tick).collect()
    }
}

/// Smallest and largest of the values.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |extent, v| match extent {
        None => Some((v, v)),
        Some((low, high)) => Some((low.min(v), high.max(v))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: Axis) -> Vec<String> {
        axis.ticks().into_iter().filter_map(|t| t.label).collect()
    }

    #[test]
    fn labels_are_at_1_2_5_or_at_decades() {
        let radius = Axis::logarithmic([0.03, 20.0], (0.0, 600.0));
        assert_eq!(
            labels(radius),
            ["0.05", "0.1", "0.2", "0.5", "1", "2", "5", "10", "20"],
            "{radius:?}"
        );
        let reflectance = Axis::logarithmic([2e-6, 0.3], (300.0, 0.0));
        assert_eq!(
            labels(reflectance),
            ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]
        );
        let residual = Axis::symmetric(3.5, (100.0, 0.0));
        assert_eq!(labels(residual), ["−3", "−2", "−1", "0", "1", "2", "3"]);
    }

    #[test]
    fn every_axis_has_two_labels_and_not_too_many() {
        for (low, high) in [
            (1.0, 1.0),
            (3.1, 4.4),
            (1e-300, 1e300),
            (5e-324, 1.0),
            (1e-12, 1.0),
            (6.0, 6.1),
        ] {
            let found = labels(Axis::logarithmic([low, high, f64::NAN, -1.0], (0.0, 1.0)));
            assert!((2..=16).contains(&found.len()), "{low} {high}: {found:?}");
        }
        for limit in [3.5, 7.7, 123.0, 1e12] {
            let found = labels(Axis::symmetric(limit, (0.0, 1.0)));
            assert!((3..=9).contains(&found.len()), "{limit}: {found:?}");
        }
        assert!(labels(Axis::logarithmic([], (0.0, 1.0))).len() >= 2);
    }

    #[test]
    fn places_follow_the_logarithm() {
        let axis = Axis::logarithmic([0.1, 1.0, 10.0], (0.0, 100.0));
        assert!((axis.place(1.0).unwrap() - 50.0).abs() < 1e-12);
        assert_eq!(axis.place(0.0), None);
        assert_eq!(axis.place_inside(-3.0), 0.0);
        assert_eq!(axis.place_inside(1e9), 100.0);
    }
}
