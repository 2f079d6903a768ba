//! `beamspot sphere`

use super::print;
use crate::args::{Common, SphereArgs};
use pipeline::sphere::sphere;
use pipeline::{Monitor, Result};
use report::{at_most, significant, text_table, uncertain};
use std::io::Write;

/// Inverts the samples of an integrating sphere and prints their coefficients.
pub(crate) fn run(
    args: &SphereArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let result = sphere(&args.samples, &args.output, common.force, monitor)?;
    if common.json {
        print::json(out, &result)?;
        return result.complete();
    }
    let header = [
        "sample",
        "nm",
        "sigma_a [mm^-1]",
        "seen from",
        "sigma_s [mm^-1]",
        "g",
        "sigma_s' [mm^-1]",
        "unique",
    ];
    let rows: Vec<Vec<String>> = result
        .samples
        .iter()
        .filter_map(|sample| {
            let found = sample.found.as_ref()?;
            let (a, s) = (found.sigma_a_per_mm, found.sigma_s_per_mm);
            let absorption = if found.at_bound {
                at_most(a.ci95.1)
            } else {
                uncertain(a.value, a.u)
            };
            Some(vec![
                sample.sample.clone(),
                sample
                    .wavelength_nm
                    .map_or(String::new(), |nm| nm.to_string()),
                absorption,
                significant(found.sigma_a_detectable_per_mm, 2),
                uncertain(s.value, s.u),
                if found.g.u > 0.0 {
                    uncertain(found.g.value, found.g.u)
                } else {
                    found.g.value.to_string()
                },
                significant(found.sigma_s_prime_per_mm, 4),
                if found.unique {
                    "yes".to_owned()
                } else {
                    format!("no: {} more", found.others.len())
                },
            ])
        })
        .collect();
    print::line(out, text_table(&header, &rows).trim_end())?;
    let mut assumed: Vec<&String> = result.samples.iter().flat_map(|s| &s.assumed).collect();
    assumed.sort();
    assumed.dedup();
    for assumption in assumed {
        print::line(
            out,
            format!("assumed where nothing was stated: {assumption}"),
        )?;
    }
    print::line(out, format!("wrote {}", args.output.display()))?;
    result.complete()
}
