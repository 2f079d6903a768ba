//! Maxima in lanes.

use physics::Samples;
use std::ops::Range;

/// The largest of `values`, or 0 where all are below. In lanes, since the compiler may not
/// reorder maxima by itself.
#[inline(always)]
pub(crate) fn largest_of(values: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 16];
    let (blocks, rest) = values.as_chunks::<16>();
    for block in blocks {
        for (lane, value) in lanes.iter_mut().zip(block) {
            *lane = if *value > *lane { *value } else { *lane };
        }
    }
    let all = lanes.iter().chain(rest);
    all.fold(0.0, |most, value| if *value > most { *value } else { most })
}

/// The largest of the samples of `range`, DN, none below 0.
#[inline(always)]
pub(crate) fn largest_sample(samples: &Samples, range: Range<usize>) -> f32 {
    match samples {
        Samples::U16(samples) => {
            let largest = samples[range].iter().fold(0, |most: u16, s| most.max(*s));
            f32::from(largest)
        }
        Samples::F32(samples) => largest_of(&samples[range]),
    }
}
