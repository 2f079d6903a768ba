//! What a camera sees of R_d, convolved with the beam, tabulated against radius.

use gauss_quad::GaussLegendre;
use physics::bessel::scaled_bessel_i0;
use physics::footprint::Beam;
use physics::{Blur, Coefficients, ExitFactor, ForwardModel};
use std::f64::consts::{LN_2, PI};
use std::num::NonZeroUsize;

/// π·radiance about the beam, per power that enters, mm⁻², out to the radius it was made for.
///
/// Knots are evenly spaced in w = ½ ln(1 + r²/s²), which is even and smooth at the centre,
/// logarithmic far out, and costs one logarithm and no root.
#[derive(Clone, Debug)]
pub(crate) struct Glow {
    inverse_square_scale: f64,
    inverse_step: f64,
    /// A cubic about each knot but the first, good from the knot before to the knot after.
    cubics: Vec<[f64; 4]>,
    smallest_mm: f64,
    edge_mm: f64,
    flank_mm: f64,
}

/// Distance between knots in w. A four-point cubic is then within 1e-6 where the light falls
/// like exp(−10) per e-fold of radius.
const STEP: f64 = 0.004;

impl Glow {
    /// The glow of `model` at these coefficients under `beam`, seen through `exit`, out to
    /// `reach_mm`.
    pub(crate) fn new(
        model: &dyn ForwardModel,
        at: Coefficients,
        exit: &ExitFactor,
        beam: Beam,
        reach_mm: f64,
    ) -> Self {
        let depth = 1.0 / at.sigma_t_prime();
        let blur = Blur {
            beam,
            pixel_mm: 0.0,
        };
        let spread = blur.standard_deviation_mm();
        let beam = blur.beam;
        let (edge_mm, flank_mm, smallest_mm) = match &beam {
            Beam::Measured(shape) => (0.0, shape.radius_holding(1.0), depth),
            Beam::Point => (0.0, 0.0, depth),
            Beam::Gaussian { .. } => (0.0, 8.0 * spread, depth.hypot(spread)),
            Beam::Disk { fwhm_mm } => (0.5 * *fwhm_mm, 0.0, depth),
        };
        // A disk's edge is as sharp as a source is deep, wherever it lies.
        let step = if edge_mm > 0.0 {
            (0.05 * depth / edge_mm).clamp(1e-4, STEP)
        } else {
            STEP
        };
        let scale = 0.5 * depth.hypot(spread);
        let knots = (0.5 * (reach_mm / scale).powi(2).ln_1p() / step).ceil() as usize + 4;
        let convolution = Convolution::new(model, at, exit, beam, depth);
        let values: Vec<f64> = (0..knots)
            .map(|knot| {
                let radius = scale * (2.0 * step * knot as f64).exp_m1().sqrt();
                convolution.at(radius)
            })
            .collect();
        let cubics = values
            .windows(4)
            .map(|f| {
                [
                    f[1],
                    f[2] - f[0] / 3.0 - f[1] / 2.0 - f[3] / 6.0,
                    (f[0] + f[2]) / 2.0 - f[1],
                    (f[3] - f[0]) / 6.0 + (f[1] - f[2]) / 2.0,
                ]
            })
            .collect();
        Self {
            inverse_square_scale: 1.0 / (scale * scale),
            inverse_step: 1.0 / step,
            cubics,
            smallest_mm,
            edge_mm,
            flank_mm,
        }
    }

    /// Exitance at the radius whose square is `square`, mm², by the table.
    pub(crate) fn at_square(&self, square: f64) -> f64 {
        let position = 0.5 * (1.0 + square * self.inverse_square_scale).ln() * self.inverse_step;
        // Cubic i stands about knot i + 1.
        let index = (position as usize).clamp(1, self.cubics.len()) - 1;
        let t = position - (index + 1) as f64;
        let c = &self.cubics[index];
        c[0] + t * (c[1] + t * (c[2] + t * c[3]))
    }

    /// Distance over which the glow changes at `radius`, mm: the distance to its nearest sharp
    /// feature (the centre, a disk's edge), or the size of that feature.
    pub(crate) fn length_at(&self, radius: f64) -> f64 {
        let distance = radius.min((radius - self.edge_mm).abs());
        distance.hypot(self.smallest_mm)
    }

    /// Radius within which the beam itself shapes the glow, mm.
    pub(crate) fn flank_mm(&self) -> f64 {
        self.edge_mm + self.flank_mm
    }
}

