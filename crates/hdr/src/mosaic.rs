//! What was merged photosite by photosite, colour by colour.

use crate::merge::{ChannelReport, FrameReport, MergeReport};
use crate::overlap::Comparison;
use physics::mosaic::COLOURS;
use physics::{Mosaic, RadianceMap};

/// The map and the report of a merge of [`Mosaic::folded`] frames, on the sensor's own pixels and
/// by colour.
pub fn unfolded(
    mosaic: &Mosaic,
    map: RadianceMap,
    report: &MergeReport,
) -> (RadianceMap, MergeReport) {
    let sum = |of_sites: &[u64]| -> Vec<u64> {
        let mut sums = vec![0; COLOURS.len()];
        for (colour, n) in mosaic.cell().iter().zip(of_sites) {
            sums[usize::from(*colour)] += n;
        }
        sums
    };
    let of = |number: fn(&ChannelReport) -> u64| {
        sum(&report.channels.iter().map(number).collect::<Vec<_>>())
    };
    let (hot, everywhere) = (of(|c| c.hot), of(|c| c.saturated_everywhere));
    let dead = of(|c| c.dead);
    let report = MergeReport {
        dark_dn_per_s: report.dark_dn_per_s,
        frames: report
            .frames
            .iter()
            .map(|frame| FrameReport {
                exposure_s: frame.exposure_s,
                used: sum(&frame.used),
                saturated: sum(&frame.saturated),
            })
            .collect(),
        channels: hot
            .into_iter()
            .zip(everywhere)
            .zip(dead)
            .map(|((hot, saturated_everywhere), dead)| ChannelReport {
                hot,
                dead,
                saturated_everywhere,
            })
            .collect(),
    };
    (mosaic.unfolded(map), report)
}

/// The comparison of [`Mosaic::folded`] frames, its shifts in the sensor's own pixels.
pub fn in_pixels(mosaic: &Mosaic, mut comparison: Comparison) -> Comparison {
    let side = mosaic.side() as f64;
    let of_links = comparison.links.iter_mut().flat_map(|l| &mut l.shift_px);
    let of_frames = comparison.frames.iter_mut().map(|f| &mut f.shift_px);
    for shift in of_links.chain(of_frames).flatten() {
        shift.value *= side;
        shift.u *= side;
    }
    comparison
}
