//! `beamspot compare`

use super::print;
use crate::args::{Common, CompareArgs};
use pipeline::Result;
use pipeline::difference::compare_files;
use pipeline::rendering::{ChannelDifference, Drawn, compare_pictures};
use report::{significant, text_table};
use std::io::Write;

/// Prints how far two pictures, profiles or tables are apart.
pub(crate) fn run(args: &CompareArgs, common: Common, out: &mut impl Write) -> Result<()> {
    let CompareArgs { a, b, output } = args;
    if a.extension().is_some_and(|e| e == "csv" || e == "json") {
        return files(args, common, out);
    }
    let (found, drawn) = compare_pictures(a, b, output.as_deref(), common.force)?;
    if common.json {
        return print::json(out, &found);
    }
    print::line(out, differences_table(&found.channels))?;
    if let Some(flip) = found.flip {
        print::line(out, format!("mean HDR-FLIP {}", significant(flip, 3)))?;
    }
    let rings: Vec<Vec<String>> = found
        .rings
        .iter()
        .map(|ring| {
            let (unit, [low, high]) = match ring.radius_mm {
                Some(mm) => ("mm", mm),
                None => ("px", ring.radius_px),
            };
            vec![
                ring.channel.clone(),
                format!("{} to {} {unit}", significant(low, 3), significant(high, 3)),
                significant(ring.mean[0], 4),
                significant(ring.mean[1], 4),
                difference(ring.mean),
                sigmas(ring.z),
            ]
        })
        .collect();
    let head = ["channel", "ring", "mean A", "mean B", "A over B", "sigma"];
    print::line(out, text_table(&head, &rings).trim_end())?;
    if !found.faces.is_empty() {
        let faces: Vec<Vec<String>> = found
            .faces
            .iter()
            .map(|face| {
                let [x, y] = face.power;
                vec![
                    face.of.clone(),
                    significant(x, 4),
                    significant(y, 4),
                    difference([x, y]),
                    sigmas(face.z),
                ]
            })
            .collect();
        let head = ["face", "A, W", "B, W", "A over B", "sigma"];
        print::line(out, text_table(&head, &faces).trim_end())?;
    }
    if let Some(Drawn { full, files }) = drawn {
        let full = significant(full, 3);
        let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
        let names = names.join(", ");
        print::line(
            out,
            format!("wrote {names}: full red or blue of the first at {full}"),
        )?;
    }
    Ok(())
}

/// A difference in its standard uncertainties, where they are known.
fn sigmas(z: Option<f64>) -> String {
    z.map_or(String::new(), |z| format!("{z:+.1}"))
}

/// The first over the second, as a difference in percent.
fn difference([x, y]: [f64; 2]) -> String {
    if y == 0.0 {
        return String::new();
    }
    format!("{:+.2} %", 100.0 * (x / y - 1.0))
}

/// Two profiles or two tables.
fn files(args: &CompareArgs, common: Common, out: &mut impl Write) -> Result<()> {
    let found = compare_files(&args.a, &args.b)?;
    if let Some(output) = &args.output {
        found.draw(output, &[args.a.clone(), args.b.clone()], common.force)?;
    }
    if common.json {
        return print::json(out, &found);
    }
    let rows: Vec<Vec<String>> = found
        .pairs
        .iter()
        .map(|pair| {
            let [x, y] = pair.value;
            vec![
                pair.of.clone(),
                pair.quantity.to_owned(),
                significant(x, 4),
                significant(y, 4),
                difference(pair.value),
                sigmas(pair.z),
            ]
        })
        .collect();
    let head = ["of", "quantity", "A", "B", "A over B", "sigma"];
    print::line(out, text_table(&head, &rows).trim_end())?;
    let chi2 = found.chi2_per_pair.map_or(String::new(), |chi2| {
        format!(", chi2 {} a value", significant(chi2, 3))
    });
    print::line(
        out,
        format!("rms {:.3} %{chi2}", 100.0 * found.relative_rms),
    )?;
    if !found.unmatched.is_empty() {
        let what = found.unmatched.join(", ");
        print::line(out, format!("only in one: {what}"))?;
    }
    if let Some(output) = &args.output {
        print::line(out, format!("wrote {}", output.display()))?;
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
