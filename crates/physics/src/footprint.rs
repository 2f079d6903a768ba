//! What one datum of a profile averages over: its ring, the beam's width, the camera's pixel.

use crate::bessel::scaled_bessel_i0;
use crate::medium::Coefficients;
use crate::model::{ForwardModel, Gradient};
use crate::profile::ProfilePoint;
use crate::spread::RadialSpread;
use gauss_quad::GaussLegendre;
use nalgebra::DMatrix;
use std::f64::consts::{LN_2, PI};
use std::num::NonZeroUsize;
use std::ops::Range;

/// Power of the beam across the surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Beam {
    /// All of it at one point.
    Point,
    /// A Gaussian with this full width at half maximum, mm.
    Gaussian {
        /// Full width at half maximum, mm.
        fwhm_mm: f64,
    },
    /// An even disk of this diameter, mm (its full width at half maximum).
    Disk {
        /// Diameter, mm.
        fwhm_mm: f64,
    },
    /// What a camera saw of the beam on a surface that does not spread light itself: beam, point
    /// spread and pixel together, so that no pixel comes on top of it.
    Measured(RadialSpread),
}

/// What smears a profile before it is averaged over rings.
#[derive(Clone, Debug, PartialEq)]
pub struct Blur {
    /// The beam that lit the sample.
    pub beam: Beam,
    /// Side of a pixel on the sample, mm; each averages over its square. 0 for none. A measured
    /// beam has it in itself.
    pub pixel_mm: f64,
}

impl Blur {
    /// A point beam, seen without pixels.
    pub const NONE: Self = Self {
        beam: Beam::Point,
        pixel_mm: 0.0,
    };

    /// Displacements from the nominal point, mm, with weights that sum to 1.
    ///
    /// A pixel's square has the second moment `pixel_mm`²/12 along each axis; it is added to the
    /// beam's. What it has beyond that is of fourth order in the pixel.
    fn displacements(&self, count: usize) -> Vec<(f64, f64)> {
        let pixel = self.pixel_mm * self.pixel_mm / 12.0;
        let gaussian = |variance: f64| {
            // Beyond six standard deviations lies 1.5e-8 of the beam.
            legendre(count, 0.0, 6.0 * variance.sqrt(), |d| {
                d * (-0.5 * d * d / variance).exp()
            })
        };
        let mut pairs = match &self.beam {
            Beam::Measured(spread) => {
                let mut samples = vec![];
                for (inner, outer, share) in spread.rings().filter(|r| r.2 > 0.0) {
                    let even = share / (0.5 * (outer - inner) * (outer + inner));
                    samples.extend(legendre(4, inner, outer, |r| even * r));
                }
                gauss_rule(&samples, count)
            }
            Beam::Point if pixel == 0.0 => vec![(0.0, 1.0)],
            Beam::Point => gaussian(pixel),
            &Beam::Gaussian { fwhm_mm } => {
                let variance = fwhm_mm * fwhm_mm / (8.0 * LN_2) + pixel;
                if variance == 0.0 {
                    vec![(0.0, 1.0)]
                } else {
                    gaussian(variance)
                }
            }
            &Beam::Disk { fwhm_mm } => {
                // An even disk of radius R has the second moment R²/4 along each axis.
                let radius = (0.25 * fwhm_mm * fwhm_mm + 4.0 * pixel).sqrt();
                if radius == 0.0 {
                    vec![(0.0, 1.0)]
                } else {
                    legendre(count, 0.0, radius, |d| d)
                }
            }
        };
        let sum: f64 = pairs.iter().map(|(_, w)| w).sum();
        for (_, weight) in &mut pairs {
            *weight /= sum;
        }
        pairs
    }

    /// Standard deviation of the blur along one axis, mm.
    pub fn standard_deviation_mm(&self) -> f64 {
        let pixel = self.pixel_mm * self.pixel_mm / 12.0;
        let beam = match &self.beam {
            Beam::Measured(spread) => return spread.variance_mm2().sqrt(),
            Beam::Point => 0.0,
            Beam::Gaussian { fwhm_mm } => fwhm_mm * fwhm_mm / (8.0 * LN_2),
            Beam::Disk { fwhm_mm } => fwhm_mm * fwhm_mm / 16.0,
        };
        (beam + pixel).sqrt()
    }

