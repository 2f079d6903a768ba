//! What the manifest leaves out of the pictures: masks, regions and sectors.

use crate::capture::{Input, Loaded, Merged, Subject};
use crate::error::{Blame, Error, Kind, Result};
use crate::files;
use formats::capture::Region;
use physics::ChannelMap;
use profile::{View, find_center};

/// Share of a picture that nobody leaves out on purpose.
const MOST: f64 = 0.5;

impl Loaded {
    /// The mask and the regions of `subject`.
    pub(crate) fn left_out(&self, subject: Subject) -> (Option<&str>, &[Region]) {
        let (sample, reference) = (&self.capture.sample, &self.capture.reference);
        match subject {
            Subject::Sample => (sample.mask.as_deref(), &sample.leave_out),
            Subject::Reference => (reference.mask.as_deref(), &reference.leave_out),
        }
    }

    /// Makes what the manifest leaves out of `merged` unmeasured, and says so in its notes.
    ///
    /// # Errors
    ///
    /// The mask cannot be read, has another size, or nothing is left.
    pub(crate) fn leave_out(&self, subject: Subject, merged: &mut Merged) -> Result<()> {
        let (mask, regions) = self.left_out(subject);
        if mask.is_none() && regions.is_empty() {
            return Ok(());
        }
        let (width, height) = (merged.map.width, merged.map.height);
        let mut out: Vec<bool> = (0..width * height)
            .map(|i| {
                let (x, y) = ((i % width) as f64, (i / width) as f64);
                regions.iter().any(|region| region.contains(x, y))
            })
            .collect();
        if let Some(name) = mask {
            let path = self.folder.join(name);
            let bytes = files::read(&path)?;
            let decoded = formats::decode_frame(&bytes).input(path.display())?;
            let frame = decoded.linear(true).input(path.display())?;
            if (frame.width, frame.height) != (width, height) {
                let message = format!(
                    "{}: a mask of {} x {} pixels; expected the {width} x {height} of the frames",
                    path.display(),
                    frame.width,
                    frame.height
                );
                return Err(Error::new(Kind::Input, message));
            }
            let samples = frame.samples.to_f32();
            for (out, pixel) in out.iter_mut().zip(samples.chunks(frame.channels)) {
                *out |= pixel.iter().any(|sample| *sample > 0.0);
            }
            merged.inputs.push(Input::new(&path, name, &bytes));
        }
        let count = out.iter().filter(|out| **out).count();
        let share = count as f64 / out.len() as f64;
        let by = [
            mask.map(|name| format!("mask {name}, where it is above 0")),
            (!regions.is_empty()).then(|| format!("{} regions of leave_out", regions.len())),
        ];
        let by: Vec<String> = by.into_iter().flatten().collect();
        let by = by.join(", and ");
        if count == out.len() {
            let message = format!(
                "{}: {}: {by} leave out every pixel",
                self.input.path.display(),
                subject.field()
            );
            return Err(Error::new(Kind::Input, message));
        }
        for channel in &mut merged.map.channels {
            for (pixel, out) in out.iter().enumerate() {
                if *out {
                    channel.value[pixel] = 0.0;
                    channel.variance[pixel] = f32::INFINITY;
                }
            }
        }
        let doubt = if share > MOST {
            "; is the mask the wrong way round?"
        } else {
            ""
        };
        let percent = 100.0 * share;
        merged.notes.push(format!(
            "{count} px ({percent:.2} %) left out by {by}{doubt}"
        ));
        Ok(())
    }
}

/// `channel` with everything outside the sectors about its spot unmeasured, and the spot, which
/// has to be found while all of it is there.
///
/// # Errors
///
/// There is no spot.
pub(crate) fn within_sectors(
    channel: &ChannelMap,
    (width, height): (usize, usize),
    view: &View,
    center_px: Option<[f64; 2]>,
    sectors_deg: &[[f64; 2]],
) -> std::result::Result<(ChannelMap, [f64; 2]), profile::ProfileError> {
    let center = match center_px {
        Some(center) => center,
        None => find_center(channel, width, height)?,
    };
    let spot = view.at_mm(center);
    let mut kept = channel.clone();
    for pixel in 0..width * height {
        let [x, y] = view.at_mm([(pixel % width) as f64, (pixel / width) as f64]);
        let azimuth = (y - spot[1]).atan2(x - spot[0]).to_degrees();
        let inside = sectors_deg.iter().any(|[from, to]| {
            (azimuth - from).rem_euclid(360.0) <= (to - from).rem_euclid(360.0)
                || (to - from).abs() >= 360.0
        });
        // A photosite of another colour stays one.
        if !inside && !kept.value[pixel].is_nan() {
            kept.value[pixel] = 0.0;
            kept.variance[pixel] = f32::INFINITY;
        }
    }
    Ok((kept, center))
}

/// What a profile says of the light that was left out of it, if that is worth a sentence.
pub(crate) fn unseen_line(channel: &str, what: &str, share: f64) -> Option<String> {
    (share > 1e-3).then(|| {
        format!(
            "{what}, {channel}: {:.1} % of the light inside the circle was left out or not measured; the \
             rest of each ring stands for it, which is true of a round glow",
            100.0 * share
        )
    })
}
