//! Stray light in the picture of the sample, and what darks leave in it.

use fit::{Direction, DirectionKind, Fit};
use physics::{RadialProfile, TotalReflectance};
use profile::{Measured, Scale};
use serde::Serialize;
use std::f64::consts::PI;

/// The lines of a budget that they become.
const STRAY: &str = "stray light";
const DARK: &str = "dark residual";

/// Relative standard uncertainty with which the share of stray light that the white shows holds
/// for the sample: a lens spreads light by where it falls, and part of the sample's falls outside
/// the picture.
const TRANSFER: f64 = 0.1;

/// Share of the last radius' light that stray light may be before it is named, where the sample's
/// own light fills the picture; and its uncertainty where it could only be bounded.
const NAMED: f64 = 0.05;

/// Standard uncertainties from which stray light is seen.
const SEEN: f64 = 3.0;

/// Share of a medium's light beyond the picture from which it fills it.
const FILLS: f64 = 0.01;

/// Light that lens and housing spread evenly over the picture of the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Veil {
    /// What every pixel has of it, in the unit of the picture; it was subtracted.
    pub offset: f64,
    /// Standard uncertainty of the offset.
    pub u: f64,
    /// The same as a share of the picture's other light, as the white reference shows it.
    pub share: f64,
    /// Standard uncertainty of the share on the white, what its coefficients leave open included.
    pub u_share: f64,
    /// Whether the white shows it; otherwise it could only be bounded, and nothing was subtracted.
    pub measured: bool,
    /// Standard uncertainty, in the unit of the picture, of what darks leave of themselves: as far
    /// as those of sample and reference differ.
    pub u_dark: f64,
    /// Change of the offset, in the unit of the picture, for each of the white's coefficients off by
    /// its standard uncertainty; `u` leaves it out.
    pub by_white: [f64; 2],
}

/// What `fit.json` says of stray light.
#[derive(Clone, Debug, Serialize)]
pub struct VeilDocument {
    source: &'static str,
    offset_per_mm2: f64,
    u_offset_per_mm2: f64,
    share: f64,
    u_share: f64,
    u_dark_per_mm2: f64,
    u_white_per_mm2: f64,
}

impl From<&Veil> for VeilDocument {
    fn from(veil: &Veil) -> Self {
        Self {
            source: if veil.measured { "white" } else { "bound" },
            offset_per_mm2: veil.offset,
            u_offset_per_mm2: veil.u,
            share: veil.share,
            u_share: veil.u_share,
            u_dark_per_mm2: veil.u_dark,
            u_white_per_mm2: veil.u_white(),
        }
    }
}

/// An even light of `u` per mm², which every point of `profile` has or lacks and `total` with them.
fn even(
    source: &'static str,
    u: f64,
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
) -> Option<Direction> {
    let radius = total.and_then(|t| t.radius_max_mm).unwrap_or(0.0);
    (u > 0.0).then(|| Direction {
        source,
        kind: DirectionKind::Absolute,
        profile: vec![u; profile.points.len()],
        total: u * PI * radius * radius,
    })
}

/// What a total that was read from a file says of the even light that it shares with `profile`.
pub fn stated(profile: &RadialProfile, total: &TotalReflectance) -> Option<Direction> {
    even(STRAY, total.u_offset_per_mm2, profile, Some(total))
}

impl Veil {
    /// The stray light of a sample whose picture has the mean `mean`, in the unit of `scale`'s own
    /// picture of the white, and whose darks leave `u_dark`.
    pub(crate) fn of(mean: f64, scale: &Scale, u_dark: f64) -> Self {
        let Some(stray) = scale.stray else {
            return Self {
                offset: 0.0,
                u: 0.0,
                share: 0.0,
                u_share: 0.0,
                measured: false,
                u_dark,
                by_white: [0.0; 2],
            };
        };
        let direct = mean.max(0.0) / (1.0 + stray.share);
        // Of the light that is there, what one share more takes from the other.
        let per_share = direct / (1.0 + stray.share);
        Self {
            offset: stray.share * direct,
            u: direct * stray.u_share.hypot(TRANSFER * stray.share),
            share: stray.share,
            u_share: scale
                .by_white
                .iter()
                .fold(stray.u_share, |u: f64, off| u.hypot(off.stray_share)),
            measured: stray.measured,
            u_dark,
            by_white: scale.by_white.map(|off| per_share * off.stray_share),
        }
    }