    /// Light per area that a single bright point leaves at `radius` mm from it, mm⁻²; without any
    /// blur none.
    pub fn density(&self, radius: f64) -> f64 {
        let variance = self.standard_deviation_mm().powi(2);
        match &self.beam {
            _ if variance == 0.0 => 0.0,
            Beam::Measured(spread) => spread.density(radius),
            Beam::Point | Beam::Gaussian { .. } => {
                (-0.5 * radius * radius / variance).exp() / (2.0 * PI * variance)
            }
            // Four times the variance along one axis is the square of its radius.
            Beam::Disk { .. } if radius * radius > 4.0 * variance => 0.0,
            Beam::Disk { .. } => 1.0 / (4.0 * PI * variance),
        }
    }

    /// Distance from a point beyond which it leaves no light that counts, mm.
    fn reach_mm(&self) -> f64 {
        match &self.beam {
            Beam::Measured(spread) => spread.radius_holding(1.0),
            Beam::Disk { .. } => 2.0 * self.standard_deviation_mm(),
            // Beyond six standard deviations lies 1.5e-8 of the light.
            Beam::Point | Beam::Gaussian { .. } => 6.0 * self.standard_deviation_mm(),
        }
    }

    /// Light per area that a point at `radius` from the beam leaves on average on the circle of
    /// radius `s` about the beam, mm⁻².
    fn on_circle(&self, radius: f64, s: f64) -> f64 {
        // Share of the circle that lies within `edge` of the point.
        let arc = |edge: f64| {
            let cos = (radius * radius + (s - edge) * (s + edge)) / (2.0 * radius * s);
            cos.clamp(-1.0, 1.0).acos() / PI
        };
        let area = |inner: f64, outer: f64| PI * (outer - inner) * (outer + inner);
        match &self.beam {
            Beam::Measured(spread) => spread
                .rings()
                .map(|(inner, outer, share)| share / area(inner, outer) * (arc(outer) - arc(inner)))
                .sum(),
            Beam::Disk { .. } => {
                let edge = self.reach_mm();
                arc(edge) / area(0.0, edge)
            }
            Beam::Point | Beam::Gaussian { .. } => {
                let variance = self.standard_deviation_mm().powi(2);
                (-0.5 * (radius - s).powi(2) / variance).exp()
                    * scaled_bessel_i0(radius * s / variance)
                    / (2.0 * PI * variance)
            }
        }
    }

    /// Radius from which a profile can be read although its convolution with the beam is known
    /// no better than the beam is, mm.
    ///
    /// A stated width says nothing of the beam's shape, so four standard deviations are kept
    /// clear of it. A measured one is known from its middle outward: 90 % of its light lie within
    /// the radius.
    pub fn clear_mm(&self) -> f64 {
        match &self.beam {
            Beam::Measured(spread) => spread.radius_holding(MEASURED_CLEAR),
            _ => STATED_CLEAR * self.standard_deviation_mm(),
        }
    }
}

/// Standard deviations of a stated blur that are kept clear.
const STATED_CLEAR: f64 = 4.0;
/// Share of a measured beam that is kept clear.
const MEASURED_CLEAR: f64 = 0.9;

/// Nodes and weights of ∫ `density` over [low, high].
fn legendre(count: usize, low: f64, high: f64, density: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let count = NonZeroUsize::new(count.max(1)).expect("at least 1");
    let (half, mid) = (0.5 * (high - low), 0.5 * (high + low));
    GaussLegendre::new(count)
        .as_node_weight_pairs()
        .iter()
        .map(|(x, w)| {
            let r = mid + half * x;
            (r, w * half * density(r))
        })
        .collect()
}

/// For each datum of a profile, the radii and weights whose sum is the average that it saw.
///
/// A pencil beam's R_d is a function of radius alone. A ring of a blurred picture averages it
/// over a distribution of radii, and the Gauss rule of that very distribution turns the average
/// into a few evaluations, whatever the model and the medium.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprints {
    radii: Vec<f64>,
    weights: Vec<f64>,
    /// Where each datum's run of radii ends.
    ends: Vec<usize>,
}

