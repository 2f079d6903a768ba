//! The beam that a fit is told of: from the white reference, or as the manifest states it.

use crate::error::Result;
use crate::fitting::{Change, Variant};
use crate::library::{self, ModelChoice};
use formats::Capture;
use formats::capture::BeamProfile;
use physics::footprint::Beam;
use physics::{Coefficients, RadialProfile, RadialSpread, ReducedMedium};
use profile::{Glow, MeasuredBeam, White, measure_beam};
use serde::Serialize;
use std::f64::consts::LN_2;

/// Standard error, px, to which rings of pixels find the width of a spot: what is left of known
/// widths in the tests of `profile::beam`.
const RINGS_PX: f64 = 0.03;

/// A white as a laboratory has it, where its manifest says nothing of it: the mean of what Jensen
/// et al. (2001) found for Spectralon.
const TYPICAL_WHITE: ReducedMedium = ReducedMedium {
    sigma_a: 0.0,
    sigma_s_prime: 14.9,
    eta: formats::capture::DEFAULT_REFERENCE_ETA,
};

/// Relative difference, on top of chance, from which a stated width contradicts the white.
const CONTRADICTS: f64 = 0.05;

/// Where a beam is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// The white reference, its own glow taken out.
    White,
    /// The white reference as an ideal surface: its glow is still in the beam.
    IdealWhite,
    /// `beam.fwhm_mm` of the manifest.
    Stated,
}

/// The beam of one channel, and what is said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenBeam {
    /// Where it is from.
    pub source: Source,
    /// The beam.
    pub beam: Beam,
    /// Its full width at half maximum, mm; measured ones with lens and pixel.
    pub fwhm_mm: f64,
    /// Standard uncertainty of the width, mm.
    pub u_fwhm_mm: f64,
    /// The width that the manifest states, mm.
    pub stated_fwhm_mm: Option<f64>,
    /// Root mean square of the white's picture over its description − 1, where it was used.
    pub misfit: Option<f64>,
    /// Standard uncertainty of the stated width for the fit, mm; 0 for a measured beam, which has
    /// `variants`.
    pub u_stated_mm: f64,
    /// The beams that are each off by one of the inputs' uncertainties.
    pub variants: Vec<Variant>,
    /// What a user should know, in sentences.
    pub warnings: Vec<String>,
}

impl ChosenBeam {
    /// What it is and how it is known.
    pub fn sentence(&self) -> String {
        let width = format!("{:.4} ± {:.4} mm", self.fwhm_mm, self.u_fwhm_mm);
        let clear = physics::Blur {
            beam: self.beam.clone(),
            pixel_mm: 0.0,
        }
        .clear_mm();
        let from = match self.source {
            Source::White => format!(
                "the beam with lens and pixels is {width} wide at half maximum, measured on the \
                 white reference with its own glow taken out; its picture is described to {:.2} %",
                100.0 * self.misfit.unwrap_or(0.0)
            ),
            Source::IdealWhite => format!(
                "the beam with lens and pixels is {width} wide at half maximum, measured on the \
                 white reference as if that were an ideal surface"
            ),
            Source::Stated if self.fwhm_mm == 0.0 => "the beam was taken as a point".to_owned(),
            Source::Stated => format!("the beam is {width} wide at half maximum, as stated"),
        };
        let stated = match (self.source, self.stated_fwhm_mm) {
            (Source::White, Some(stated)) => format!(" (beam.fwhm_mm = {stated})"),
            _ => String::new(),
        };
        format!(
            "{from}{stated}; the model was convolved with it, and radii from {clear:.2} mm on may \
             be fitted"
        )
    }
}

/// What `fit.json` says of a beam.
#[derive(Clone, Debug, Serialize)]
pub struct BeamDocument {
    source: Source,
    fwhm_mm: f64,
    u_fwhm_mm: f64,
    stated_fwhm_mm: Option<f64>,
    misfit: Option<f64>,
}

impl From<&ChosenBeam> for BeamDocument {
    fn from(chosen: &ChosenBeam) -> Self {
        Self {
            source: chosen.source,
            fwhm_mm: chosen.fwhm_mm,
            u_fwhm_mm: chosen.u_fwhm_mm,
            stated_fwhm_mm: chosen.stated_fwhm_mm,
            misfit: chosen.misfit,
        }
    }
}

/// The beam of the channel whose white reference is `white`, of the medium `known`, seen by pixels
/// of `pixel_mm`.
///
/// A white whose own coefficients are known shows the beam as the sample's camera saw it, and goes
/// before a stated width. A white that counts as an ideal surface widens the beam by its own glow,
/// and serves where no width is stated.
///
/// # Errors
///
/// The model is unknown.
pub fn choose(
    capture: &Capture,
    white: &RadialProfile,
    known: Option<&White>,
    model: &ModelChoice,
    pixel_mm: f64,
) -> Result<ChosenBeam> {
    let stated = stated(capture);
    if known.is_none()
        && let Some(stated) = stated
    {
        return Ok(stated);
    }
    let found = match known {
        Some(known) => on(white, &known.medium, model)?,
        None => measure_beam(white, None).ok(),
    };
    let Some(found) = found else {
        let no_spot = "the white reference shows no beam that could be measured".to_owned();
        return Ok(match stated {
            Some(mut stated) => {
                stated.warnings.push(no_spot);
                stated
            }
            None => ChosenBeam {
                warnings: vec![format!(
                    "{no_spot}, and beam.fwhm_mm was not given: the beam was taken as a point"
                )],
                ..of_width(Beam::Point, 0.0, 0.0)
            },
        });
    };
    let mut chosen = from_white(white, known, model, pixel_mm, found)?;
    if let Some(stated) = stated {
        compare(&mut chosen, &stated, pixel_mm);
    }
    Ok(chosen)
}

