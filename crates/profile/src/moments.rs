//! Centre and width of a beam by the moments of its picture, after ISO 11146.

use crate::center::{Peak, Picture, SPARSE};
use crate::error::ProfileError;
use physics::ChannelMap;

/// Side of each of the four corners in which [`Background::Threshold`] looks first, over that of
/// the picture; ISO/TR 11146-3 recommends 2 to 5 %.
const CORNER: f64 = 0.035;

/// Standard deviations of the background above which a pixel counts as lit; ISO/TR 11146-3 has 2
/// to 4.
const LIT: f64 = 3.0;

/// Side of the rectangle over which moments are taken, in widths of the beam.
const APERTURE: f64 = 3.0;

/// The background is looked for around that rectangle, in one of so many times its sides.
const SURROUNDINGS: f64 = 2.0;

/// Standard deviations beyond which a pixel of the surroundings is not background: another spot,
/// a hot pixel.
const FAR: f64 = 3.0;

/// Fewest pixels of surroundings that make a background.
const ENOUGH: usize = 50;

/// Change of centre and widths, over the widths, at which nothing more is to be gained.
const SETTLED: f64 = 1e-4;

/// The same after the last round, from which on the rectangle runs away. Noise at its edge may
/// keep it moving by less for ever.
const RUNS_AWAY: f64 = 0.03;

/// Most rounds of settling.
const ROUNDS: usize = 50;

/// What is taken for light, and what for background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// A plane through what surrounds the spot is subtracted and negative differences are kept,
    /// so that noise averages out: for pictures whose darks were subtracted. The brightest spot
    /// is measured. It does not settle where stray light is uneven around the spot.
    Surroundings,
    /// The mean of all that is no brighter than the corners is subtracted, and what rises above
    /// it by less than three of its standard deviations counts as dark: for a frame alone. It
    /// always settles, takes everything that is lit for the beam, and makes a beam narrower by the
    /// wings that it cuts off.
    Threshold,
}

/// A beam as its first and second moments show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamMoments {
    /// Centroid, px: column, then row, the middle of the first pixel being (0, 0).
    pub center_px: [f64; 2],
    /// Standard uncertainty of each coordinate that the noise of the picture makes, px.
    pub u_center_px: [f64; 2],
    /// Widths d4σ, four standard deviations along the principal axes, px, the larger first. For a
    /// Gaussian beam its diameter at 1/e² of the peak, 1.699 times its full width at half maximum.
    pub d4sigma_px: [f64; 2],
    /// Standard uncertainty of each that the noise of the picture makes, px.
    pub u_d4sigma_px: [f64; 2],
    /// From the rows' direction to the axis of the larger width, toward increasing rows, rad,
    /// in (−π/2, π/2].
    pub angle: f64,
    /// Background at the centre that was subtracted, in the unit of the picture.
    pub background: f64,
    /// Sum over the rectangle, background subtracted, in the unit of the picture.
    pub sum: f64,
    /// Share of the rectangle that lies in the picture; below 1 light may have been cut off.
    pub aperture_share: f64,
}

impl BeamMoments {
    /// Standard deviation of the beam along one axis, px, as the root mean square of the two.
    pub fn sigma_px(&self) -> f64 {
        let [major, minor] = self.d4sigma_px;
        0.25 * (0.5 * (major * major + minor * minor)).sqrt()
    }
}