impl Footprints {
    /// The footprints of the points of a profile: the mean over each ring, or the value at the
    /// radius where a point has no ring.
    pub fn new(points: &[ProfilePoint], blur: &Blur) -> Self {
        let mut footprints = Self {
            radii: vec![],
            weights: vec![],
            ends: vec![],
        };
        let mut fans = Fans { blur, made: vec![] };
        for point in points {
            let rule = match point.ring_mm {
                None => blurred_rule(&[(point.radius_mm, 1.0)], &mut fans),
                Some((inner, outer)) => {
                    let area = 0.5 * (outer * outer - inner * inner);
                    let count = if outer > 1.5 * inner { 8 } else { 4 };
                    let ring = legendre(count, inner, outer, |r| r / area);
                    if blur.standard_deviation_mm() == 0.0 {
                        ring
                    } else {
                        blurred_rule(&ring, &mut fans)
                    }
                }
            };
            for (radius, weight) in rule {
                footprints.radii.push(radius);
                footprints.weights.push(weight);
            }
            footprints.ends.push(footprints.radii.len());
        }
        footprints
    }

    /// Those of some of the points.
    pub fn of(&self, indices: &[usize]) -> Self {
        let mut some = Self {
            radii: vec![],
            weights: vec![],
            ends: Vec::with_capacity(indices.len()),
        };
        for &i in indices {
            let run = if i == 0 { 0 } else { self.ends[i - 1] }..self.ends[i];
            some.radii.extend_from_slice(&self.radii[run.clone()]);
            some.weights.extend_from_slice(&self.weights[run]);
            some.ends.push(some.radii.len());
        }
        some
    }

    /// How many data there are.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no datum.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// What `model` says of every datum, per power that enters, into `out`.
    pub fn reflectance(&self, model: &dyn ForwardModel, at: Coefficients, out: &mut [f64]) {
        self.mean(
            |radii, values| model.diffuse_reflectance(at, radii, values),
            out,
        );
    }

    /// The average that every datum saw of a function of radius, which fills one value for each
    /// radius it is given, into `out`.
    pub fn mean(&self, function: impl FnOnce(&[f64], &mut [f64]), out: &mut [f64]) {
        let mut values = vec![0.0; self.radii.len()];
        function(&self.radii, &mut values);
        debug_assert_eq!(out.len(), self.len());
        let mut start = 0;
        for (out, &end) in out.iter_mut().zip(&self.ends) {
            let pairs = values[start..end].iter().zip(&self.weights[start..end]);
            *out = pairs.map(|(v, w)| v * w).sum();
            start = end;
        }
    }

    /// What `model` says of the data `which`, with derivatives, times `factor`, into `rows`,
    /// which holds as many.
    ///
    /// `scratch` is any vector; it is kept by the caller so that a fit allocates once.
    pub fn reflectance_gradient(
        &self,
        model: &dyn ForwardModel,
        at: Coefficients,
        which: Range<usize>,
        factor: f64,
        scratch: &mut Vec<Gradient>,
        rows: Rows,
    ) {
        debug_assert_eq!(rows.value.len(), which.len());
        let end = |i: usize| if i == 0 { 0 } else { self.ends[i - 1] };
        let (first, last) = (end(which.start), end(which.end));
        scratch.resize(last - first, Gradient::default());
        model.diffuse_reflectance_gradient(at, &self.radii[first..last], scratch);
        let weights = &self.weights[first..last];
        if last - first == which.len() {
            // One radius a datum, of weight 1: nothing to average.
            rows.fill(scratch, factor);
            return;
        }
        let Rows {
            value,
            in_sigma_a,
            in_sigma_s_prime,
        } = rows;
        let out = value.iter_mut().zip(in_sigma_a).zip(in_sigma_s_prime);
        let mut start = 0;
        for (((v, a), s), &end) in out.zip(&self.ends[which]) {
            let nodes = start..end - first;
            let mut sum = Gradient::default();
            for (gradient, &weight) in scratch[nodes.clone()].iter().zip(&weights[nodes]) {
                sum = sum + *gradient * weight;
            }
            *v = factor * sum.value;
            *a = factor * sum.in_sigma_a;
            *s = factor * sum.in_sigma_s_prime;
            start = end - first;
        }
    }
}

