//! `beamspot brdf`

use super::print;
use crate::args::{BrdfArgs, Common};
use pipeline::brdf::{BrdfOptions, brdf};
use pipeline::{Monitor, Result};
use report::{significant, text_table, uncertain};
use std::io::Write;

/// Computes BRDF and BTDF of layers and prints the totals of the three witnesses.
pub(crate) fn run(
    args: &BrdfArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let options = BrdfOptions {
        angles_deg: args.angle.clone(),
        photons: args.photons,
        seed: args.seed,
    };
    let result = brdf(&args.medium, &args.output, &options, common.force, monitor)?;
    if common.json {
        return print::json(out, &result);
    }
    let header = [
        "in at",
        "R adding-doubling",
        "R photons",
        "T adding-doubling",
        "T photons",
        "R, T once",
        "L_m [sr^-1]",
        "its error",
    ];
    let rows: Vec<Vec<String>> = result
        .angles
        .iter()
        .map(|a| {
            let (r, t) = (a.reflectance_monte_carlo, a.transmittance_monte_carlo);
            let pair = |p: [f64; 2]| format!("{}, {}", significant(p[0], 4), significant(p[1], 4));
            vec![
                format!("{} deg", a.angle_in_deg),
                format!("{:.6}", a.reflectance),
                uncertain(r.value, r.u),
                format!("{:.6}", a.transmittance),
                uncertain(t.value, t.u),
                pair(a.first_order),
                pair(a.constant_per_sr),
                format!(
                    "{:.1} %, {:.1} %",
                    100.0 * a.constant_error_relative[0],
                    100.0 * a.constant_error_relative[1]
                ),
            ]
        })
        .collect();
    print::line(out, text_table(&header, &rows).trim_end())?;
    print::line(out, format!("wrote {}", args.output.display()))
}
