//! `beamspot fit`

use super::print;
use crate::args::{Common, FitArgs};
use ::fit::{Constraint, Fit};
use physics::footprint::Beam;
use physics::{ObliqueBeam, RadialProfile, TotalReflectance};
use pipeline::capture::Input;
use pipeline::comparison;
use pipeline::error::Blame;
use pipeline::files::{Outputs, read, split};
use pipeline::fit_json::FitDocument;
use pipeline::fitting::{self, Given, ScaleInput};
use pipeline::library::{ModelChoice, SlabChoice};
use pipeline::{Error, Kind, Result};
use pipeline::{bootstrap, stray, unknown_g, verdict};
use std::io::Write;
use std::path::PathBuf;

/// Fits every channel of a profile.
pub(crate) fn run(args: &FitArgs, common: Common, out: &mut impl Write) -> Result<()> {
    let bytes = read(&args.profile)?;
    let place = args.profile.display().to_string();
    let profiles = formats::profile_csv::read(&bytes[..]).input(&place)?;
    let mut inputs = vec![Input::named_by_itself(&args.profile, &bytes)];
    let totals = totals(args, &mut inputs)?;
    for total in &totals {
        if !profiles.iter().any(|p| p.channel == total.channel) {
            let names: Vec<&str> = profiles.iter().map(|p| p.channel.as_str()).collect();
            let message = format!(
                "a total is given for channel {}, and {place} has {}",
                total.channel,
                names.join(", ")
            );
            return Err(Error::new(Kind::Usage, message));
        }
    }

    let mut constraint = Constraint::from(args.fit.constraint);
    let mut notes = vec![];
    if totals.is_empty() && constraint != Constraint::None {
        if constraint == Constraint::Exact {
            let message = "--constraint exact needs a total: give --total CHANNEL=R±U, or put \
                           totals.csv beside the profile";
            return Err(Error::new(Kind::Usage, message));
        }
        constraint = Constraint::None;
        notes.push(
            "no total was given, by --total or in totals.csv beside the profile: fitted without \
             (--constraint none)"
                .to_owned(),
        );
    }
    let known = known(args)?;
    let mut beams = vec![];
    if let Some(path) = &args.beam {
        let bytes = read(path)?;
        beams = formats::beam_csv::read(&bytes[..]).input(path.display())?;
        inputs.push(Input::named_by_itself(path, &bytes));
    }
    let model = if args.fit.compares() {
        known.called(&known.name)
    } else {
        known.clone()
    };
    let given = Given {
        discrepancy: args.fit.discrepancy.unwrap_or(true),
        constraint,
        free_scale: args.fit.free_scale()?,
        range_mm: args.fit.range,
        entry_loss: args.entry_loss,
        cos_beam: args.beam_angle.to_radians().cos(),
        beam: match args.beam_fwhm {
            None | Some(0.0) => Beam::Point,
            Some(fwhm_mm) => Beam::Gaussian { fwhm_mm },
        },
        pixel_mm: args.mm_per_pixel,
        ..Given::of(model, args.eta)
    };
    given.check_index()?;
    // The beam of each profile, or the radii that do without one.
    let told: Vec<(Beam, Option<(f64, f64)>)> = profiles
        .iter()
        .map(|profile| {
            if let Some((_, spread)) = beams.iter().find(|(name, _)| *name == profile.channel) {
                return (Beam::Measured(spread.clone()), given.range_mm);
            }
            let mut range_mm = given.range_mm;
            if args.beam_fwhm.is_none() && range_mm.is_none() {
                range_mm = outside_the_spot(profile);
                notes.extend(range_mm.map(|(start, _)| {
                    format!(
                        "{}: no beam was given, by --beam or --beam-fwhm: fitted from {start:.3} \
                         mm on, three times the radius at half of the maximum",
                        profile.channel
                    )
                }));
            }
            (given.beam.clone(), range_mm)
        })
        .collect();
    let total_of = |profile: &RadialProfile| totals.iter().find(|t| t.channel == profile.channel);
    let scale_of = |total: Option<&TotalReflectance>| {
        let u_scale = args
            .u_scale
            .or(total.map(|t| t.u_scale_relative))
            .unwrap_or(0.0);
        [ScaleInput {
            source: "white reference",
            u_relative: u_scale,
        }]
    };
    // `given` with the beam of one profile, and the even light that it may have or lack.
    let told_of = |given: &Given,
                   profile: &RadialProfile,
                   (beam, range_mm): &(Beam, Option<(f64, f64)>)| Given {
        beam: beam.clone(),
        range_mm: *range_mm,
        directions: total_of(profile)
            .and_then(|total| stray::stated(profile, total))
            .into_iter()
            .collect(),
        ..given.clone()
    };
    let settle_all = |given: &Given| {
        let settle_one = |(profile, told): (&RadialProfile, &_)| {
            let total = total_of(profile);
            let told = told_of(given, profile, told);
            unknown_g::settled(profile, total, &scale_of(total), &told)
                .map_err(|e| e.within(&place))
        };
        let each = profiles.iter().zip(&told);
        each.map(settle_one).collect::<Result<Vec<Given>>>()
    };
    let fit_all = |given: &[Given]| {
        let fit_one = |(profile, given): (&RadialProfile, &Given)| {
            let total = total_of(profile);
            fitting::fit_channel(profile, total, &scale_of(total), given)
                .map_err(|e| e.within(&place))
        };
        let each = profiles.iter().zip(given);
        each.map(fit_one).collect::<Result<Vec<Fit>>>()
    };
    let settled = settle_all(&given)?;
    let fits = fit_all(&settled)?;
    let (mut verdicts, mut bootstraps) = (vec![], vec![]);
    for ((profile, fit), given) in profiles.iter().zip(&fits).zip(&settled) {
        let total = total_of(profile);
        let scale = scale_of(total);
        verdicts.push(verdict::judge(profile, total, &scale, given, fit)?);
        if args.fit.bootstrap > 0 {
            let channel = bootstrap::Channel {
                profile,
                total,
                scale: &scale,
                given,
            };
            let medium = fit.coefficients();
            bootstraps.push(channel.bootstrap(medium, args.fit.bootstrap, bootstrap::SEED)?);
        }
    }
    let compared = if args.fit.compares() {
        comparison::compare(&known, &given, |given| {
            let settled = settle_all(given)?;
            let fits = fit_all(&settled)?;
            Ok(settled.into_iter().zip(fits).collect())
        })?
    } else {
        vec![]
    };

    let document = FitDocument::new(
        &fits,
        None,
        args.eta,
        &given.model.name,
        constraint,
        &inputs,
        &notes,
    )
    .with_models(&compared)
    .with_verdicts(&verdicts)
    .with_bootstraps(&bootstraps);
    if let Some(path) = &args.output {
        let (folder, name) = split(path)?;
        let paths: Vec<PathBuf> = inputs.iter().map(|i| i.path.clone()).collect();
        let outputs = Outputs::new(&folder, [&name], &paths, common.force)?;
        outputs.write(&name, |out| {
            Ok(out.write_all(document.to_json()?.as_bytes())?)
        })?;
        outputs.commit()?;
    }
    if common.json {
        print::json(out, &document)?;
        return print::strict(args.fit.strict, &print::bad_verdicts(&fits, &verdicts));
    }
    for note in &notes {
        print::line(out, note)?;
    }
    print::fits(out, &fits)?;
    print::comparison(out, &compared)?;
    print::verdicts(out, &fits, &verdicts)?;
    print::bootstraps(out, &fits, &bootstraps)?;
    print::preview(out, &fits, &profiles, common)?;
    print::strict(args.fit.strict, &print::bad_verdicts(&fits, &verdicts))
}