/// Values and derivatives of many data, one slice each: what [`Gradient`] is for one.
#[derive(Debug)]
pub struct Rows<'a> {
    /// The values.
    pub value: &'a mut [f64],
    /// ∂/∂σₐ.
    pub in_sigma_a: &'a mut [f64],
    /// ∂/∂σₛ′.
    pub in_sigma_s_prime: &'a mut [f64],
}

impl Rows<'_> {
    /// `gradients` times `factor`.
    pub fn fill(self, gradients: &[Gradient], factor: f64) {
        let out = self.value.iter_mut().zip(self.in_sigma_a);
        for (((v, a), s), gradient) in out.zip(self.in_sigma_s_prime).zip(gradients) {
            *v = factor * gradient.value;
            *a = factor * gradient.in_sigma_a;
            *s = factor * gradient.in_sigma_s_prime;
        }
    }
}

/// A Gauss rule for the distance from the centre of a point drawn from `ring` (radii and
/// weights) and displaced by the blur of `fans`.
fn blurred_rule(ring: &[(f64, f64)], fans: &mut Fans) -> Vec<(f64, f64)> {
    let blur = fans.blur;
    let spread = blur.standard_deviation_mm();
    if spread == 0.0 {
        return ring.to_vec();
    }
    let innermost = ring.iter().fold(f64::INFINITY, |m, (r, _)| m.min(*r));
    let outermost = ring.iter().fold(0.0_f64, |m, (r, _)| m.max(*r));
    // Far out the distribution is narrow beside the radius and a few nodes are exact.
    let relative = (spread + 0.3 * (outermost - innermost)) / outermost.max(spread);
    let (nodes, samples) = match relative {
        x if x < 0.03 => (3, displaced(ring, fans.of(10, 12))),
        x if x < 0.1 => (5, displaced(ring, fans.of(16, 24))),
        x if x < 0.25 => (9, displaced(ring, fans.of(24, 32))),
        _ => (20, about_the_beam(ring, blur)),
    };
    // Toward the beam light that scattered once goes like 1/r: radius times a model is smooth.
    let by_radius: Vec<_> = samples.into_iter().map(|(r, w)| (r, w / r)).collect();
    let mut rule = gauss_rule(&by_radius, nodes);
    for (radius, weight) in &mut rule {
        *weight *= *radius;
    }
    rule
}

/// A displacement: the square of its length, twice its part outward, and its weight.
#[derive(Clone, Copy)]
struct Displacement {
    square: f64,
    outward: f64,
    weight: f64,
}

/// What a blur displaces by, made once for all rings that want as many.
struct Fans<'a> {
    blur: &'a Blur,
    made: Vec<((usize, usize), Vec<Displacement>)>,
}

impl Fans<'_> {
    /// `fine` distances in `angles` directions.
    fn of(&mut self, fine: usize, angles: usize) -> &[Displacement] {
        let size = (fine, angles);
        let made = match self.made.iter().position(|(other, _)| *other == size) {
            Some(made) => made,
            None => {
                let lengths = self.blur.displacements(fine);
                let fan = lengths.into_iter().flat_map(|(length, weight)| {
                    // The trapezoidal rule over a period converges faster than any power.
                    (0..angles).map(move |step| Displacement {
                        square: length * length,
                        outward: 2.0 * length * (PI * (step as f64 + 0.5) / angles as f64).cos(),
                        weight: weight / angles as f64,
                    })
                });
                self.made.push((size, fan.collect()));
                self.made.len() - 1
            }
        };
        &self.made[made].1
    }
}

/// `ring`, each radius displaced by every one of `fan`.
fn displaced(ring: &[(f64, f64)], fan: &[Displacement]) -> Vec<(f64, f64)> {
    let samples = ring.iter().flat_map(|&(radius, ring_weight)| {
        fan.iter().map(move |by| {
            let square = radius * radius + by.square + radius * by.outward;
            (square.max(0.0).sqrt(), ring_weight * by.weight)
        })
    });
    samples.collect()
}

