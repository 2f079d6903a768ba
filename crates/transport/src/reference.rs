//! The closed form that the table is a correction to: a dipole with the exact rate of decay.

use std::f64::consts::PI;

/// Two sources at unit and at image depth, whose light decays with `rate`; lengths in 1/σₜ′.
///
/// With `rate` = √(3(1 − α′)) it is the diffusion dipole. With the slowest rate of the transport
/// equation the ratio of truth to closed form levels off far from the beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reference {
    rate: f64,
    depths: [f64; 2],
}

/// A logarithm and its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Log {
    pub(crate) value: f64,
    /// ∂/∂ln ρ.
    pub(crate) in_ln_radius: f64,
    /// ∂/∂rate divided by the rate: it stays finite where the rate vanishes.
    pub(crate) in_rate_by_rate: f64,
}

impl Reference {
    /// `a` is the internal reflection parameter A.
    pub(crate) fn new(rate: f64, a: f64) -> Self {
        Self {
            rate,
            depths: [1.0, 1.0 + 4.0 / 3.0 * a],
        }
    }

    /// ln of the exitance at `radius`, less ln α′.
    pub(crate) fn ln_reflectance(&self, radius: f64) -> Log {
        let k = self.rate;
        let distances = self.depths.map(|z| (radius * radius + z * z).sqrt());
        // The nearer source's decay is taken out, so that nothing underflows.
        let shift = k * distances[0];
        let decays = [1.0, (shift - k * distances[1]).exp()];
        let (mut sum, mut in_r2, mut in_k) = (0.0, 0.0, 0.0);
        for ((z, d), decay) in self.depths.into_iter().zip(distances).zip(decays) {
            let d3 = d * d * d;
            sum += z * (1.0 + k * d) * decay / d3;
            in_r2 -= z * (k * k * d * d + 3.0 * k * d + 3.0) * decay / (d3 * d * d);
            in_k -= z * decay / d;
        }
        Log {
            value: (sum / (4.0 * PI)).ln() - shift,
            in_ln_radius: in_r2 * radius * radius / sum,
            in_rate_by_rate: in_k / sum,
        }
    }

    /// ln of what leaves within `radius`, less ln α′.
    pub(crate) fn ln_within(&self, radius: f64) -> Log {
        let k = self.rate;
        let (mut sum, mut in_k, mut slope) = (0.0, 0.0, 0.0);
        for z in self.depths {
            let d = radius.hypot(z);
            let path = radius * radius / (d + z);
            let start = (-k * z).exp();
            // e^(−kz) − (z/d) e^(−kd), and (e^(−kz) − e^(−kd))/k, without their cancellation.
            let lost = -(-k * path).exp_m1();
            sum += start * (path + z * lost) / d;
            in_k -= z * start * if k * path > 1e-12 { lost / k } else { path };
            slope += z * (1.0 + k * d) * (-k * d).exp() * radius * radius / (d * d * d);
        }
        Log {
            value: (0.5 * sum).ln(),
            in_ln_radius: slope / sum,
            // The derivative itself is −Σ z (e^(−kz) − e^(−kd)), one factor of k more.
            in_rate_by_rate: in_k / sum,
        }
    }

    /// ln of what leaves beyond `radius`, less ln α′.
    pub(crate) fn ln_beyond(&self, radius: f64) -> f64 {
        let k = self.rate;
        let shift = k * radius.hypot(self.depths[0]);
        let sum: f64 = self
            .depths
            .iter()
            .map(|&z| {
                let d = radius.hypot(z);
                z / d * (shift - k * d).exp()
            })
            .sum();
        (0.5 * sum).ln() - shift
    }

    /// ln of everything that leaves, less ln α′.
    pub(crate) fn ln_total(&self) -> Log {
        let [near, far] = self.depths.map(|z| (-self.rate * z).exp());
        let slope = -(self.depths[0] * near + self.depths[1] * far) / (near + far);
        // The total starts like 1 − √σₐ: at 0 its derivative is −∞.
        Log {
            value: (0.5 * (near + far)).ln(),
            in_ln_radius: 0.0,
            in_rate_by_rate: slope / self.rate,
        }
    }
}
