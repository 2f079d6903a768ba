//! Fits a file of profiles with `fit::fit_many`, for other programs to compare with and to time.
//!
//! `fit_many INPUT OUTPUT CONSTRAINT REPEATS`, with CONSTRAINT `exact`, `joint` or `none`. All
//! numbers are little-endian f64. INPUT: n, m, η, relative u of the scale; m radii (mm); then for
//! every profile m reflectances, m standard uncertainties, the total (whole plane) and its u. The
//! range is that of the radii. OUTPUT: for every profile σₐ, its u, σₛ′, its u, the scale (NaN
//! where it could not be fitted). Prints the seconds of the fastest of REPEATS runs on one thread.

#![expect(clippy::print_stdout, reason = "an example talks to its user")]

use fit::{Constraint, FitOptions, Profiles, Totals, fit_many};
use physics::{DiffuseFresnel, DipoleModel, ProfilePoint};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, input, output, constraint, repeats] = &arguments[..] else {
        return Err("expected INPUT OUTPUT CONSTRAINT REPEATS".into());
    };
    let bytes = std::fs::read(input)?;
    let (words, _) = bytes.as_chunks::<8>();
    let mut numbers = words.iter().map(|word| f64::from_le_bytes(*word));
    let mut next = || numbers.next().ok_or("the file is too short");
    let (n, m, eta, u_scale) = (next()? as usize, next()? as usize, next()?, next()?);
    let mut points = vec![];
    for _ in 0..m {
        points.push(ProfilePoint {
            ring_mm: None,
            radius_mm: next()?,
            reflectance_per_mm2: 0.0,
            u_reflectance_per_mm2: 0.0,
            pixels: None,
        });
    }
    let [mut values, mut u, mut totals, mut u_totals] = [const { vec![] }; 4];
    for _ in 0..n {
        for _ in 0..m {
            values.push(next()?);
        }
        for _ in 0..m {
            u.push(next()?);
        }
        totals.push(next()?);
        u_totals.push(next()?);
    }
    let profiles = Profiles {
        points: &points,
        reflectance_per_mm2: &values,
        u_reflectance_per_mm2: &u,
        totals: Some(Totals {
            total_reflectance: &totals,
            u_total_reflectance: &u_totals,
            radius_max_mm: None,
        }),
    };
    let ends = points.first().zip(points.last());
    let options = FitOptions {
        constraint: match constraint.as_str() {
            "exact" => Constraint::Exact,
            "joint" => Constraint::Joint,
            "none" => Constraint::None,
            _ => return Err("the constraint is exact, joint or none".into()),
        },
        range_mm: ends.map(|(first, last)| (first.radius_mm, last.radius_mm)),
        u_scale_relative: u_scale,
        ..FitOptions::default()
    };
    let model = DipoleModel::new(eta, DiffuseFresnel::Exact);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut seconds = f64::INFINITY;
    let mut found = None;
    for _ in 0..repeats.parse::<usize>()?.max(1) {
        let start = Instant::now();
        found = Some(pool.install(|| fit_many(&profiles, &model, &options))?);
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let found = found.ok_or("no run")?;
    let mut bytes = vec![];
    for i in 0..n {
        for x in [
            found.sigma_a[i],
            found.u_sigma_a[i],
            found.sigma_s_prime[i],
            found.u_sigma_s_prime[i],
            found.scale[i],
        ] {
            bytes.extend(x.to_le_bytes());
        }
    }
    std::fs::write(output, bytes)?;
    println!("{seconds}");
    Ok(())
}