/// R_d convolved with the beam at any radius, as one integral over the distance s from a source:
/// ∫ R_d(s) s ∫ beam dφ ds, where the angle's part is known in closed form.
struct Convolution<'a> {
    model: &'a dyn ForwardModel,
    at: Coefficients,
    exit: &'a ExitFactor,
    beam: Beam,
    depth: f64,
    /// Nodes and weights over [0, 1].
    rule: Vec<(f64, f64)>,
}

impl<'a> Convolution<'a> {
    fn new(
        model: &'a dyn ForwardModel,
        at: Coefficients,
        exit: &'a ExitFactor,
        beam: Beam,
        depth: f64,
    ) -> Self {
        let rule = GaussLegendre::new(NonZeroUsize::new(12).expect("12 is not zero"));
        let rule = rule
            .as_node_weight_pairs()
            .iter()
            .map(|(x, w)| (0.5 + 0.5 * x, 0.5 * w))
            .collect();
        Self {
            model,
            at,
            exit,
            beam,
            depth,
            rule,
        }
    }

    fn at(&self, radius: f64) -> f64 {
        // What is seen at the beam's own point has the shape of the beam; a point has none.
        let at_beam = self.exit.at_beam;
        match self.beam {
            Beam::Measured(ref shape) => {
                // An even ring is a disk less a smaller one.
                let rings = shape.rings().filter(|(.., share)| *share > 0.0);
                rings
                    .map(|(inner, outer, share)| {
                        let (whole, hole) = (outer * outer, inner * inner);
                        let less = if inner > 0.0 {
                            hole * self.disk(radius, inner)
                        } else {
                            0.0
                        };
                        share * (whole * self.disk(radius, outer) - less) / (whole - hole)
                    })
                    .sum()
            }
            Beam::Point => self.sum(&[(radius, 1.0)]),
            Beam::Gaussian { fwhm_mm } => {
                let sigma = fwhm_mm / (8.0 * LN_2).sqrt();
                let beam = (-0.5 * (radius / sigma).powi(2)).exp() / (2.0 * PI * sigma * sigma);
                self.gaussian(radius, sigma) + at_beam * beam
            }
            Beam::Disk { fwhm_mm } => {
                let disk = 0.5 * fwhm_mm;
                let beam = if radius < disk {
                    1.0 / (PI * disk * disk)
                } else {
                    0.0
                };
                self.disk(radius, disk) + at_beam * beam
            }
        }
    }

    fn sum(&self, nodes: &[(f64, f64)]) -> f64 {
        let radii: Vec<f64> = nodes.iter().map(|(s, _)| *s).collect();
        let mut values = vec![0.0; radii.len()];
        self.model.diffuse_reflectance(self.at, &radii, &mut values);
        values
            .iter()
            .zip(nodes)
            .map(|(v, (s, w))| v * w * self.exit.at(*s))
            .sum()
    }

    /// The circle of radius s about a point at `radius` meets the density
    /// exp(−(r − s)²/2σ²) I₀(rs/σ²) e^(−rs/σ²)/(2πσ²) on average.
    fn gaussian(&self, radius: f64, sigma: f64) -> f64 {
        let inverse = 1.0 / (sigma * sigma);
        let high = radius + 9.0 * sigma;
        let mut low = (radius - 9.0 * sigma).max(0.0);
        let mut nodes = vec![];
        while low < high {
            // No wider than the beam, and no wider than the distance to the poles of R_d.
            let width = (1.5 * sigma).min(low.hypot(self.depth)).min(high - low);
            for (x, w) in &self.rule {
                let s = low + width * x;
                let density = (-0.5 * (radius - s).powi(2) * inverse).exp()
                    * scaled_bessel_i0(radius * s * inverse);
                nodes.push((s, w * width * s * inverse * density));
            }
            low += width;
        }
        self.sum(&nodes)
    }

    /// What is seen within `radius` of a source.
    fn whole(&self, radius: f64) -> f64 {
        if self.exit.is_even() {
            let beyond = |s| self.model.beyond(self.at, s);
            return (beyond(0.0) - beyond(radius)) * self.exit.at(radius);
        }
        let mut nodes = vec![];
        let mut high = radius;
        // Toward the source no model grows faster than 1/s.
        while high > 1e-6 * radius {
            let low = 0.5 * high;
            for (x, w) in &self.rule {
                let s = low + (high - low) * x;
                nodes.push((s, w * (high - low) * 2.0 * PI * s));
            }
            high = low;
        }
        self.sum(&nodes)
    }

