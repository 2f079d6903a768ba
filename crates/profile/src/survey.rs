//! One pass after another over a picture's pixels, until its rings are known.

use crate::center::{self, NEEDED_PX, SPARSE};
use crate::curve::{AREA, Curve, Moments};
use crate::error::ProfileError;
use crate::radial::{Measured, ProfileOptions, check_options};
use crate::rings::{Rings, Run};
use crate::sweep::{GROUPS, Sweep};
use crate::view::{Places, View};
use physics::profile::mean_radius;
use physics::{ChannelMap, ProfilePoint, RadialProfile, TotalReflectance};

/// Residuals beyond this many standard uncertainties count as so many in the ring's scatter.
const FAR: f64 = 20.0;

/// Mean of |z| for a standard Gaussian, √(2/π).
const MEAN_ABSOLUTE: f64 = 0.797_884_560_802_865_4;

/// Radius of the core, px, whose total is the sum of its pixels.
const CORE_PX: f64 = 8.0;

/// Radius inside which rings are least certain, px: what the core's rings lack of its total is
/// theirs.
const HEART_PX: f64 = 2.0;

/// A picture averaged over rings, in its own unit, and lengths in pixels at the centre.
pub(crate) struct Survey {
    /// Centre, px.
    pub(crate) center: [f64; 2],
    /// The length of a pixel there, mm.
    pub(crate) unit_mm: f64,
    /// Places of the pixels where they are not equal squares.
    places: Option<Places>,
    pub(crate) rings: Rings,
    pub(crate) curve: Curve,
    pub(crate) limits: Vec<Limit>,
    means: Vec<f64>,
    u: Vec<f64>,
    pixels: Vec<u64>,
    rejected: u64,
    unmeasured: u64,
    unseen_share: f64,
    scatter: f64,
}

/// How far from its ring's curve a pixel may lie.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Limit {
    /// In units of the pixel's standard uncertainty.
    pub(crate) relative: f64,
    /// On top of that: how well the curve is known where it is steep.
    pub(crate) slack: f64,
}

impl Limit {
    pub(crate) fn allows(&self, residual: f64, variance: f64) -> bool {
        residual.abs() <= self.relative * variance.sqrt() + self.slack
    }
}

/// Sums over the accepted pixels of a ring.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: u64,
    area: f64,
    value: f64,
    variance: f64,
    tau: [f64; 3],
}

impl Sums {
    /// Adds a pixel, as much as it sees of the surface.
    fn add(&mut self, p: &Pixel) {
        self.count += 1;
        self.area += p.area;
        self.value += p.area * p.value;
        self.variance += p.area * p.area * p.variance;
        let square = p.tau * p.tau;
        for (sum, power) in self.tau.iter_mut().zip([p.tau, square, square * p.tau]) {
            *sum += p.area * power;
        }
    }

    fn mean(&self) -> f64 {
        self.value / self.area
    }

    fn u(&self) -> f64 {
        self.variance.sqrt() / self.area
    }

    fn moments(&self) -> Moments {
        let [a, b, c] = self.tau.map(|sum| sum / self.area);
        [1.0, a, b, c]
    }
}

/// One pixel inside the circle.
#[derive(Clone, Copy)]
pub(crate) struct Pixel {
    pub(crate) index: usize,
    pub(crate) ring: usize,
    /// Square of the distance from the centre in its ring, scaled to [−1, 1].
    pub(crate) tau: f64,
    /// What it sees of the surface, over what a pixel at the centre sees.
    pub(crate) area: f64,
    pub(crate) value: f64,
    /// Infinite where it was not measured.
    pub(crate) variance: f64,
}