/// Centre and d4σ widths of the spot in `channel`, a picture of `width` × `height` px.
///
/// Moments are taken over a rectangle of three widths, along the principal axes and about the
/// centroid, until it moves no more. A pixel's own square adds its 1/12 px² to the variance along
/// each axis.
///
/// Widths that moments give are honest about tails: of a spot on a translucent white they hold
/// its glow. Pixels that were not measured take the mean of their neighbours.
///
/// # Errors
///
/// No pixel was measured, nothing stands out of the noise or the background, or the rectangle
/// does not settle.
///
/// # Source
///
/// ISO 11146-1:2021, section 7, with the background of ISO/TR 11146-3:2004, section 3, for
/// [`Background::Threshold`].
pub fn beam_moments(
    channel: &ChannelMap,
    width: usize,
    height: usize,
    background: Background,
) -> Result<BeamMoments, ProfileError> {
    let picture = Picture::checked(channel, width, height)?;
    let peak = picture.peak()?;
    let mut values = picture.filled();
    let no_spot = || ProfileError::NoSpot {
        x: (peak.pixel % width) as f64,
        y: (peak.pixel / width) as f64,
        peak: peak.value,
        u: peak.u,
    };
    let mut now = match background {
        Background::Surroundings => start(&values, width, &peak).ok_or_else(no_spot)?,
        Background::Threshold => Moments::default(),
    };
    let mut level = 0.0;
    if background == Background::Threshold {
        level = threshold(&mut values, width, height);
        let mut sums = Sums::default();
        for (i, value) in values.iter().enumerate() {
            sums.add((i % width) as f64, (i / width) as f64, *value);
        }
        now = sums.finish([0.0; 2]).ok_or_else(no_spot)?;
    }
    let mut plane = Plane::default();
    let mut moved = f64::INFINITY;
    for _ in 0..ROUNDS {
        let before = now;
        let aperture = Aperture::new(&before, width, height);
        if background == Background::Surroundings {
            plane = aperture.background(&values);
            level = plane.at(0.0, 0.0);
        }
        now = aperture.moments(&values, &plane).ok_or_else(no_spot)?;
        let step = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        let widths = step(now.d4sigma(), before.d4sigma());
        moved = step(now.center, before.center).max(widths) / before.d4sigma()[0];
        if moved <= SETTLED {
            break;
        }
    }
    if moved.is_nan() || moved > RUNS_AWAY {
        return Err(no_spot());
    }
    let aperture = Aperture::new(&now, width, height);
    let (u_center_px, u_d4sigma_px) = aperture.uncertainty(channel, picture.share, &now, &plane);
    Ok(BeamMoments {
        center_px: now.center,
        u_center_px,
        d4sigma_px: now.d4sigma(),
        u_d4sigma_px,
        angle: now.angle(),
        background: level,
        sum: now.sum,
        aperture_share: aperture.share_inside(),
    })
}

/// Subtracts the background of [`Background::Threshold`] from `values` and returns it.
fn threshold(values: &mut [f64], width: usize, height: usize) -> f64 {
    let side = |length: usize| ((CORNER * length as f64) as usize).max(1);
    let (columns, rows) = (side(width), side(height));
    let in_corner = |i: &usize| {
        let (x, y) = (i % width, i / width);
        (x < columns || x + columns >= width) && (y < rows || y + rows >= height)
    };
    let corners = (0..values.len()).filter(in_corner).map(|i| values[i]);
    let (mean, deviation) = statistics(corners);
    let limit = mean + LIT * deviation;
    let unlit = values.iter().copied().filter(|v| *v < limit);
    // Corners without any noise have nothing below their own mean.
    let (level, spread) = if unlit.clone().next().is_some() {
        statistics(unlit)
    } else {
        (mean, deviation)
    };
    for value in values.iter_mut() {
        *value -= level;
        if *value < LIT * spread {
            *value = 0.0;
        }
    }
    level
}

/// Mean and standard deviation.
fn statistics(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = (values.clone().count() as f64).max(1.0);
    let mean = values.clone().sum::<f64>() / count;
    let square: f64 = values.map(|v| (v - mean).powi(2)).sum();
    (mean, (square / count).sqrt())
}

/// The moments of what rises above half of the peak, counted from the picture's median, and hangs
/// together with it, where there is nothing better yet: of a Gaussian half of its width.
fn start(values: &[f64], width: usize, peak: &Peak) -> Option<Moments> {
    let height = values.len() / width;
    let threshold = 0.5 * (peak.value + median(&mut values.to_vec())?);
    let mut seen = vec![false; values.len()];
    seen[peak.pixel] = true;
    let (mut sums, mut front) = (Sums::default(), vec![peak.pixel]);
    while let Some(pixel) = front.pop() {
        let (x, y) = (pixel % width, pixel / width);
        if values[pixel] > threshold {
            sums.add(x as f64, y as f64, values[pixel] - threshold);
        } else if pixel != peak.pixel {
            continue;
        }
        for v in y.saturating_sub(1)..(y + 2).min(height) {
            for u in x.saturating_sub(1)..(x + 2).min(width) {
                if !std::mem::replace(&mut seen[v * width + u], true) {
                    front.push(v * width + u);
                }
            }
        }
    }
    sums.finish([0.0; 2]).map(|moments| Moments {
        // A spot of a pixel or two still needs room to grow.
        second: [
            moments.second[0] + 0.5,
            moments.second[1] + 0.5,
            moments.second[2],
        ],
        ..moments
    })
}

/// Sum, centroid and central second moments.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    sum: f64,
    center: [f64; 2],
    /// ⟨x²⟩, ⟨y²⟩ and ⟨xy⟩ about the centroid, px².
    second: [f64; 3],
}

impl Moments {
    /// Variances along the principal axes, px², the larger first.
    fn principal(&self) -> [f64; 2] {
        let [xx, yy, xy] = self.second;
        let split = (xx - yy).hypot(2.0 * xy);
        [0.5 * (xx + yy + split), 0.5 * (xx + yy - split)]
    }