/// The spread that `white` shows if it glows as `medium`.
fn on(
    white: &RadialProfile,
    medium: &ReducedMedium,
    model: &ModelChoice,
) -> Result<Option<MeasuredBeam>> {
    let model = library::model(model, medium.eta)?;
    let at: Coefficients = medium.coefficients();
    Ok(measure_beam(white, Some(Glow { model: &*model, at })).ok())
}

fn from_white(
    white: &RadialProfile,
    known: Option<&White>,
    model: &ModelChoice,
    pixel_mm: f64,
    found: MeasuredBeam,
) -> Result<ChosenBeam> {
    let fwhm_mm = found.spread.fwhm_mm();
    let mut variants = vec![];
    let mut add = |name, weight: f64, spread: RadialSpread| {
        let change = Change::Beam(Beam::Measured(spread));
        variants.push(Variant {
            name,
            weight,
            change,
        });
    };
    let each = (found.copies.len().max(1) as f64).sqrt().recip();
    for copy in found.copies {
        add("beam: noise of the white", each, copy);
    }
    let u_rings = RINGS_PX * pixel_mm;
    let wider = found.spread.stretched(1.0 + u_rings / fwhm_mm);
    add("beam: rings of pixels", 1.0, wider);
    let others = match known {
        Some(known) => [
            (0, "beam: absorption of the white"),
            (1, "beam: glow of the white"),
        ]
        .map(|(which, name)| (name, known.off(which, 1.0).0))
        .into_iter()
        .filter(|(_, other)| *other != known.medium)
        .collect(),
        None => vec![("beam: glow of the white", TYPICAL_WHITE)],
    };
    let (mut off, mut u_glow) = (0.0, 0.0);
    for (name, other) in others {
        if let Some(otherwise) = on(white, &other, model)? {
            off = otherwise.spread.fwhm_mm() - fwhm_mm;
            u_glow = off.hypot(u_glow);
            add(name, 1.0, otherwise.spread);
        }
    }
    let mut warnings = vec![];
    if known.is_none() {
        warnings.push(format!(
            "the beam was measured on the white reference as if that were an ideal surface; if it \
             glows like Spectralon the beam is {:.3} mm narrower, and what that changes is in u: \
             give reference.sigma_s_prime_per_mm and sigma_a_per_mm, or beam.fwhm_mm",
            -off
        ));
    }
    Ok(ChosenBeam {
        source: if known.is_some() {
            Source::White
        } else {
            Source::IdealWhite
        },
        beam: Beam::Measured(found.spread),
        fwhm_mm,
        u_fwhm_mm: found.u_fwhm_mm.hypot(u_rings).hypot(u_glow),
        stated_fwhm_mm: None,
        misfit: Some(found.misfit),
        u_stated_mm: 0.0,
        variants,
        warnings,
    })
}

/// The beam of the manifest, where it has one.
fn stated(capture: &Capture) -> Option<ChosenBeam> {
    let fwhm_mm = capture.beam.fwhm_mm?;
    let beam = match capture.beam.profile {
        _ if fwhm_mm == 0.0 => Beam::Point,
        BeamProfile::Gaussian => Beam::Gaussian { fwhm_mm },
        BeamProfile::Disk => Beam::Disk { fwhm_mm },
    };
    Some(ChosenBeam {
        stated_fwhm_mm: Some(fwhm_mm),
        ..of_width(beam, fwhm_mm, capture.beam.u_fwhm_mm())
    })
}

fn of_width(beam: Beam, fwhm_mm: f64, u_fwhm_mm: f64) -> ChosenBeam {
    ChosenBeam {
        source: Source::Stated,
        beam,
        fwhm_mm,
        u_fwhm_mm,
        stated_fwhm_mm: None,
        misfit: None,
        u_stated_mm: u_fwhm_mm,
        variants: vec![],
        warnings: vec![],
    }
}

/// Names a stated width that the white contradicts.
fn compare(chosen: &mut ChosenBeam, stated: &ChosenBeam, pixel_mm: f64) {
    chosen.stated_fwhm_mm = stated.stated_fwhm_mm;
    let width = stated.fwhm_mm;
    // A disk has no half maximum to speak of: by the same measure as what was measured.
    let alone = match stated.beam {
        Beam::Disk { fwhm_mm } => {
            RadialSpread::new(vec![0.0, 0.5 * fwhm_mm], &[1.0]).map_or(fwhm_mm, |d| d.fwhm_mm())
        }
        _ => width,
    };
    let expected = alone.hypot((8.0 * LN_2 / 12.0).sqrt() * pixel_mm);
    let chance = 3.0 * chosen.u_fwhm_mm.hypot(stated.u_fwhm_mm) + CONTRADICTS * expected;
    if (chosen.fwhm_mm - expected).abs() > chance {
        chosen.warnings.push(format!(
            "the white reference shows a spot {:.3} ± {:.3} mm wide, lens and pixels included, \
             where beam.fwhm_mm = {width} lets expect {expected:.3} mm: the white was believed; \
             check the focus, or correct beam.fwhm_mm",
            chosen.fwhm_mm, chosen.u_fwhm_mm
        ));
    }
}
