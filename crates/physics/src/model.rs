//! What a fit asks of a model of diffuse reflectance.

use crate::exit::ExitFactor;
use crate::medium::Coefficients;
use std::ops::{Add, Div, Mul, Sub};

/// A value and its derivatives in σₐ and σₛ′.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gradient {
    /// The value itself.
    pub value: f64,
    /// ∂/∂σₐ, in units of the value times mm.
    pub in_sigma_a: f64,
    /// ∂/∂σₛ′, in units of the value times mm.
    pub in_sigma_s_prime: f64,
}

impl Add for Gradient {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            in_sigma_a: self.in_sigma_a + other.in_sigma_a,
            in_sigma_s_prime: self.in_sigma_s_prime + other.in_sigma_s_prime,
        }
    }
}

impl Sub for Gradient {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + other * -1.0
    }
}

impl Mul<f64> for Gradient {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            in_sigma_a: self.in_sigma_a * factor,
            in_sigma_s_prime: self.in_sigma_s_prime * factor,
        }
    }
}

impl Mul for Gradient {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            in_sigma_a: self.in_sigma_a * other.value + self.value * other.in_sigma_a,
            in_sigma_s_prime: self.in_sigma_s_prime * other.value
                + self.value * other.in_sigma_s_prime,
        }
    }
}

impl Div for Gradient {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self * other.map(1.0 / other.value, -1.0 / (other.value * other.value))
    }
}

impl Gradient {
    /// A number that no coefficient moves.
    pub const fn constant(value: f64) -> Self {
        Self {
            value,
            in_sigma_a: 0.0,
            in_sigma_s_prime: 0.0,
        }
    }

    /// σₐ and σₛ′ themselves, as what everything else is differentiated by.
    pub const fn of(coefficients: Coefficients) -> (Self, Self) {
        let sigma_a = Self {
            value: coefficients.sigma_a,
            in_sigma_a: 1.0,
            in_sigma_s_prime: 0.0,
        };
        let sigma_s_prime = Self {
            value: coefficients.sigma_s_prime,
            in_sigma_a: 0.0,
            in_sigma_s_prime: 1.0,
        };
        (sigma_a, sigma_s_prime)
    }

    /// A function of this number: `value` there, with `slope` in this number.
    pub fn map(self, value: f64, slope: f64) -> Self {
        // Where the slope is infinite, what does not move stays where it is.
        let times = |x: f64| if x == 0.0 { 0.0 } else { slope * x };
        Self {
            value,
            in_sigma_a: times(self.in_sigma_a),
            in_sigma_s_prime: times(self.in_sigma_s_prime),
        }
    }
}

/// Where a model may be trusted: what it leaves out costs about ten percent at these limits.
///
/// docs/models.md shows what each model is off by against transport, with the command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// Smallest reduced albedo α′.
    pub least_albedo_prime: f64,
    /// Smallest distance from the beam, in transport lengths 1/σₜ′.
    pub least_transport_lengths: f64,
}

/// Diffuse reflectance of a half-space at one relative index, for any coefficients.
///
/// Everything is per unit of power that *enters* the medium, under a pencil beam along the
/// normal; entry loss, beam width and rings are the caller's.
pub trait ForwardModel: Sync {
    /// The name by which commands and files call the model.
    fn name(&self) -> &'static str;

    /// Relative index that the model was made for.
    fn eta(&self) -> f64;

    /// R_d at each `radius` (mm), mm⁻², into `out` of the same length.
    fn diffuse_reflectance(&self, coefficients: Coefficients, radius: &[f64], out: &mut [f64]) {
        let mut gradients = vec![Gradient::default(); radius.len()];
        self.diffuse_reflectance_gradient(coefficients, radius, &mut gradients);
        for (out, gradient) in out.iter_mut().zip(gradients) {
            *out = gradient.value;
        }
    }

    /// R_d at each `radius` (mm) with its derivatives, into `out` of the same length.
    fn diffuse_reflectance_gradient(
        &self,
        coefficients: Coefficients,
        radius: &[f64],
        out: &mut [Gradient],
    );

    /// The light that leaves within `radius` mm of the beam; the total for an infinite `radius`.
    fn within(&self, coefficients: Coefficients, radius: f64) -> Gradient;

    /// The light that leaves farther than `radius` mm from the beam; the total for 0.
    fn beyond(&self, coefficients: Coefficients, radius: f64) -> f64;

    /// Where the model may be trusted.
    fn trust(&self) -> Trust {
        Trust {
            least_albedo_prime: 0.5,
            least_transport_lengths: 2.0,
        }
    }

    /// Relative standard error of R_d at `radius` mm that comes from the model's own numerics, a
    /// table's interpolation for one: against the equation that it solves, not against nature.
    fn relative_error(&self, _coefficients: Coefficients, _radius: f64) -> f64 {
        0.0
    }

    /// How many independent ways there are in which the model may be wrong: see
    /// [`Self::discrepancy`].
    fn discrepancies(&self) -> usize {
        0
    }

    /// In what ways the model is wrong of nature (or of the transport equation), at
    /// `coefficients`: the relative error of R_d at each `radius` (mm) for one standard deviation
    /// of each way, into `columns`.
    ///
    /// `columns` holds [`Self::discrepancies`] runs of `radius.len()` numbers, one run for each
    /// way, which are independent of each other. The error of the model at radius r is
    /// R_d(r) · Σₖ zₖ φₖ(r) with φₖ in column k and every zₖ of mean 0 and variance 1; φₖ should
    /// vary as slowly with r as a ring is wide. A fit carries the zₖ as nuisances and eliminates
    /// them exactly; it takes the φₖ at its last estimate of the coefficients as fixed, and goes
    /// round until that no longer moves.
    fn discrepancy(&self, _coefficients: Coefficients, _radius: &[f64], _columns: &mut [f64]) {}

    /// The relative error of [`Self::within`] `radius` for one standard deviation of each way of
    /// [`Self::discrepancy`], into `out`, of [`Self::discrepancies`] numbers; the total's for an
    /// infinite `radius`.
    fn discrepancy_within(&self, _coefficients: Coefficients, _radius: f64, _out: &mut [f64]) {}

    /// What a camera sees of it at the cosine `cos_view` with the normal, outside. A model of
    /// diffusion takes the light inside to be isotropic.
    fn exit_factor(&self, _coefficients: Coefficients, cos_view: f64) -> ExitFactor {
        ExitFactor::diffuse(self.eta(), cos_view)
    }
}