    /// An arc of the circle of radius s about a point at `radius` lies inside the disk.
    fn disk(&self, radius: f64, disk: f64) -> f64 {
        let area = PI * disk * disk;
        let (mut low, high) = ((radius - disk).abs(), radius + disk);
        // Circles that lie inside as a whole.
        let whole = if radius < disk { self.whole(low) } else { 0.0 };
        let mut nodes = vec![];
        let mut panel = |low: f64, width: f64, end: End| {
            for (x, w) in &self.rule {
                // The arc starts and ends like a root; squares make that smooth.
                let (s, ds) = match end {
                    End::Low => (low + width * x * x, 2.0 * x),
                    End::High => (low + width * (1.0 - (1.0 - x) * (1.0 - x)), 2.0 * (1.0 - x)),
                    End::Neither => (low + width * x, 1.0),
                };
                let cos = (radius * radius + (s - disk) * (s + disk)) / (2.0 * radius * s);
                let arc = 2.0 * cos.clamp(-1.0, 1.0).acos();
                nodes.push((s, w * width * ds * s * arc));
            }
        };
        if radius > 0.0 {
            let mut end = End::Low;
            // No wider than the distance to the pole at s = 0, and at least two panels.
            let mut width = low.max(0.01 * self.depth);
            while high - low > 2.0 * width {
                panel(low, width, end);
                low += width;
                end = End::Neither;
                width = low.max(0.01 * self.depth);
            }
            let half = 0.5 * (high - low);
            panel(low, half, end);
            panel(low + half, half, End::High);
        }
        (whole + self.sum(&nodes)) / area
    }
}

/// Which end of a panel the integrand leaves like a root.
#[derive(Clone, Copy)]
enum End {
    Low,
    High,
    Neither,
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use physics::profile::ProfilePoint;
    use physics::{DiffuseFresnel, Dipole, DipoleModel, Footprints, ReducedMedium};

    pub(crate) const MARBLE: ReducedMedium = ReducedMedium {
        sigma_a: 0.0041,
        sigma_s_prime: 2.62,
        eta: 1.5,
    };
    pub(crate) const WHITE: ReducedMedium = ReducedMedium {
        sigma_a: 0.0,
        sigma_s_prime: 20.4,
        eta: 1.3,
    };
    pub(crate) const KETCHUP: ReducedMedium = ReducedMedium {
        sigma_a: 0.97,
        sigma_s_prime: 0.07,
        eta: 1.3,
    };

    pub(crate) fn glow(medium: &ReducedMedium, beam: Beam, reach_mm: f64) -> Glow {
        let model = DipoleModel::new(medium.eta, DiffuseFresnel::Exact);
        Glow::new(
            &model,
            medium.coefficients(),
            &ExitFactor::even(1.0),
            beam,
            reach_mm,
        )
    }

    /// The convolution as a plain sum over a grid in the plane.
    ///
    /// For smooth functions that vanish at the border the error falls like exp(−2π depth/step).
    pub(crate) fn plain_gaussian(medium: &ReducedMedium, radius: f64, fwhm_mm: f64) -> f64 {
        let dipole = Dipole::new(medium, DiffuseFresnel::Exact);
        let sigma = fwhm_mm / (8.0 * LN_2).sqrt();
        let step = 0.3 * sigma.min(1.0 / medium.coefficients().sigma_t_prime());
        let half = (7.0 * sigma / step).ceil() as i32;
        let (mut sum, mut norm) = (0.0, 0.0);
        for i in -half..=half {
            for j in -half..=half {
                let (x, y) = (f64::from(i) * step, f64::from(j) * step);
                let w = (-0.5 * (x * x + y * y) / (sigma * sigma)).exp();
                norm += w;
                sum += w * dipole.diffuse_reflectance((radius + x).hypot(y));
            }
        }
        sum / norm
    }

