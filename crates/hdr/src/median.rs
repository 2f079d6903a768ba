//! The middle of many values, which outliers do not move.

use std::cmp::Ordering;

/// The upper median of values of which there is at least one; their order changes.
pub(crate) fn median<T: Copy>(values: &mut [T], order: impl FnMut(&T, &T) -> Ordering) -> T {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, order).1
}