    /// The same in a unit that is `factor` of the present one.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self {
            offset: factor * self.offset,
            u: factor * self.u,
            u_dark: factor * self.u_dark,
            by_white: self.by_white.map(|offset| factor * offset),
            ..self
        }
    }

    /// The ways in which it and the darks may be off, for a fit that finds out how far.
    pub(crate) fn directions(&self, measured: &Measured) -> Vec<Direction> {
        let (profile, total) = (&measured.profile, Some(&measured.total));
        [(STRAY, self.u), (DARK, self.u_dark)]
            .into_iter()
            .filter_map(|(source, u)| even(source, u, profile, total))
            .collect()
    }

    /// The ways in which profile and total are off where a coefficient of the white is, which sets
    /// their `scale` and tells its glow from stray light.
    pub(crate) fn of_white(&self, scale: &Scale, measured: &Measured) -> Vec<Direction> {
        let radius = measured.total.radius_max_mm.unwrap_or(0.0);
        let area = PI * radius * radius;
        let each = scale.by_white.iter().zip(self.by_white);
        each.map(|(off, offset)| {
            let changed = |light: f64, area: f64| off.factor_relative * light - offset * area;
            let points = measured.profile.points.iter();
            Direction {
                source: off.source,
                kind: DirectionKind::Absolute,
                profile: points
                    .map(|p| changed(p.reflectance_per_mm2, 1.0))
                    .collect(),
                total: changed(measured.total.total_reflectance, area),
            }
        })
        .collect()
    }

    /// Standard uncertainty of stray light and darks together.
    pub(crate) fn u_offset(&self) -> f64 {
        self.u_all().hypot(self.u_dark)
    }

    /// Standard uncertainty of stray light with what the white's coefficients leave open.
    fn u_all(&self) -> f64 {
        self.u.hypot(self.u_white())
    }

    fn u_white(&self) -> f64 {
        self.by_white[0].hypot(self.by_white[1])
    }

    /// What it is and how it is known.
    pub(crate) fn sentence(&self) -> String {
        let percent = |share: f64| format!("{:.4} %", 100.0 * share);
        if self.measured && self.share.abs() < SEEN * self.u_share {
            format!(
                "no stray light is seen in the far field of the white reference, {} ± {} of the \
                 picture's light; the fit holds {:.1e} mm^-2 for it",
                percent(self.share),
                percent(self.u_share),
                self.u_all()
            )
        } else if self.measured {
            format!(
                "stray light, spread evenly over the picture, is {} ± {} of its light, as the far \
                 field of the white reference shows; {:.2e} mm^-2 was subtracted, ± {:.1e} before \
                 the fit weighs it",
                percent(self.share),
                percent(self.u_share),
                self.offset,
                self.u_all()
            )
        } else {
            format!(
                "stray light could only be bounded, since the picture of the white reference ends \
                 near its spot or the white absorbs: nothing was subtracted, and u holds {} of the \
                 picture's light, {:.1e} mm^-2",
                percent(self.u_share),
                self.u_all()
            )
        }
    }

    /// What a user should know of it.
    pub(crate) fn warning(&self, fit: &Fit, profile: &RadialProfile) -> Option<String> {
        let last = profile.points.last()?.reflectance_per_mm2;
        let part = |light: f64| light / (last + self.offset).max(f64::MIN_POSITIVE);
        if !self.measured {
            let known = part(self.u_all()) < NAMED;
            return (!known).then(|| self.sentence());
        }
        (fit.share_outside > FILLS && part(self.offset) > NAMED).then(|| {
            format!(
                "the sample's light fills the picture, so that stray light, {:.0} % of what is seen \
                 at the last radius, is known by the white reference alone: u of the coefficients \
                 holds a tenth of it; a wider field of view would show it",
                100.0 * part(self.offset)
            )
        })
    }
}
