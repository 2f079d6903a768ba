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
    let scale_off = |fit: &Fit| {
        let mut warnings = fit.warnings.iter();
        warnings.any(|w| matches!(w, Warning::ScaleOff { .. }))
    };
    if found.reduced_chi2 < BAD && !scale_off(found) {
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