    #[test]
    fn a_gaussian_glow_is_a_plain_sum_over_the_plane() {
        for medium in [MARBLE, WHITE, KETCHUP] {
            for fwhm_mm in [0.1, 0.3, 2.0] {
                let table = glow(&medium, Beam::Gaussian { fwhm_mm }, 30.0);
                for radius in [0.0, 0.003, 0.05, 0.2, 0.7, 1.9, 6.0, 28.0] {
                    let expected = plain_gaussian(&medium, radius, fwhm_mm);
                    let got = table.at_square(radius * radius);
                    // Far out in a dark medium 2e-6 of the light is 1e-22 of the peak.
                    let floor = 1e-14 * table.at_square(0.0);
                    assert!(
                        (got - expected).abs() < 1e-6 * expected + floor,
                        "{medium:?}, {fwhm_mm} mm, r = {radius}: {got} for {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_point_glows_as_the_model_says() {
        for medium in [MARBLE, WHITE, KETCHUP] {
            let table = glow(&medium, Beam::Point, 30.0);
            let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
            for step in 0..2000 {
                let radius = 15e-3 * f64::from(step);
                let expected = dipole.diffuse_reflectance(radius);
                let got = table.at_square(radius * radius);
                let floor = 1e-14 * table.at_square(0.0);
                assert!(
                    (got - expected).abs() < 1e-6 * expected + floor,
                    "{medium:?}, r = {radius}: {got} for {expected}"
                );
            }
        }
    }

    /// The disk in polar coordinates about its own centre, many nodes in each direction.
    fn plain_disk(medium: &ReducedMedium, radius: f64, disk: f64) -> f64 {
        let dipole = Dipole::new(medium, DiffuseFresnel::Exact);
        let rule = GaussLegendre::new(NonZeroUsize::new(400).unwrap());
        let angles = 4000;
        rule.integrate(0.0, disk, |rho: f64| {
            let ring: f64 = (0..angles)
                .map(|step| {
                    let cos = (PI * (f64::from(step) + 0.5) / f64::from(angles)).cos();
                    let square = radius * radius + rho * rho + 2.0 * radius * rho * cos;
                    dipole.diffuse_reflectance(square.max(0.0).sqrt())
                })
                .sum();
            rho * ring / f64::from(angles)
        }) * 2.0
            / (disk * disk)
    }

    #[test]
    fn a_disk_glow_is_a_plain_sum_over_the_disk() {
        for medium in [MARBLE, WHITE] {
            for fwhm_mm in [0.2, 1.5] {
                let table = glow(&medium, Beam::Disk { fwhm_mm }, 30.0);
                let disk = 0.5 * fwhm_mm;
                for radius in [
                    0.0,
                    0.01,
                    0.5 * disk,
                    disk - 0.02,
                    disk,
                    disk + 0.03,
                    2.0,
                    9.0,
                ] {
                    let expected = plain_disk(&medium, radius, disk);
                    let got = table.at_square(radius * radius);
                    assert!(
                        (got / expected - 1.0).abs() < 3e-6,
                        "{medium:?}, {fwhm_mm} mm, r = {radius}: {got} for {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_measured_beam_is_the_sum_of_its_rings() {
        // One ring is a disk, and a Gaussian in fine rings is a Gaussian.
        let shape = physics::RadialSpread::new(vec![0.0, 0.4], &[1.0]).unwrap();
        let disk = glow(&MARBLE, Beam::Disk { fwhm_mm: 0.8 }, 10.0);
        let one = glow(&MARBLE, Beam::Measured(shape), 10.0);
        let edges: Vec<f64> = (0..=120).map(|k| 0.02 * f64::from(k)).collect();
        let beyond = |r: f64| (-4.0 * LN_2 * (r / 0.8).powi(2)).exp();
        let power: Vec<f64> = edges
            .windows(2)
            .map(|e| beyond(e[0]) - beyond(e[1]))
            .collect();
        let shape = physics::RadialSpread::new(edges, &power).unwrap();
        let fine = glow(&MARBLE, Beam::Measured(shape), 10.0);
        let gaussian = glow(&MARBLE, Beam::Gaussian { fwhm_mm: 0.8 }, 10.0);
        for radius in [0.0, 0.2_f64, 0.7, 2.0, 8.0] {
            let at = |g: &Glow| g.at_square(radius * radius);
            // Even rings of 0.02 mm widen the beam by 1e-4.
            for (got, expected) in [(at(&one), at(&disk)), (at(&fine), at(&gaussian))] {
                assert!(
                    (got / expected - 1.0).abs() < 1e-3,
                    "{radius} mm: {got} for {expected}"
                );
            }
        }
    }

    /// The fit has its own way to blur a profile; the two must agree as far as that one claims.
    #[test]
    fn the_fits_footprints_agree() {
        let radii = [0.3, 0.6, 1.0, 3.0, 12.0];
        let points = radii.map(|radius_mm| ProfilePoint {
            ring_mm: None,
            radius_mm,
            reflectance_per_mm2: 0.0,
            u_reflectance_per_mm2: 0.0,
            pixels: None,
        });
        let beam = Beam::Gaussian { fwhm_mm: 0.3 };
        let blur = Blur {
            beam: beam.clone(),
            pixel_mm: 0.0,
        };
        let model = DipoleModel::new(MARBLE.eta, DiffuseFresnel::Exact);
        let mut expected = [0.0; 5];
        Footprints::new(&points, &blur).reflectance(&model, MARBLE.coefficients(), &mut expected);
        let table = glow(&MARBLE, beam, 30.0);
        for (radius, expected) in radii.iter().zip(expected) {
            let got = table.at_square(radius * radius);
            assert!(
                (got / expected - 1.0).abs() < 1e-5,
                "r = {radius}: {got} for {expected}"
            );
        }
    }
}
