//! What a fit returns.

use crate::budget::Contribution;
use physics::Coefficients;
use thiserror::Error;

/// A number with its standard uncertainty and 95 % interval, all in one unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Best estimate.
    pub value: f64,
    /// Standard uncertainty (JCGM 100).
    pub u: f64,
    /// Lower and upper end of the 95 % interval.
    pub ci95: (f64, f64),
    /// Effective degrees of freedom of `u` (JCGM 100, G.4); infinite where it was stated.
    pub degrees_of_freedom: f64,
}

/// How the search ended. It always comes with its best estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// At a minimum.
    Converged,
    /// At a minimum that lies on σₐ = 0: see [`Fit::upper_limit`].
    AtBound,
    /// `max_evaluations` were used up.
    OutOfEvaluations,
}

/// One fitted datum beside the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Mean radius, mm.
    pub radius_mm: f64,
    /// Measured exitance per incident power, mm⁻².
    pub measured_per_mm2: f64,
    /// Its own standard uncertainty, mm⁻².
    pub u_per_mm2: f64,
    /// What the model says at the optimum, mm⁻²: the scale factor is in it.
    pub model_per_mm2: f64,
    /// What the fitted nuisances add to it, mm⁻²: the model's discrepancy and
    /// [`crate::FitOptions::directions`].
    pub nuisances_per_mm2: f64,
}

/// The total reflectance beside the model's, per incident power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TotalFit {
    /// As measured, inside `radius_max_mm`.
    pub measured: f64,
    /// Its own standard uncertainty.
    pub u: f64,
    /// The model's inside the same circle, without the fitted scale factor.
    pub model: f64,
    /// The circle; `None` for the whole plane.
    pub radius_max_mm: Option<f64>,
}

/// Something a user should know about a fit that is otherwise fine.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The profile's radii end before diffusion would want to start.
    #[error(
        "the fit starts at {start_mm:.3} mm, only {transport_lengths:.2} transport lengths 1/(sigma_a + sigma_s') from the beam, where diffusion is a rough approximation: photograph a wider field"
    )]
    StartsNear {
        /// Where the fit starts, mm.
        start_mm: f64,
        /// The same in 1/σₜ′.
        transport_lengths: f64,
    },
    /// α′ is too low for diffusion.
    #[error(
        "reduced albedo {albedo_prime:.3}: the material absorbs too much for diffusion, whose error here may be tens of percent"
    )]
    LowAlbedo {
        /// α′ as fitted.
        albedo_prime: f64,
    },
    /// The residuals are larger than the noise explains.
    #[error(
        "reduced chi-squared {reduced_chi2:.2}: the residuals are larger than the stated noise, so every uncertainty was widened by {widened:.2}, which may be far too little: beam and pixels not given, or a model that does not hold (on real materials a closed form is wrong by percents; compare monte-carlo, or the constraint exact, which the model moves less)"
    )]
    PoorFit {
        /// χ² per degree of freedom.
        reduced_chi2: f64,
        /// Factor applied to the uncertainties.
        widened: f64,
    },
    /// The data want another scale than the white reference gives.
    #[error(
        "the fit wants the white reference's scale times {scale:.3}, where 1 with u {u:.3} was stated: the model does not hold, or the reference does not; do not trust these coefficients"
    )]
    ScaleOff {
        /// Fitted factor.
        scale: f64,
        /// Standard uncertainty stated of it.
        u: f64,
    },
    /// The data want an input elsewhere than it was stated.
    #[error(
        "the data want `{input}` {off:.1} of its standard uncertainties from what was stated: one of the two is wrong, or the model does not hold"
    )]
    InputOff {
        /// The line of the budget.
        input: &'static str,
        /// How far, in standard uncertainties.
        off: f64,
    },
    /// The total exceeds what the model can reach.
    #[error(
        "measured total reflectance {total} is above the ceiling {ceiling} of a medium that absorbs nothing, within 3 u: sigma_a is an upper limit"
    )]
    TotalAtCeiling {
        /// As measured.
        total: f64,
        /// The model's largest.
        ceiling: f64,
    },
    /// σₐ cannot be told from 0.
    #[error("sigma_a cannot be told from 0 here: take the upper limit {upper_limit:.3e} mm^-1")]
    UpperLimitOnly {
        /// 95 % upper limit of σₐ, mm⁻¹.
        upper_limit: f64,
    },
    /// A value lies below 0 by more than noise can do.
    #[error(
        "the reflectance {value:.3e} mm^-2 at {radius_mm:.3} mm is below 0 by many times its u of {u:.1e}: too much was taken away as dark, or the stated noise is too small"
    )]
    NegativeLight {
        /// Where, mm.
        radius_mm: f64,
        /// The value, mm⁻².
        value: f64,
        /// Its standard uncertainty, mm⁻².
        u: f64,
    },
    /// The shape of the profile and its light contradict each other by a power of ten.
    #[error(
        "the profile integrates to {integral:.2e} of the incident light, and with its shape it would be {expected:.2e}: it is too {direction} by about 10^{power}, a power of ten, which looks like a unit; radii must be mm and reflectances mm^-2 (radii in cm make it 100 times too dark, reflectances in cm^-2 100 times too bright)",
        direction = if *power < 0 { "dark" } else { "bright" }
    )]
    AnotherUnit {
        /// ∫ R 2πr dr of the profile.
        integral: f64,
        /// What the model's medium of this shape returns there.
        expected: f64,
        /// The nearest power of ten by which the first is off.
        power: i32,
    },
    /// One point outweighs all others together.
    #[error(
        "the point at {radius_mm:.3} mm carries {percent:.0} % of all the weight, so that nothing checks it: look at its uncertainty"
    )]
    OnePointDecides {
        /// Where, mm.
        radius_mm: f64,
        /// Its share, percent.
        percent: f64,
    },
    /// The model is a closed form whose error nobody has measured.
    #[error(
        "how far the model {model} is off transport is not known: u holds the noise and the inputs alone, and a closed form is wrong by percents"
    )]
    UnknownModelError {
        /// Its name.
        model: &'static str,
    },
    /// Much light leaves outside the picture.
    #[error("{percent:.1} % of the light leaves outside the picture, by the model")]
    LightOutside {
        /// Share beyond the last radius, percent.
        percent: f64,
    },
}