impl Survey {
    pub(crate) fn new(
        channel: &ChannelMap,
        width: usize,
        height: usize,
        options: &ProfileOptions,
    ) -> Result<Self, ProfileError> {
        check_options(options)?;
        let checked = center::Picture::checked(channel, width, height)?;
        let center = match options.center_px {
            Some(center) => center,
            None => checked.center()?,
        };
        let [x, y] = center;
        let unit_mm = options.view.mm_per_pixel(center);
        let places = match options.view.square_mm() {
            Some(_) => None,
            None => Some(options.view.about(center, unit_mm)),
        };
        let radius = match &places {
            None => {
                let (right, below) = (width as f64 - 0.5 - x, height as f64 - 0.5 - y);
                right.min(below).min(x + 0.5).min(y + 0.5)
            }
            Some(places) => full_circle(&options.view, places, center, (width, height))?,
        };
        if !(x.is_finite() && y.is_finite() && radius >= NEEDED_PX) {
            return Err(ProfileError::SpotAtEdge {
                x,
                y,
                width,
                height,
                needed: NEEDED_PX,
            });
        }
        // Scattered photosites want wider rings, so that every ring has as many of them.
        let spacing = if checked.share < SPARSE {
            checked.share.sqrt().recip()
        } else {
            1.0
        };
        let min_width = options.min_width_px * spacing;
        let rings = Rings::new(radius, options.relative_width, min_width);
        let picture = Picture {
            channel,
            size: (width, height),
            center,
            rings: &rings,
            places: places.as_ref(),
        };
        let count = rings.len();
        // Where rings have many pixels, a part of them tells enough of the first mean and of the
        // scatter; should the rest be all that was measured, all have to.
        let mut thinned = true;
        let mut first = picture.pass(None, Bounds::None, thinned);
        if first.sums.iter().any(|s| s.count == 0) {
            thinned = false;
            first = picture.pass(None, Bounds::None, thinned);
        }
        if let Some(ring) = first.sums.iter().position(|s| s.count == 0) {
            return Err(unmeasured_ring(&rings, ring, unit_mm));
        }
        let first_means = first.medians();
        let u: Vec<f64> = first.sums.iter().map(Sums::u).collect();
        let moments: Vec<Moments> = first.sums.iter().map(Sums::moments).collect();
        let floor = floor_of(&u, &first_means);
        let curve = Curve::through(&rings, &first_means, &moments, floor);

        // How much the pixels scatter about their curve; the far ones are cut off, not left out.
        let slack = slacks(&rings, &first_means);
        let wide = picture.pass(Some(&curve), Bounds::Wide(&slack), thinned);
        let mut scatter: Vec<f64> = wide
            .scatter
            .iter()
            .zip(&wide.measured)
            .map(|(scatter, measured)| scatter / (MEAN_ABSOLUTE * *measured as f64))
            .collect();
        // A ring that lost all its pixels keeps its first mean.
        let (means, moments): (Vec<f64>, Vec<Moments>) = (0..count)
            .map(|ring| match &wide.sums[ring] {
                sums if sums.count == 0 => (first_means[ring], moments[ring]),
                sums => (sums.mean(), sums.moments()),
            })
            .unzip();
        let curve = Curve::through(&rings, &means, &moments, floor);

        // A glow that is not round scatters more than its noise: that is no reason to reject.
        let limits: Vec<Limit> = scatter
            .iter()
            .zip(slacks(&rings, &means))
            .map(|(scatter, slack)| Limit {
                relative: options.clip * scatter.max(1.0),
                slack,
            })
            .collect();
        let last = picture.pass(Some(&curve), Bounds::Limits(&limits), false);
        let sums = &last.sums;
        if let Some(ring) = sums.iter().position(|s| s.count == 0) {
            return Err(unmeasured_ring(&rings, ring, unit_mm));
        }
        let pixel_means: Vec<f64> = sums.iter().map(Sums::mean).collect();
        let moments: Vec<Moments> = sums.iter().map(Sums::moments).collect();
        let curve = Curve::through(&rings, &pixel_means, &moments, floor);
        let mut means: Vec<f64> = (0..count)
            .map(|ring| {
                pixel_means[ring] - curve.mean(ring, &moments[ring]) + curve.mean(ring, &AREA)
            })
            .collect();
        picture.settle_core(&curve, &limits, &mut means);
        scatter.sort_by(f64::total_cmp);
        let light = |share: &dyn Fn(usize) -> f64| -> f64 {
            (0..count)
                .map(|ring| rings.area(ring) * means[ring].max(0.0) * share(ring))
                .sum()
        };
        let unseen = |ring: usize| (1.0 - sums[ring].area / last.inside[ring]).max(0.0);
        let unseen_share = light(&unseen) / light(&|_| 1.0).max(f64::MIN_POSITIVE);
        Ok(Self {
            center,
            unit_mm,
            places,
            unseen_share,
            u: sums.iter().map(Sums::u).collect(),
            pixels: sums.iter().map(|s| s.count).collect(),
            scatter: scatter[count / 2],
            rings,
            curve,
            limits,
            means,
            rejected: last.measured.iter().sum::<u64>() - sums.iter().map(|s| s.count).sum::<u64>(),
            unmeasured: last.unmeasured,
        })
    }