/// The model with what the command line knows of the sample.
fn known(args: &FitArgs) -> Result<ModelChoice> {
    let choice = ModelChoice {
        slab: args.thickness.map(|thickness_mm| SlabChoice {
            thickness_mm,
            eta_below: args.eta_below,
        }),
        beam: ObliqueBeam {
            angle: args.beam_angle.to_radians(),
            center_mm: args.center_offset,
        },
        ..args.fit.model()
    };
    if args.center_offset != 0.0 && !choice.uses_beam() && !args.fit.compares() {
        let message = format!(
            "model {} has its centre where the beam enters, got --center-offset {}: leave it out, \
             or take model directional",
            choice.name, args.center_offset
        );
        return Err(Error::new(Kind::Usage, message));
    }
    Ok(choice)
}

/// The radii of a photographed profile at which even a beam as wide as its spot is out of sight.
fn outside_the_spot(profile: &RadialProfile) -> Option<(f64, f64)> {
    let first = profile.points.first().filter(|p| p.pixels.is_some())?;
    let half = 0.5 * first.reflectance_per_mm2;
    let fallen = profile
        .points
        .iter()
        .find(|p| p.reflectance_per_mm2 < half)?;
    let last = profile.points.last()?;
    Some((
        3.0 * fallen.radius_mm,
        last.ring_mm.map_or(last.radius_mm, |r| r.1),
    ))
}

/// Totals from the command line, or from the file beside the profile.
fn totals(args: &FitArgs, inputs: &mut Vec<Input>) -> Result<Vec<TotalReflectance>> {
    if !args.total.is_empty() {
        return Ok(args
            .total
            .iter()
            .map(|t| TotalReflectance {
                channel: t.channel.clone(),
                total_reflectance: t.value,
                u_total_reflectance: t.u,
                radius_max_mm: None,
                u_scale_relative: 0.0,
                u_offset_per_mm2: 0.0,
            })
            .collect());
    }
    let path = args.profile.with_file_name("totals.csv");
    if !path.exists() {
        return Ok(vec![]);
    }
    let bytes = read(&path)?;
    let totals = formats::totals_csv::read(&bytes[..]).input(path.display())?;
    inputs.push(Input::named_by_itself(&path, &bytes));
    Ok(totals)
}