/// σₐ and σₛ′ of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Name of the channel.
    pub channel: String,
    /// Absorption coefficient, mm⁻¹.
    pub sigma_a: Estimate,
    /// Reduced scattering coefficient, mm⁻¹.
    pub sigma_s_prime: Estimate,
    /// Correlation of the errors of the two.
    pub correlation: f64,
    /// What the uncertainties of both are made of; their squares sum to those of the whole.
    pub budget: Vec<Contribution>,
    /// 95 % upper limit of σₐ, mm⁻¹, where its interval reaches 0.
    pub upper_limit: Option<f64>,
    /// The total, where one was given.
    pub total: Option<TotalFit>,
    /// Factor between model and measurement that was fitted along: 1 if the white reference is
    /// right.
    pub scale: f64,
    /// First and last radius that took part, mm.
    pub range_mm: (f64, f64),
    /// Share of the light that leaves beyond the last radius of the profile, by the model.
    pub share_outside: f64,
    /// χ² per degree of freedom.
    pub reduced_chi2: f64,
    /// How often the model was evaluated.
    pub evaluations: usize,
    /// How the search ended.
    pub termination: Termination,
    /// What a user should know.
    pub warnings: Vec<Warning>,
    /// The points that took part.
    pub residuals: Vec<Residual>,
    /// Where the data want each of [`crate::FitOptions::directions`], in its standard
    /// uncertainties: 0 is as stated.
    pub nuisances: Vec<f64>,
}

impl Fit {
    /// The coefficients alone.
    pub fn coefficients(&self) -> Coefficients {
        Coefficients {
            sigma_a: self.sigma_a.value,
            sigma_s_prime: self.sigma_s_prime.value,
        }
    }
}