    /// Calls `visit` with every measured pixel inside the circle.
    pub(crate) fn for_each_pixel(
        &self,
        channel: &ChannelMap,
        size: (usize, usize),
        visit: impl FnMut(Pixel),
    ) {
        let picture = Picture {
            channel,
            size,
            center: self.center,
            rings: &self.rings,
            places: self.places.as_ref(),
        };
        picture.for_each_pixel(visit);
    }

    /// The result in mm, if it does not hold more light than came in.
    pub(crate) fn checked(
        &self,
        channel: &ChannelMap,
        options: &ProfileOptions,
    ) -> Result<Measured, ProfileError> {
        let measured = self.measured(channel, options);
        let total = &measured.total;
        let u = total
            .u_total_reflectance
            .hypot(total.u_scale_relative * total.total_reflectance);
        if total.total_reflectance > 1.0 + 3.0 * u {
            let pixel = self.unit_mm * self.unit_mm;
            let white_sum = 1.0 / (options.factor_per_mm2 * pixel);
            return Err(ProfileError::ReferenceDarker {
                sample_sum: total.total_reflectance * white_sum,
                white_sum,
            });
        }
        Ok(measured)
    }

    /// The result in mm.
    pub(crate) fn measured(&self, channel: &ChannelMap, options: &ProfileOptions) -> Measured {
        let (mm, factor) = (self.unit_mm, options.factor_per_mm2);
        let points: Vec<ProfilePoint> = (0..self.rings.len())
            .map(|ring| {
                let (inner, outer) = self.rings.edges(ring);
                let (inner, outer) = (inner * mm, outer * mm);
                ProfilePoint {
                    ring_mm: Some((inner, outer)),
                    radius_mm: mean_radius(inner, outer),
                    reflectance_per_mm2: self.means[ring] * factor,
                    u_reflectance_per_mm2: self.u[ring] * factor,
                    pixels: Some(self.pixels[ring]),
                }
            })
            .collect();
        let area_times =
            |f: fn(&ProfilePoint) -> f64| points.iter().map(move |p| p.area_mm2() * f(p));
        let total = TotalReflectance {
            channel: channel.name.clone(),
            total_reflectance: area_times(|p| p.reflectance_per_mm2).sum(),
            u_total_reflectance: area_times(|p| p.u_reflectance_per_mm2)
                .map(|u| u * u)
                .sum::<f64>()
                .sqrt(),
            radius_max_mm: points
                .last()
                .and_then(|p| p.ring_mm)
                .map(|(_, outer)| outer),
            u_scale_relative: options.u_scale_relative,
            u_offset_per_mm2: 0.0,
        };
        Measured {
            profile: RadialProfile {
                channel: channel.name.clone(),
                points,
            },
            total,
            center_px: self.center,
            rejected_pixels: self.rejected,
            unmeasured_pixels: self.unmeasured,
            unseen_share: self.unseen_share,
            relative_scatter: self.scatter,
        }
    }
}