    fn d4sigma(&self) -> [f64; 2] {
        self.principal().map(|v| 4.0 * v.max(0.0).sqrt())
    }

    fn angle(&self) -> f64 {
        let [xx, yy, xy] = self.second;
        0.5 * (2.0 * xy).atan2(xx - yy)
    }
}

/// Running sums of a picture's moments.
#[derive(Default)]
struct Sums {
    sum: f64,
    first: [f64; 2],
    second: [f64; 3],
}

impl Sums {
    fn add(&mut self, x: f64, y: f64, value: f64) {
        self.sum += value;
        for (sum, term) in self.first.iter_mut().zip([x, y]) {
            *sum += value * term;
        }
        for (sum, term) in self.second.iter_mut().zip([x * x, y * y, x * y]) {
            *sum += value * term;
        }
    }

    /// The moments about `origin`, from which the coordinates were counted.
    fn finish(&self, origin: [f64; 2]) -> Option<Moments> {
        let [x, y] = self.first.map(|m| m / self.sum);
        let [xx, yy, xy] = self.second.map(|m| m / self.sum);
        let moments = Moments {
            sum: self.sum,
            center: [origin[0] + x, origin[1] + y],
            second: [xx - x * x, yy - y * y, xy - x * y],
        };
        // A spot of one pixel has no width yet.
        (self.sum > 0.0 && moments.principal()[1] >= 0.0).then_some(moments)
    }
}

/// A plane under the spot: level and slopes per px, about the centre of the rectangle.
#[derive(Clone, Copy, Debug, Default)]
struct Plane {
    plane: [f64; 3],
    /// Covariance of the three.
    covariance: [[f64; 3]; 3],
}

impl Plane {
    fn at(&self, x: f64, y: f64) -> f64 {
        let [level, across, down] = self.plane;
        level + across * x + down * y
    }
}

/// Solves the symmetric, positive `matrix` for `side`, and inverts it.
fn solve(matrix: [[f64; 3]; 3], side: [f64; 3]) -> Option<([f64; 3], [[f64; 3]; 3])> {
    let m = &matrix;
    let cofactor = |i: usize, j: usize| {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    if determinant <= 1e-9 * m[0][0] * m[1][1] * m[2][2] {
        return None;
    }
    let inverse: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant));
    let solution = std::array::from_fn(|i| (0..3).map(|j| inverse[i][j] * side[j]).sum());
    Some((solution, inverse))
}

/// The middle value; the order is lost.
fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (values.len() >= ENOUGH).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The rectangle over which moments are taken.
struct Aperture {
    center: [f64; 2],
    cos: f64,
    sin: f64,
    /// Half of its sides, px.
    half: [f64; 2],
    width: usize,
    height: usize,
}

impl Aperture {
    fn new(moments: &Moments, width: usize, height: usize) -> Self {
        let (sin, cos) = moments.angle().sin_cos();
        Self {
            center: moments.center,
            cos,
            sin,
            half: moments.d4sigma().map(|d| 0.5 * APERTURE * d),
            width,
            height,
        }
    }

    /// Calls `visit` with every pixel inside: its index, and its place from the centre.
    fn for_each(&self, visit: impl FnMut(usize, f64, f64)) {
        self.for_each_in(1.0, visit);
    }

    /// The same for a rectangle with sides `times` as long.
    fn for_each_in(&self, times: f64, mut visit: impl FnMut(usize, f64, f64)) {
        let half = self.half.map(|h| h * times);
        let reach = half[0] + half[1];
        let span = |center: f64, length: usize| {
            let low = (center - reach).ceil().max(0.0) as usize;
            let high = (center + reach + 1.0).floor().clamp(0.0, length as f64) as usize;
            low..high.max(low)
        };
        for row in span(self.center[1], self.height) {
            let y = row as f64 - self.center[1];
            for column in span(self.center[0], self.width) {
                let x = column as f64 - self.center[0];
                let along = x * self.cos + y * self.sin;
                let across = y * self.cos - x * self.sin;
                if along.abs() <= half[0] && across.abs() <= half[1] {
                    visit(row * self.width + column, x, y);
                }
            }
        }
    }

