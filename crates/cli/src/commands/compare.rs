//! `beamspot compare`

use super::print;
use crate::args::{Common, CompareArgs};
use pipeline::Result;
use pipeline::rendering::{ChannelDifference, compare_pictures};
use report::{significant, text_table};
use std::io::Write;

/// Prints how far two pictures are apart.
pub(crate) fn run(args: &CompareArgs, common: Common, out: &mut impl Write) -> Result<()> {
    let CompareArgs { a, b, output } = args;
    let (found, full) = compare_pictures(a, b, output.as_deref(), common.force)?;
    if common.json {
        return print::json(out, &found);
    }
    print::line(out, differences_table(&found))?;
    if let (Some(output), Some(full)) = (output, full) {
        let full = significant(full, 3);
        print::line(
            out,
            format!("wrote {}: full red or blue at {full}", output.display()),
        )?;
    }
    Ok(())
}

/// One row a channel.
pub(crate) fn differences_table(found: &[ChannelDifference]) -> String {
    let percent = |x: f64| format!("{} %", significant(100.0 * x, 3));
    let rows: Vec<Vec<String>> = found
        .iter()
        .map(|d| {
            vec![
                d.channel.clone(),
                significant(d.mean[0], 3),
                significant(d.mean[1], 3),
                significant(d.rmse, 3),
                percent(d.relative_rmse),
                percent(d.relative_beyond_noise),
                d.median_relative_by_block.map_or(String::new(), percent),
                d.chi2_per_pixel
                    .map_or(String::new(), |x| significant(x, 3)),
            ]
        })
        .collect();
    let head = [
        "channel",
        "mean A",
        "mean B",
        "rmse",
        "of mean B",
        "beyond noise",
        "median 4x4",
        "chi2/pixel",
    ];
    text_table(&head, &rows).trim_end().to_owned()
}