/// Which pixels count in a pass.
#[derive(Clone, Copy)]
enum Bounds<'a> {
    /// All that were measured.
    None,
    /// Those within [`FAR`] standard uncertainties and a slack; how much all of them scatter is
    /// found as well.
    Wide(&'a [f64]),
    /// Those within the limit of their ring.
    Limits(&'a [Limit]),
}

/// What a pass over the pixels found in each ring.
struct Pass {
    sums: Vec<Sums>,
    /// Area and value of groups of the pixels that counted.
    groups: Vec<[(f64, f64); GROUPS]>,
    /// Σ|residual|/u of the measured pixels, cut off at [`FAR`].
    scatter: Vec<f64>,
    measured: Vec<u64>,
    /// Area of all pixels, measured or not.
    inside: Vec<f64>,
    /// Pixels that were not measured, in all rings.
    unmeasured: u64,
}

impl Pass {
    fn empty(rings: usize) -> Self {
        Self {
            sums: vec![Sums::default(); rings],
            groups: vec![[(0.0, 0.0); GROUPS]; rings],
            scatter: vec![0.0; rings],
            measured: vec![0; rings],
            inside: vec![0.0; rings],
            unmeasured: 0,
        }
    }

    /// The median over the groups of each ring of their mean: up to three groups may hold
    /// outliers of any size.
    fn medians(&self) -> Vec<f64> {
        let median = |groups: &[(f64, f64); GROUPS]| {
            let mut means: Vec<f64> = groups
                .iter()
                .filter(|(area, _)| *area > 0.0)
                .map(|(area, sum)| sum / area)
                .collect();
            means.sort_by(f64::total_cmp);
            let n = means.len();
            0.5 * (means[n / 2] + means[(n - 1) / 2])
        };
        self.groups.iter().map(median).collect()
    }
}

struct Picture<'a> {
    channel: &'a ChannelMap,
    size: (usize, usize),
    center: [f64; 2],
    rings: &'a Rings,
    places: Option<&'a Places>,
}