    /// The plane through what surrounds the rectangle; nothing where the picture ends there.
    fn background(&self, values: &[f64]) -> Plane {
        let mut around = vec![];
        self.for_each_in(SURROUNDINGS, |i, x, y| {
            let along = x * self.cos + y * self.sin;
            let across = y * self.cos - x * self.sin;
            if along.abs() > self.half[0] || across.abs() > self.half[1] {
                around.push((x, y, values[i]));
            }
        });
        // The median and its distances first, which a second spot cannot move.
        let mut sorted: Vec<f64> = around.iter().map(|p| p.2).collect();
        let Some(median) = median(&mut sorted) else {
            return Plane::default();
        };
        let mut distances: Vec<f64> = around.iter().map(|p| (p.2 - median).abs()).collect();
        // 1.4826 median absolute deviations are one standard deviation of a Gaussian; counts of
        // few bits may have none.
        let mut spread = 1.4826 * self::median(&mut distances).unwrap_or(0.0);
        if spread == 0.0 {
            let squares: f64 = distances.iter().map(|d| d * d).sum();
            spread = (squares / distances.len() as f64).sqrt();
        }
        let mut found = Plane {
            plane: [median, 0.0, 0.0],
            ..Plane::default()
        };
        for _ in 0..4 {
            let (mut matrix, mut side) = ([[0.0; 3]; 3], [0.0; 3]);
            let (mut squares, mut count) = (0.0, 0);
            for &(x, y, value) in &around {
                let residual = value - found.at(x, y);
                if residual.abs() > FAR * spread + f64::EPSILON * median.abs() {
                    continue;
                }
                count += 1;
                squares += residual * residual;
                let terms = [1.0, x, y];
                for i in 0..3 {
                    side[i] += terms[i] * value;
                    for j in 0..3 {
                        matrix[i][j] += terms[i] * terms[j];
                    }
                }
            }
            if count < ENOUGH {
                break;
            }
            let Some((plane, inverse)) = solve(matrix, side) else {
                break;
            };
            let variance = squares / (count - 3) as f64;
            found = Plane {
                plane,
                covariance: inverse.map(|row| row.map(|v| v * variance)),
            };
            // Cut at three, a Gaussian's standard deviation comes out 1.3 % small.
            spread = 1.013 * variance.sqrt();
        }
        found
    }

    fn moments(&self, values: &[f64], background: &Plane) -> Option<Moments> {
        let mut sums = Sums::default();
        self.for_each(|i, x, y| sums.add(x, y, values[i] - background.at(x, y)));
        sums.finish(self.center)
    }

    /// Standard uncertainties of centre and widths, px, from the variances of the pixels, of which
    /// `share` were measured, and of the background.
    fn uncertainty(
        &self,
        channel: &ChannelMap,
        share: f64,
        moments: &Moments,
        background: &Plane,
    ) -> ([f64; 2], [f64; 2]) {
        let principal = moments.principal();
        // Of x, y and the variances along both axes: Σ variance·weight², and what the
        // background's level and slopes do.
        let mut noise = [0.0; 4];
        let mut by_background = [[0.0; 3]; 4];
        self.for_each(|i, x, y| {
            let variance = f64::from(channel.variance[i]);
            let along = x * self.cos + y * self.sin;
            let across = y * self.cos - x * self.sin;
            let weights = [
                x,
                y,
                along * along - principal[0],
                across * across - principal[1],
            ];
            for (k, weight) in weights.into_iter().enumerate() {
                for (sum, term) in by_background[k].iter_mut().zip([1.0, x, y]) {
                    *sum += weight * term;
                }
                if variance.is_finite() {
                    noise[k] += variance * weight * weight;
                }
            }
        });
        // A photosite of a mosaic stands for the pixels between it and the next as well.
        if share < SPARSE {
            noise = noise.map(|n| n / (share * share));
        }
        let u: [f64; 4] = std::array::from_fn(|k| {
            let by = &by_background[k];
            let shared: f64 = (0..9)
                .map(|ij| by[ij / 3] * background.covariance[ij / 3][ij % 3] * by[ij % 3])
                .sum();
            (noise[k] + shared.max(0.0)).sqrt() / moments.sum
        });
        // d = 4√v, so that u(d) = 2 u(v)/√v = 8 u(v)/d.
        let d = moments.d4sigma();
        ([u[0], u[1]], [8.0 * u[2] / d[0], 8.0 * u[3] / d[1]])
    }