/// The same by what the blur about each radius leaves on circles about the beam: displacements
/// that reach the beam itself would sample the steep light there by chance.
fn about_the_beam(ring: &[(f64, f64)], blur: &Blur) -> Vec<(f64, f64)> {
    let reach = blur.reach_mm();
    let mut samples = vec![];
    for &(radius, ring_weight) in ring {
        let (low, high) = ((radius - reach).max(0.0), radius + reach);
        let start = samples.len();
        let width = (high - low) / f64::from(PANELS);
        for panel in 0..PANELS {
            let from = low + f64::from(panel) * width;
            samples.extend(legendre(NODES_PER_PANEL, from, from + width, |s| {
                2.0 * PI * s * blur.on_circle(radius, s)
            }));
        }
        let sum: f64 = samples[start..].iter().map(|(_, w)| w).sum();
        for (_, weight) in &mut samples[start..] {
            *weight *= ring_weight / sum;
        }
    }
    samples
}

/// Panels of a blur across its reach, and nodes in each.
const PANELS: u32 = 16;
const NODES_PER_PANEL: usize = 8;

/// Samples that are worked on together: partial sums let the compiler use vector registers, which
/// one running sum would not.
const LANES: usize = 8;

/// Some samples of a measure, with the last two of its polynomials there; those that fill the last
/// block up have no weight.
#[derive(Clone, Copy)]
struct Block {
    x: [f64; LANES],
    weight: [f64; LANES],
    current: [f64; LANES],
    previous: [f64; LANES],
}

impl Block {
    /// Before the first polynomial, which is 1.
    fn of(samples: &[(f64, f64)], mean: f64, spread: f64) -> Self {
        let mut block = Self {
            x: [0.0; LANES],
            weight: [0.0; LANES],
            current: [1.0; LANES],
            previous: [0.0; LANES],
        };
        for (i, (x, weight)) in samples.iter().enumerate() {
            block.x[i] = (x - mean) / spread;
            block.weight[i] = *weight;
        }
        block
    }
}

/// Σ w p² and Σ w x p² of the polynomials of `blocks`.
fn sums(blocks: &[Block]) -> (f64, f64) {
    let (mut norm, mut moment) = ([0.0; LANES], [0.0; LANES]);
    for block in blocks {
        for i in 0..LANES {
            let square = block.weight[i] * block.current[i] * block.current[i];
            norm[i] += square;
            moment[i] += square * block.x[i];
        }
    }
    (norm.iter().sum(), moment.iter().sum())
}

/// The same of the next ones, (x − a) p − below·previous.
fn advance(blocks: &mut [Block], a: f64, below: f64) -> (f64, f64) {
    let (mut norm, mut moment) = ([0.0; LANES], [0.0; LANES]);
    for block in blocks {
        for i in 0..LANES {
            let next = (block.x[i] - a) * block.current[i] - below * block.previous[i];
            block.previous[i] = std::mem::replace(&mut block.current[i], next);
            let square = block.weight[i] * next * next;
            norm[i] += square;
            moment[i] += square * block.x[i];
        }
    }
    (norm.iter().sum(), moment.iter().sum())
}