impl Picture<'_> {
    /// Calls `visit` with every pixel of a run.
    fn pixels_of(&self, run: &Run, visit: &mut impl FnMut(Pixel)) {
        let (middle, half) = self.rings.square(run.ring);
        let offset = run.dy * run.dy - middle;
        let mut dx = run.dx;
        for index in run.pixels.clone() {
            visit(Pixel {
                index,
                ring: run.ring,
                tau: (dx * dx + offset) / half,
                area: 1.0,
                value: f64::from(self.channel.value[index]),
                variance: f64::from(self.channel.variance[index]),
            });
            dx += 1.0;
        }
    }

    /// Calls `visit` with every pixel in the first `rings` rings, measured or not.
    fn for_each_inside(&self, rings: usize, mut visit: impl FnMut(Pixel)) {
        let Some(places) = self.places else {
            let (width, height) = self.size;
            let mut runs = vec![];
            for y in 0..height {
                for run in (self.rings).runs_of_row(width, self.center, y, rings, &mut runs) {
                    self.pixels_of(run, &mut visit);
                }
            }
            return;
        };
        let squares: Vec<(f64, f64)> = (0..rings).map(|ring| self.rings.square(ring)).collect();
        let (width, height) = self.size;
        // Neighbours lie in the same ring or the next.
        let mut ring = 0;
        for y in 0..height {
            for x in 0..width {
                let ([across, down], area) = places.at(x as f64, y as f64);
                let square = across * across + down * down;
                while ring > 0 && square < squares[ring].0 - squares[ring].1 {
                    ring -= 1;
                }
                while ring < rings && square >= squares[ring].0 + squares[ring].1 {
                    ring += 1;
                }
                if ring == rings {
                    ring -= 1;
                    continue;
                }
                let (middle, half) = squares[ring];
                let index = y * width + x;
                visit(Pixel {
                    index,
                    ring,
                    tau: (square - middle) / half,
                    area,
                    value: f64::from(self.channel.value[index]),
                    variance: f64::from(self.channel.variance[index]),
                });
            }
        }
    }

    /// Calls `visit` with every measured pixel.
    fn for_each_pixel(&self, mut visit: impl FnMut(Pixel)) {
        self.for_each_inside(self.rings.len(), |p| {
            if p.variance.is_finite() {
                visit(p);
            }
        });
    }

    /// Adds up the pixels of each ring that are within `bounds` about `curve`; where there are
    /// many, `thinned` allows for a part of them.
    fn pass(&self, curve: Option<&Curve>, bounds: Bounds<'_>, thinned: bool) -> Pass {
        if self.places.is_some() {
            return self.pass_by_pixel(curve, bounds);
        }
        self.pass_in_lanes(curve, bounds, thinned)
    }

    /// The definition.
    fn pass_by_pixel(&self, curve: Option<&Curve>, bounds: Bounds<'_>) -> Pass {
        let count = self.rings.len();
        let mut pass = Pass::empty(count);
        self.for_each_inside(count, |p| {
            // A photosite of another colour is no loss.
            if p.value.is_nan() {
                return;
            }
            pass.inside[p.ring] += p.area;
            if !p.variance.is_finite() {
                pass.unmeasured += 1;
                return;
            }
            pass.measured[p.ring] += 1;
            let residual = p.value - curve.map_or(0.0, |curve| curve.at(p.ring, p.tau));
            let good = match bounds {
                Bounds::None => true,
                Bounds::Limits(limits) => limits[p.ring].allows(residual, p.variance),
                Bounds::Wide(slack) => {
                    let u = p.variance.sqrt().max(f64::MIN_POSITIVE);
                    pass.scatter[p.ring] += (residual.abs() / u).min(FAR);
                    residual.abs() <= FAR * u + slack[p.ring]
                }
            };
            if good {
                // A third of the row's number makes neighbours of either direction differ.
                let group = (p.index + 3 * (p.index / self.size.0)) % GROUPS;
                let (area, sum) = &mut pass.groups[p.ring][group];
                *area += p.area;
                *sum += p.area * p.value;
                pass.sums[p.ring].add(&p);
            }
        });
        pass
    }

    /// The same for equal squares, many at a time.
    fn pass_in_lanes(&self, curve: Option<&Curve>, bounds: Bounds<'_>, thinned: bool) -> Pass {
        let wide: Vec<Limit>;
        let (limits, far) = match bounds {
            Bounds::None => (None, None),
            Bounds::Limits(limits) => (Some(limits), None),
            Bounds::Wide(slack) => {
                let limit = |slack: &f64| Limit {
                    relative: FAR,
                    slack: *slack,
                };
                wide = slack.iter().map(limit).collect();
                (Some(wide.as_slice()), Some(FAR))
            }
        };
        let sweep = Sweep {
            channel: self.channel,
            size: self.size,
            center: self.center,
            rings: self.rings,
            curve,
            limits,
            far,
            thinned,
        };
        let mut pass = Pass::empty(self.rings.len());
        for (ring, tally) in sweep.tallies().iter().enumerate() {
            let count = tally.count();
            let mut sums = Sums {
                count: count as u64,
                area: count,
                value: tally.residual(),
                variance: tally.variance(),
                tau: tally.tau(),
            };
            if let Some(curve) = curve
                && count > 0.0
            {
                sums.value += count * curve.mean(ring, &sums.moments());
            }
            pass.sums[ring] = sums;
            pass.groups[ring] = tally.groups();
            pass.scatter[ring] = tally.scatter();
            pass.measured[ring] = tally.measured() as u64;
            pass.inside[ring] = tally.inside();
            pass.unmeasured += (tally.inside() - tally.measured()) as u64;
        }
        pass
    }

    /// Makes the total of the innermost rings that of their pixels.
    ///
    /// A spot not much wider than a pixel is more than any curve through rings can follow. But
    /// pixels tile the plane, so that the sum over a disk is exact up to the pixels that its rim
    /// cuts, and a Gaussian with the curve's value and slope at the rim accounts for those: the
    /// sum of the differences is exact because they vanish there, and the Gaussian's own
    /// integral is known. What is left over goes to the innermost rings, in proportion to what they hold.
    fn settle_core(&self, curve: &Curve, limits: &[Limit], means: &mut [f64]) {
        let core = (0..self.rings.len())
            .take_while(|ring| self.rings.edges(*ring).1 <= CORE_PX)
            .count();
        let Some(last) = core.checked_sub(1) else {
            return;
        };
        let held: f64 = (0..core)
            .map(|ring| self.rings.area(ring) * means[ring])
            .sum();
        let rim = self.rings.edges(last).1;
        let (_, half) = self.rings.square(last);
        let value = curve.at(last, 1.0);
        // Twice the distance over which the slope is taken is a hundredth of the ring.
        let decay = (curve.at(last, 0.98) / value).ln() / (0.02 * half);
        // A rim in the noise, or a glow that rises outwards, has no Gaussian to speak of.
        if !(held > 0.0 && decay.is_finite() && (0.0..2.0).contains(&(decay * rim))) {
            return;
        }
        let gaussian = |square: f64| value * (decay * (rim * rim - square)).exp();
        let (mut sum, mut residuals) = (0.0, 0.0);
        let (mut area, mut seen) = (0.0, 0.0);
        self.for_each_inside(core, |p| {
            let (middle, half) = self.rings.square(p.ring);
            let expected = curve.at(p.ring, p.tau);
            sum += p.area * (expected - gaussian(middle + half * p.tau));
            area += p.area;
            if p.variance.is_finite() && limits[p.ring].allows(p.value - expected, p.variance) {
                residuals += p.area * (p.value - expected);
                seen += p.area;
            }
        });
        // What was seen stands for what was not, the photosites of other colours above all.
        if seen > 0.0 {
            sum += residuals * area / seen;
        }
        let integral = if decay * rim * rim > 1e-9 {
            std::f64::consts::PI / decay * value * (decay * rim * rim).exp_m1()
        } else {
            std::f64::consts::PI * rim * rim * value
        };
        let heart = (0..core)
            .take_while(|ring| self.rings.edges(*ring).0 < HEART_PX)
            .count();
        let there: f64 = (0..heart)
            .map(|ring| self.rings.area(ring) * means[ring])
            .sum();
        if there > 0.0 {
            for mean in &mut means[..heart] {
                *mean *= 1.0 + (sum + integral - held) / there;
            }
        }
    }
}

