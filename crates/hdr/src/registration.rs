//! Frames that moved, put back by whole pixels.
//!
//! An interpolated sample is a mean of neighbours: it has less noise than a pixel, and shares it
//! with the samples beside it, which no variance per pixel can tell. Whole pixels keep each
//! sample and its noise as they are. The at most half a pixel that is left blurs the picture by at most 1/4 px² along an
//! axis, which is little beside any beam that is wide enough to be measured.

use crate::dark::DarkFrame;
use physics::{Frame, Samples};

/// `frame` with all that it shows moved right and down by so many pixels. What comes in from
/// outside counts as saturated: it was not measured.
pub fn moved(frame: &Frame, by: [i32; 2]) -> Frame {
    let size = (frame.width, frame.height, frame.channels);
    let samples = match &frame.samples {
        Samples::U16(samples) => place(samples, size, by, Some(u16::MAX)).into(),
        Samples::F32(samples) => Samples::F32(place(samples, size, by, Some(f32::MAX))),
    };
    Frame {
        samples,
        ..frame.clone()
    }
}

impl DarkFrame {
    /// The same for the dark of a frame that is moved; at the border its own edge goes on.
    pub fn moved(&self, by: [i32; 2]) -> Self {
        let size = self.size();
        let sum = match self.sum() {
            Samples::U16(samples) => place(samples, size, by, None).into(),
            Samples::F32(samples) => Samples::F32(place(samples, size, by, None)),
        };
        self.with_sum(sum)
    }
}

fn place<T: Copy>(
    samples: &[T],
    (width, height, channels): (usize, usize, usize),
    [right, down]: [i32; 2],
    outside: Option<T>,
) -> Vec<T> {
    // Where a pixel comes from, and whether that lies in the frame.
    let from = |at: usize, by: i32, length: usize| {
        let wanted = at as i64 - i64::from(by);
        let nearest = wanted.clamp(0, length as i64 - 1);
        (nearest as usize, nearest == wanted)
    };
    let mut placed = Vec::with_capacity(samples.len());
    for row in 0..height {
        let (from_row, row_inside) = from(row, down, height);
        for column in 0..width {
            let (from_column, inside) = from(column, right, width);
            let first = (from_row * width + from_column) * channels;
            for sample in &samples[first..first + channels] {
                placed.push(match outside {
                    Some(outside) if !(inside && row_inside) => outside,
                    _ => *sample,
                });
            }
        }
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_frame_shows_moves_and_its_border_is_saturated() {
        let frame = Frame {
            width: 4,
            height: 3,
            channels: 1,
            samples: (0..12).collect::<Vec<u16>>().into(),
        };
        let right = moved(&frame, [1, 0]).samples.to_f32();
        let out = f32::from(u16::MAX);
        assert_eq!(right[..4], [out, 0.0, 1.0, 2.0]);
        let up_left = moved(&frame, [-2, -1]).samples.to_f32();
        assert_eq!(up_left[..4], [6.0, 7.0, out, out]);
        assert_eq!(up_left[8..], [out; 4]);
        assert_eq!(moved(&moved(&frame, [0, 0]), [0, 0]), frame);
        let dark = DarkFrame::new(&frame, 1.0).unwrap().moved([-2, -1]);
        assert_eq!(dark.sum().to_f32()[..4], [6.0, 7.0, 7.0, 7.0]);
        assert_eq!(dark.sum().to_f32()[8..], [10.0, 11.0, 11.0, 11.0]);
    }
}