    /// Share of the rectangle that lies in the picture.
    fn share_inside(&self) -> f64 {
        let mut inside = 0.0;
        self.for_each(|_, _, _| inside += 1.0);
        (inside / (4.0 * self.half[0] * self.half[1])).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;
    use std::f64::consts::PI;

    const SIZE: (usize, usize) = (240, 200);

    /// A Gaussian with these standard deviations along axes turned by `angle`, of unit height on
    /// a background, with noise.
    fn spot(
        center: [f64; 2],
        sigma: [f64; 2],
        angle: f64,
        background: f64,
        noise: f64,
        seed: u64,
    ) -> ChannelMap {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (sin, cos) = angle.sin_cos();
        let value = (0..SIZE.0 * SIZE.1)
            .map(|i| {
                let (x, y) = (
                    (i % SIZE.0) as f64 - center[0],
                    (i / SIZE.0) as f64 - center[1],
                );
                let (along, across) = (x * cos + y * sin, y * cos - x * sin);
                let square = (along / sigma[0]).powi(2) + (across / sigma[1]).powi(2);
                let gaussian: f64 = rng.sample(StandardNormal);
                ((-0.5 * square).exp() + background + noise * gaussian) as f32
            })
            .collect();
        ChannelMap {
            name: "Y".to_owned(),
            value,
            variance: vec![(noise * noise) as f32; SIZE.0 * SIZE.1],
        }
    }

    #[test]
    fn a_gaussian_has_its_own_moments() {
        for (sigma, angle) in [([9.0, 9.0], 0.0), ([12.0, 7.0], 0.4), ([11.0, 6.0], -1.2)] {
            let center = [113.3, 96.8];
            let map = spot(center, sigma, angle, 3.0, 0.0, 1);
            let found = beam_moments(&map, SIZE.0, SIZE.1, Background::Surroundings).unwrap();
            // Beyond three widths, six standard deviations, lie 1e-8 of the light.
            for axis in 0..2 {
                let d = found.d4sigma_px[axis] / (4.0 * sigma[axis]);
                assert!((d - 1.0).abs() < 1e-4, "{sigma:?}: {found:?}");
                let off = found.center_px[axis] - center[axis];
                assert!(off.abs() < 1e-4, "{sigma:?}: {found:?}");
            }
            if sigma[0] > sigma[1] {
                let turned = (found.angle - angle + 0.5 * PI).rem_euclid(PI) - 0.5 * PI;
                assert!(turned.abs() < 1e-4, "{angle}: {found:?}");
            }
            assert!((found.background - 3.0).abs() < 1e-6, "{found:?}");
            assert!(found.aperture_share > 0.95, "{found:?}");
        }
    }

    /// What u says of centre and widths is the scatter of many pictures, whose background was
    /// found in each.
    #[test]
    fn uncertainties_are_the_scatter() {
        let (center, sigma) = ([119.6, 98.2], [10.0, 8.0]);
        let count = 60;
        let mut squares = [0.0; 4];
        for seed in 0..count {
            let map = spot(center, sigma, 0.0, 0.2, 0.006, seed);
            let found = beam_moments(&map, SIZE.0, SIZE.1, Background::Surroundings).unwrap();
            for axis in 0..2 {
                let off = (found.center_px[axis] - center[axis]) / found.u_center_px[axis];
                squares[axis] += off * off / count as f64;
                let off = (found.d4sigma_px[axis] - 4.0 * sigma[axis]) / found.u_d4sigma_px[axis];
                squares[2 + axis] += off * off / count as f64;
            }
        }
        println!("{squares:?}");
        // Four standard deviations of χ²/n.
        let allowed = 4.0 * (2.0 / count as f64).sqrt();
        for square in &squares {
            assert!((square - 1.0).abs() < allowed, "{squares:?}");
        }
    }

    #[test]
    fn a_threshold_cuts_off_wings() {
        let sigma = [12.0, 7.0];
        let map = spot([113.3, 96.8], sigma, 0.4, 3.0, 0.002, 7);
        let found = beam_moments(&map, SIZE.0, SIZE.1, Background::Threshold).unwrap();
        // A Gaussian cut at the share t of its peak keeps the variance σ²(1 + t ln t/(1 − t)).
        let t: f64 = LIT * 0.002;
        let narrower = (1.0 + t * t.ln() / (1.0 - t)).sqrt();
        // One pixel in 740 of the rectangle is dark and above the threshold: 0.2 % of the width.
        for (d, sigma) in found.d4sigma_px.iter().zip(sigma) {
            assert!(
                (d / (4.0 * sigma * narrower) - 1.0).abs() < 4e-3,
                "{found:?}"
            );
        }
    }

    #[test]
    fn nothing_is_no_beam() {
        let flat = ChannelMap {
            name: "Y".to_owned(),
            value: vec![2.0; 400],
            variance: vec![1.0; 400],
        };
        for background in [Background::Surroundings, Background::Threshold] {
            let error = beam_moments(&flat, 20, 20, background).unwrap_err();
            assert!(matches!(error, ProfileError::NoSpot { .. }), "{error}");
        }
    }
}