/// Radius of the largest circle about `center` that the picture holds, in units of `places`.
fn full_circle(
    view: &View,
    places: &Places,
    center: [f64; 2],
    (width, height): (usize, usize),
) -> Result<f64, ProfileError> {
    let (right, bottom) = (width as f64 - 0.5, height as f64 - 0.5);
    let corners = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]];
    if !corners.iter().all(|c| view.is_in_front(*c)) {
        return Err(ProfileError::Horizon);
    }
    let [x, y] = center;
    if !((-0.5..right).contains(&x) && (-0.5..bottom).contains(&y)) {
        // No circle; whoever asked says so.
        return Ok(f64::NEG_INFINITY);
    }
    // The border of the picture is four straight lines on the surface as well.
    let distance = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % 4]);
        let (a, b) = (places.at(a[0], a[1]).0, places.at(b[0], b[1]).0);
        (a[0] * b[1] - a[1] * b[0]).abs() / (b[0] - a[0]).hypot(b[1] - a[1])
    };
    Ok((0..4).map(distance).fold(f64::INFINITY, f64::min))
}

/// What the curve may be off in each ring: a share of the step to the neighbouring rings. The
/// curve itself errs by a thousandth of that beyond a few pixels, a centre 0.03 px off by 0.02;
/// near the centre the picture is steeper than rings can follow.
fn slacks(rings: &Rings, means: &[f64]) -> Vec<f64> {
    (0..rings.len())
        .map(|ring| {
            let inner = means[ring.saturating_sub(1)];
            let outer = means[(ring + 1).min(rings.len() - 1)];
            let step = (inner - means[ring]).abs().max((means[ring] - outer).abs());
            let radius = rings.square(ring).0.sqrt();
            step * (0.05 + (3.0 / radius).powi(2)).min(1.0)
        })
        .collect()
}

/// Where the curve turns from logarithmic to linear: at a few standard uncertainties of a ring.
fn floor_of(u: &[f64], means: &[f64]) -> f64 {
    let mut sorted = u.to_vec();
    sorted.sort_by(f64::total_cmp);
    let largest = means.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    (2.0 * sorted[sorted.len() / 2])
        .max(1e-9 * largest)
        .max(f64::MIN_POSITIVE)
}

fn unmeasured_ring(rings: &Rings, ring: usize, unit_mm: f64) -> ProfileError {
    let (inner, outer) = rings.edges(ring);
    ProfileError::UnmeasuredRing {
        inner_mm: inner * unit_mm,
        outer_mm: outer * unit_mm,
    }
}

#[cfg(test)]
mod tests;
