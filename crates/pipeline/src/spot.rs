//! Centre and width of a beam: of a single frame, or of the spot on a capture's white reference.

use crate::capture::{Input, Loaded, Subject, Workspace};
use crate::error::{Blame, Error, Kind, Result};
use crate::files;
use crate::monitor::Monitor;
use crate::reading::read_frame;
use physics::frame::channel_names;
use physics::{ChannelMap, Frame, RadianceMap};
use profile::{Background, BeamMoments, beam_moments};
use std::path::Path;

/// The beam in one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Spot {
    /// Name of the channel.
    pub channel: String,
    /// What its moments say.
    pub moments: BeamMoments,
    /// What was taken for background. With [`Background::Threshold`], that is of a single frame,
    /// the noise of its pixels is not known, and no uncertainty either.
    pub background: Background,
}

/// The beam in each channel of the frame `path`, whose counts are taken as they are.
///
/// # Errors
///
/// The frame cannot be read, or shows no spot.
pub fn of_frame(path: &Path) -> Result<(Vec<Spot>, Input)> {
    let bytes = files::read(path)?;
    let (decoded, _) = read_frame(&bytes, path, vec![])?;
    let mosaic = decoded.mosaic;
    let frame = decoded.linear(true).input(path.display())?;
    let map = match mosaic {
        Some(mosaic) => mosaic.unfolded(map_of(&mosaic.folded(&frame))),
        None => map_of(&frame),
    };
    let spots = in_map(&map, Background::Threshold).map_err(|e| e.within(path.display()))?;
    Ok((spots, Input::named_by_itself(path, &bytes)))
}

/// The beam on the white reference of a capture, its exposures merged.
///
/// # Errors
///
/// See [`Loaded::merge`]; the reference must show a spot.
pub fn of_reference(loaded: &Loaded, monitor: &dyn Monitor) -> Result<Vec<Spot>> {
    let loaded = &*loaded.with_response(monitor)?;
    let sensor = loaded.sensing(monitor)?.sensor;
    monitor.begin("merging", loaded.frame_count(Subject::Reference));
    let merged = loaded.merge(
        Subject::Reference,
        &sensor,
        &mut Workspace::default(),
        monitor,
    )?;
    let place = || format!("{}: reference", loaded.input.path.display());
    in_map(&merged.map, Background::Surroundings).map_err(|e| e.within(place()))
}

fn in_map(map: &RadianceMap, background: Background) -> Result<Vec<Spot>> {
    let spot = |channel: &ChannelMap| {
        let moments = beam_moments(channel, map.width, map.height, background)
            .map_err(|e| Error::new(Kind::Input, format!("channel {}: {e}", channel.name)))?;
        Ok(Spot {
            channel: channel.name.clone(),
            moments,
            background,
        })
    };
    (0..map.names().len())
        .map(|index| spot(&map.channel(index)))
        .collect()
}

/// A single frame as a picture. Its variance, the same everywhere, is what neighbours in a row
/// differ by: enough to tell a spot from noise.
fn map_of(frame: &Frame) -> RadianceMap {
    let samples = frame.samples.to_f32();
    let rounding = frame.samples.rounding();
    let channels = channel_names(frame.channels)
        .iter()
        .enumerate()
        .map(|(index, name)| {
            let value: Vec<f32> = samples
                .iter()
                .skip(index)
                .step_by(frame.channels)
                .copied()
                .collect();
            let mut steps: Vec<f32> = value
                .chunks_exact(frame.width)
                .flat_map(|row| row.windows(2).map(|pair| (pair[1] - pair[0]).abs()))
                .collect();
            let middle = steps.len() / 2;
            let median = if steps.is_empty() {
                0.0
            } else {
                *steps.select_nth_unstable_by(middle, f32::total_cmp).1
            };
            // A difference has √2 of the noise, and 1.4826 medians are a standard deviation; what
            // was rounded away comes on top, that of `f32` at the least.
            let deviation = 1.4826 * median / std::f32::consts::SQRT_2;
            let largest = value.iter().fold(0.0_f32, |most, v| most.max(v.abs()));
            let finest = (largest * f32::EPSILON)
                .max(f32::MIN_POSITIVE.sqrt())
                .powi(2);
            let rounded = rounding.variance(f64::from(largest)) as f32;
            let variance = deviation * deviation + rounded.max(finest);
            ChannelMap {
                name: (*name).to_owned(),
                variance: vec![variance; value.len()],
                value,
            }
        })
        .collect();
    RadianceMap {
        width: frame.width,
        height: frame.height,
        channels,
        mosaic: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Samples;

    /// Counts, and the same as shares of the largest: one beam.
    #[test]
    fn a_beam_is_as_wide_in_any_unit() {
        let side = 80;
        let counts: Vec<f32> = (0..side * side)
            .map(|i| {
                let [x, y] = [i % side, i / side].map(|c| c as f32 - 39.3);
                // A little unevenness, as no beam is without.
                let uneven = ((i * 7919) % 13) as f32 - 6.0;
                (100.0 + 400.0 * (-(x * x + y * y) / 72.0).exp() + uneven).round()
            })
            .collect();
        let width = |samples: Samples| {
            let frame = Frame {
                width: side,
                height: side,
                channels: 1,
                samples,
            };
            let spots = in_map(&map_of(&frame), Background::Threshold).unwrap();
            spots[0].moments.d4sigma_px[0]
        };
        let whole: Vec<u16> = counts.iter().map(|count| *count as u16).collect();
        let shares = counts.iter().map(|count| count / 65_535.0).collect();
        let (whole, shares) = (width(whole.into()), width(Samples::F32(shares)));
        assert!((shares / whole - 1.0).abs() < 1e-4, "{shares} for {whole}");
    }
}