/// The Gauss rule with `count` nodes of a discrete measure (Stieltjes' procedure, then the
/// eigenvalues of the Jacobi matrix after Golub and Welsch 1969).
fn gauss_rule(samples: &[(f64, f64)], count: usize) -> Vec<(f64, f64)> {
    let total: f64 = samples.iter().map(|(_, w)| w).sum();
    let mean = samples.iter().map(|(x, w)| x * w).sum::<f64>() / total;
    let spread = (samples
        .iter()
        .map(|(x, w)| w * (x - mean).powi(2))
        .sum::<f64>()
        / total)
        .sqrt();
    if spread <= 1e-12 * mean.abs() {
        return vec![(mean, total)];
    }
    // In units of the spread about the mean, so that the recurrence stays near 1.
    let mut blocks: Vec<Block> = samples
        .chunks(LANES)
        .map(|samples| Block::of(samples, mean, spread))
        .collect();
    let (mut norm, mut moment) = sums(&blocks);
    let mut below = 0.0;
    let mut jacobi = DMatrix::zeros(count, count);
    let mut size = 0;
    for i in 0..count {
        let a = moment / norm;
        jacobi[(i, i)] = a;
        size = i + 1;
        if size == count {
            break;
        }
        let (next_norm, next_moment) = advance(&mut blocks, a, below);
        below = next_norm / norm;
        if below <= 1e-14 {
            break;
        }
        (norm, moment) = (next_norm, next_moment);
        jacobi[(i, i + 1)] = below.sqrt();
        jacobi[(i + 1, i)] = below.sqrt();
    }
    let eigen = jacobi
        .view((0, 0), (size, size))
        .into_owned()
        .symmetric_eigen();
    let mut rule: Vec<(f64, f64)> = eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.row(0).iter())
        // A node may fall a rounding error below 0, where no radius is.
        .map(|(node, first)| ((mean + spread * node).abs(), total * first * first))
        .collect();
    rule.sort_by(|a, b| a.0.total_cmp(&b.0));
    rule
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::{Dipole, DipoleModel};
    use crate::fresnel::DiffuseFresnel;
    use crate::medium::ReducedMedium;
    use crate::profile::mean_radius;

    const MARBLE: ReducedMedium = ReducedMedium {
        sigma_a: 0.0041,
        sigma_s_prime: 2.62,
        eta: 1.5,
    };

    fn ring(inner: f64, outer: f64) -> ProfilePoint {
        ProfilePoint {
            ring_mm: Some((inner, outer)),
            radius_mm: mean_radius(inner, outer),
            reflectance_per_mm2: 0.0,
            u_reflectance_per_mm2: 0.0,
            pixels: None,
        }
    }

    fn seen(medium: &ReducedMedium, points: &[ProfilePoint], blur: &Blur) -> Vec<f64> {
        let mut out = vec![0.0; points.len()];
        let model = DipoleModel::new(medium.eta, DiffuseFresnel::Exact);
        Footprints::new(points, blur).reflectance(&model, medium.coefficients(), &mut out);
        out
    }

    #[test]
    fn a_point_keeps_its_light_under_every_blur() {
        let disk = Beam::Disk { fwhm_mm: 0.8 };
        for beam in [Beam::Point, Beam::Gaussian { fwhm_mm: 0.5 }, disk] {
            let blur = Blur {
                beam,
                pixel_mm: 0.05,
            };
            let density = |r: f64| 2.0 * PI * r * blur.density(r);
            let steps = (0..20_000).map(|i| 1e-4 * (f64::from(i) + 0.5));
            let all: f64 = steps.map(|r| 1e-4 * density(r)).sum();
            assert!((all - 1.0).abs() < 1e-3, "{blur:?}: {all}");
        }
        assert_eq!(Blur::NONE.density(0.0), 0.0);
    }

    #[test]
    fn a_ring_without_blur_is_the_difference_of_what_lies_beyond() {
        let dipole = Dipole::new(&MARBLE, DiffuseFresnel::Exact);
        for (inner, outer) in [(0.0, 0.1), (0.5, 0.6), (1.0, 1.4), (10.0, 10.5)] {
            let got = seen(&MARBLE, &[ring(inner, outer)], &Blur::NONE)[0];
            let area = PI * (outer * outer - inner * inner);
            let expected = (dipole.beyond(inner) - dipole.beyond(outer)) / area;
            assert!(
                (got / expected - 1.0).abs() < 1e-7,
                "{inner}-{outer}: {got} for {expected}"
            );
        }
    }

    /// The convolution as a plain double sum over the plane, in Cartesian coordinates.
    fn brute_force(medium: &ReducedMedium, radius: f64, sigma: f64, pixel: f64) -> f64 {
        let dipole = Dipole::new(medium, DiffuseFresnel::Exact);
        let (steps, reach) = (700, 6.5 * sigma);
        let h = 2.0 * reach / steps as f64;
        let subpixels = [-0.339_98, -0.861_14, 0.339_98, 0.861_14]
            .into_iter()
            .zip([0.326_07, 0.173_93, 0.326_07, 0.173_93]);
        let (mut sum, mut norm) = (0.0, 0.0);
        for i in 0..steps {
            for j in 0..steps {
                let x = -reach + (i as f64 + 0.5) * h;
                let y = -reach + (j as f64 + 0.5) * h;
                let w = (-0.5 * (x * x + y * y) / (sigma * sigma)).exp();
                norm += w;
                // One row of subpixels along each axis in turn serves the second order.
                for (s, sw) in subpixels.clone() {
                    for (t, tw) in subpixels.clone() {
                        let (px, py) = (0.5 * pixel * s, 0.5 * pixel * t);
                        let r = (radius + x + px).hypot(y + py);
                        sum += w * sw * tw * dipole.diffuse_reflectance(r);
                    }
                }
            }
        }
        sum / norm
    }

    #[test]
    fn a_blurred_point_is_the_convolution() {
        let fwhm_mm = 0.3;
        let sigma = fwhm_mm / (8.0 * LN_2).sqrt();
        let white = ReducedMedium {
            sigma_a: 1e-5,
            sigma_s_prime: 11.6,
            eta: 1.3,
        };
        let blur = Blur {
            beam: Beam::Gaussian { fwhm_mm },
            pixel_mm: 0.04,
        };
        for (medium, radius, tolerance) in [
            (MARBLE, 0.0, 1e-4),
            (MARBLE, 0.3, 1e-5),
            (MARBLE, 1.1, 1e-6),
            (white, 0.5, 1e-4),
            (white, 2.0, 1e-6),
        ] {
            let point = ProfilePoint {
                ring_mm: None,
                radius_mm: radius,
                ..ring(0.0, 1.0)
            };
            let got = seen(&medium, &[point], &blur)[0];
            let expected = brute_force(&medium, radius, sigma, 0.04);
            assert!(
                (got / expected - 1.0).abs() < tolerance,
                "{medium:?}, r = {radius}: {got} for {expected}"
            );
        }
    }

    #[test]
    fn nodes_do_not_matter_where_the_fit_looks() {
        // The same average with every ring cut into thin ones that are blurred by many nodes.
        let blur = Blur {
            beam: Beam::Gaussian { fwhm_mm: 0.3 },
            pixel_mm: 0.04,
        };
        for (inner, outer) in [(0.8, 0.9), (2.0, 2.1), (6.0, 6.3), (19.0, 20.0)] {
            let got = seen(&MARBLE, &[ring(inner, outer)], &blur)[0];
            let model = DipoleModel::new(MARBLE.eta, DiffuseFresnel::Exact);
            let mut expected = 0.0;
            for (r, w) in legendre(12, inner, outer, |r| {
                2.0 * r / (outer * outer - inner * inner)
            }) {
                for (d, dw) in blur.displacements(48) {
                    for step in 0..64 {
                        let cos = (PI * (f64::from(step) + 0.5) / 64.0).cos();
                        let radius = (r * r + d * d + 2.0 * r * d * cos).sqrt();
                        let mut value = [0.0];
                        model.diffuse_reflectance(MARBLE.coefficients(), &[radius], &mut value);
                        expected += w * dw / 64.0 * value[0];
                    }
                }
            }
            assert!(
                (got / expected - 1.0).abs() < 1e-7,
                "{inner}-{outer}: {got} for {expected}"
            );
        }
    }

    #[test]
    fn a_disk_keeps_its_second_moment() {
        let blur = Blur {
            beam: Beam::Disk { fwhm_mm: 0.8 },
            pixel_mm: 0.0,
        };
        let moment: f64 = blur.displacements(20).iter().map(|(d, w)| w * d * d).sum();
        assert!((moment - 0.5 * 0.4 * 0.4).abs() < 1e-12, "{moment}");
        let blur = Blur {
            beam: Beam::Gaussian { fwhm_mm: 0.8 },
            pixel_mm: 0.1,
        };
        let moment: f64 = blur.displacements(40).iter().map(|(d, w)| w * d * d).sum();
        assert!((moment / (2.0 * blur.standard_deviation_mm().powi(2)) - 1.0).abs() < 1e-5);
    }
}
