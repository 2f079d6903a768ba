//! Profiles in another unit: their shape is a medium's, and their light a power of ten off.

use crate::problem::Light;
use crate::result::{Fit, Warning};
use physics::RadialProfile;

/// Powers of ten that a unit makes: cm for mm in a length is two of them, since light is per area.
const POWERS: [i32; 4] = [-2, -1, 1, 2];
/// χ² per degree of freedom from which a fit is bad enough to ask.
const BAD: f64 = 9.0;
/// Share of it that may be left where the profile is in the other unit.
const CURED: f64 = 0.1;

fn is_scale_off(warning: &Warning) -> bool {
    matches!(warning, Warning::ScaleOff { .. })
}

/// Whether a fit is bad enough for [`another_unit`] to be asked at all.
pub fn doubts_unit<'a>(reduced_chi2: f64, warnings: impl IntoIterator<Item = &'a Warning>) -> bool {
    reduced_chi2 >= BAD || warnings.into_iter().any(is_scale_off)
}

/// Whether a profile whose fit `found` is bad would be well fitted were its light a power of ten
/// more or less, as it is where its radii or its values are in another unit.
///
/// `fitted` fits as `found` was found, each reflectance times a factor. Too much light to be true
/// is refused by [`crate::fit`] itself; too little can be, and is told from another unit by its
/// shape.
pub fn another_unit(
    profile: &RadialProfile,
    found: &Fit,
    fitted: impl Fn(&RadialProfile, f64) -> Option<Fit>,
) -> Option<Warning> {
    let scale_off = |fit: &Fit| fit.warnings.iter().any(is_scale_off);
    if !doubts_unit(found.reduced_chi2, &found.warnings) {
        return None;
    }
    let cured = |power: &i32| {
        let factor = 10.0_f64.powi(-power);
        let mut other = profile.clone();
        for p in &mut other.points {
            p.reflectance_per_mm2 *= factor;
            p.u_reflectance_per_mm2 *= factor;
        }
        fitted(&other, factor).is_some_and(|fit| {
            !scale_off(&fit) && fit.reduced_chi2 < CURED * found.reduced_chi2.max(BAD)
        })
    };
    let power = POWERS.into_iter().find(cured)?;
    let mut light = Light::default();
    for p in &profile.points {
        light.add(p, p.reflectance_per_mm2);
    }
    Some(Warning::AnotherUnit {
        integral: light.integral,
        expected: light.integral * 10.0_f64.powi(-power),
        power,
    })
}