/// A profile cannot constrain a medium at all.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FitError {
    /// Too few points in the range.
    #[error(
        "channel {channel}: {points} points between {start_mm} mm and {end_mm} mm; a fit needs at least {needed}: widen the range"
    )]
    TooFewPoints {
        /// Name of the channel.
        channel: String,
        /// How many there are.
        points: usize,
        /// How many it takes.
        needed: usize,
        /// Start of the range, mm.
        start_mm: f64,
        /// End of the range, mm.
        end_mm: f64,
    },
    /// A value or its uncertainty is not usable.
    #[error(
        "channel {channel}, radius {radius_mm} mm: reflectance {value} mm^-2 with u {u} mm^-2; expected a finite value and u above 0"
    )]
    BadPoint {
        /// Name of the channel.
        channel: String,
        /// Where.
        radius_mm: f64,
        /// The value, mm⁻².
        value: f64,
        /// Its standard uncertainty, mm⁻².
        u: f64,
    },
    /// A radius is negative or not finite.
    #[error(
        "channel {channel}: radius {radius_mm} mm; expected a finite number of at least 0, the distance from the \
         beam: leave the point out"
    )]
    NoRadius {
        /// Name of the channel.
        channel: String,
        /// The radius at fault, mm.
        radius_mm: f64,
    },
    /// The radii do not increase.
    #[error(
        "channel {channel}: radius {radius_mm} mm follows {previous_mm} mm; radii must increase: sort the profile and average repeated radii"
    )]
    RadiiNotIncreasing {
        /// Name of the channel.
        channel: String,
        /// The radius at fault, mm.
        radius_mm: f64,
        /// The one before, mm.
        previous_mm: f64,
    },
    /// Nothing rises above the noise.
    #[error(
        "channel {channel}: no point stands out of its noise by 3 u (the best by {best:.1}): expose longer or brighten the beam"
    )]
    NoSignal {
        /// Name of the channel.
        channel: String,
        /// Largest value over its u.
        best: f64,
    },
    /// Exact and joint fits need a total.
    #[error("channel {channel}: the constraint needs a total reflectance and there is none")]
    NoTotal {
        /// Name of the channel.
        channel: String,
    },
    /// The total or its uncertainty is not usable.
    #[error(
        "channel {channel}: total reflectance {total} with u {u}; expected a finite total above 0 and u of at least 0 (above 0 for a joint fit)"
    )]
    BadTotal {
        /// Name of the channel.
        channel: String,
        /// The total.
        total: f64,
        /// Its own standard uncertainty.
        u: f64,
    },
    /// More light comes back than entered.
    #[error(
        "channel {channel}: total reflectance {total} (u {u}) is above {ceiling}, the most that a medium can return, by more than 3 u: check the white reference, the stray light and the exposure times"
    )]
    TotalAboveCeiling {
        /// Name of the channel.
        channel: String,
        /// The total.
        total: f64,
        /// Its standard uncertainty, the shared scale's included.
        u: f64,
        /// The model's largest.
        ceiling: f64,
    },
    /// A profile holds more light than there is.
    #[error(
        "channel {channel}: the profile integrates to {integral:.3}, and no more than {most:.3} of the incident light can come back: is it in another unit? Radii must be mm and reflectances mm^-2 (a value in cm^-2 is 100 times one in mm^-2, one in cm^-1 10 times)"
    )]
    ImpossibleIntegral {
        /// Name of the channel.
        channel: String,
        /// ∫ R 2πr dr of the profile.
        integral: f64,
        /// The most that it can be: the measured total or what enters.
        most: f64,
    },
    /// A free scale contradicts the hard constraint.
    #[error(
        "the constraint exact takes the scale as true, so it cannot be free as well: fit joint or none"
    )]
    ScaleIsExact,
    /// The beam covers the profile.
    #[error(
        "channel {channel}: the profile ends at {profile_mm} mm, inside the beam (which is clear from {beam_mm} mm): give the range, or a narrower beam"
    )]
    BeamWiderThanProfile {
        /// Name of the channel.
        channel: String,
        /// Radius from which a profile is clear of the blur, mm.
        beam_mm: f64,
        /// Last radius, mm.
        profile_mm: f64,
    },
    /// A direction does not fit the profile.
    #[error(
        "a direction of the fit has {found} numbers for {expected} points, or one that is not finite"
    )]
    BadDirection {
        /// How many numbers it has for the profile.
        found: usize,
        /// How many points the profile has.
        expected: usize,
    },
    /// The range ends before it starts.
    #[error(
        "range_mm: expected the first and the last radius in mm, as 0.8 and 15, got {start_mm} and {end_mm}"
    )]
    BadRange {
        /// Start of the range, mm.
        start_mm: f64,
        /// End of the range, mm.
        end_mm: f64,
    },
    /// An option lies outside its domain.
    #[error("{name} must be {expected}, got {found}")]
    BadOption {
        /// Which one.
        name: &'static str,
        /// What was found.
        found: f64,
        /// What was expected.
        expected: &'static str,
    },
}
