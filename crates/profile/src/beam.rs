//! The beam, as the white reference shows it.

use crate::error::ProfileError;
use gauss_quad::GaussLegendre;
use physics::{Coefficients, ForwardModel, ProfilePoint, RadialProfile, RadialSpread};
use std::f64::consts::{LN_2, PI, TAU};
use std::num::NonZeroUsize;

/// Radii at half of the peak beyond which a spread is taken to hold no light: a Gaussian keeps
/// 1.5e-5 of it there, and what a lens scatters farther is stray light rather than beam.
const REACH: f64 = 4.0;

/// Rings beyond the reach that take part, as a share of it: the white's own glow fills them and
/// settles how much light there is in all.
const BEYOND: f64 = 0.5;

/// Parts into which the rings between two nodes are cut.
const PARTS: usize = 4;

/// Relative standard error of a ring's mean where the picture is steep, over its noise: how well
/// rings of pixels follow a spot, and in the two innermost.
const RING_ERROR: f64 = 2e-3;
const HEART_ERROR: f64 = 1e-2;

/// The same over the peak, for every ring, in the weights alone: what a glow that is known to some
/// percent leaves of the white's own light where the beam has ended. Without it far rings, which
/// are all glow, would settle how much light the near ones have. No noise: whoever knows the glow's
/// uncertainty measures the beam by another glow, too.
const GLOW_ERROR: f64 = 5e-4;

/// Prior standard deviation of the second difference between neighbouring nodes, over the peak.
/// A Gaussian whose full width is six nodes has 0.15 at its top.
const BEND: f64 = 0.3;

/// Copies of the picture, each off by its own noise, that show how well the spread is known.
const COPIES: usize = 8;

/// The white reference as matter that glows.
#[derive(Clone, Copy)]
pub struct Glow<'a> {
    /// How light spreads in it.
    pub model: &'a dyn ForwardModel,
    /// Its coefficients.
    pub at: Coefficients,
}

/// Beam and blur as a white reference shows them.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredBeam {
    /// Beam, point spread of the lens and pixel together.
    pub spread: RadialSpread,
    /// The same from copies of the picture that are each off by its noise.
    pub copies: Vec<RadialSpread>,
    /// Standard uncertainty of the full width at half maximum from that noise, mm.
    pub u_fwhm_mm: f64,
    /// Root mean square of picture over its description − 1, within the reach of the spread.
    pub misfit: f64,
}

/// Measures beam and blur from `white`, a profile of the spot on the white reference in any unit,
/// less stray light.
///
/// The picture is the spread convolved with the glow. The spread is a density that is linear
/// between nodes at the edges of the rings, at least 0 everywhere, and as smooth as the picture
/// allows (Tikhonov's second difference, `BEND` of the peak); least squares find it. Without a
/// glow the white is an ideal surface, whose picture is the spread itself.
///
/// # Errors
///
/// The profile has no rings that follow one another from the centre, or no spot.
pub fn measure_beam(
    white: &RadialProfile,
    glow: Option<Glow<'_>>,
) -> Result<MeasuredBeam, ProfileError> {
    let rings = Rings::of(white).ok_or(ProfileError::NoBeam)?;
    let design = Design::new(&rings, glow);
    let values: Vec<f64> = rings.points.iter().map(|p| p.reflectance_per_mm2).collect();
    let (spread, fitted) = design.solve(&rings, &values).ok_or(ProfileError::NoBeam)?;
    let copies: Vec<RadialSpread> = (0..COPIES)
        .filter_map(|copy| {
            let off: Vec<f64> = (rings.points.iter().zip(&rings.noise).enumerate())
                .map(|(ring, (p, u))| p.reflectance_per_mm2 + sign(copy, ring) * u)
                .collect();
            Some(design.solve(&rings, &off)?.0)
        })
        .collect();
    let fwhm = spread.fwhm_mm();
    let squares: f64 = copies.iter().map(|c| (c.fwhm_mm() - fwhm).powi(2)).sum();
    let near = rings.points.iter().zip(&fitted);
    let off: Vec<f64> = near
        .filter(|(p, _)| p.radius_mm < 0.5 * rings.reach_mm)
        .map(|(p, fitted)| (p.reflectance_per_mm2 / fitted - 1.0).powi(2))
        .collect();
    Ok(MeasuredBeam {
        spread,
        u_fwhm_mm: (squares / copies.len().max(1) as f64).sqrt(),
        misfit: (off.iter().sum::<f64>() / off.len().max(1) as f64).sqrt(),
        copies,
    })
}

/// A sign that is as good as drawn, the same every time (the finalizer of splitmix64).
fn sign(copy: usize, ring: usize) -> f64 {
    let mut z = ((copy as u64) << 32 | ring as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
}

/// The rings about the spot that tell of the beam.
struct Rings {
    points: Vec<ProfilePoint>,
    /// Standard uncertainty of each, with what rings of pixels cannot follow.
    noise: Vec<f64>,
    /// The same with what a glow may be off by: the weights.
    u: Vec<f64>,
    /// Radius at half of the peak, mm.
    half_mm: f64,
    /// Radius beyond which the spread is 0: an edge of a ring, mm.
    reach_mm: f64,
    /// The edges up to there.
    nodes_mm: Vec<f64>,
}

impl Rings {
    fn of(white: &RadialProfile) -> Option<Self> {
        let mut edges = vec![0.0];
        for point in &white.points {
            let (inner, outer) = point.ring_mm?;
            if (inner - edges[edges.len() - 1]).abs() > 1e-9 * outer {
                return None;
            }
            edges.push(outer);
        }
        let peak = white.points.first()?.reflectance_per_mm2;
        let fallen = white
            .points
            .iter()
            .position(|p| p.reflectance_per_mm2 < 0.5 * peak)?;
        let before = &white.points[fallen.checked_sub(1)?];
        let after = &white.points[fallen];
        let part = (before.reflectance_per_mm2 - 0.5 * peak)
            / (before.reflectance_per_mm2 - after.reflectance_per_mm2);
        let half_mm = before.radius_mm + part * (after.radius_mm - before.radius_mm);
        // Enough nodes for a spot of a few pixels, and room for the white's glow outside.
        let last = edges.partition_point(|e| *e < REACH * half_mm).max(8);
        let count = edges
            .partition_point(|e| *e < (1.0 + BEYOND) * edges[last.min(edges.len() - 1)])
            .min(white.points.len());
        if last >= count {
            return None;
        }
        let points = white.points[..count].to_vec();
        let noise: Vec<f64> = points
            .iter()
            .enumerate()
            .map(|(ring, p)| {
                let share = if ring < 2 { HEART_ERROR } else { RING_ERROR };
                (share * p.reflectance_per_mm2).hypot(p.u_reflectance_per_mm2)
            })
            .collect();
        let u = noise.iter().map(|u| u.hypot(GLOW_ERROR * peak)).collect();
        Some(Self {
            points,
            noise,
            u,
            half_mm,
            reach_mm: edges[last],
            nodes_mm: edges[..=last].to_vec(),
        })
    }
}

/// What each node's density makes of the mean over each ring.
struct Design {
    /// Edges of the parts that the spread is tabulated on, mm.
    parts_mm: Vec<f64>,
    /// Light in each part for a density of 1 at each node: parts × nodes.
    power: Vec<Vec<f64>>,
    /// Mean over each ring for a density of 1 at each node: rings × nodes.
    means: Vec<Vec<f64>>,
}

impl Design {
    fn new(rings: &Rings, glow: Option<Glow<'_>>) -> Self {
        let mut parts_mm = vec![0.0];
        for e in rings.nodes_mm.windows(2) {
            let part = |k: usize| e[0] + (e[1] - e[0]) * k as f64 / PARTS as f64;
            parts_mm.extend((1..=PARTS).map(part));
        }
        // The last node is the end of the spread, where the density is 0.
        let nodes = rings.nodes_mm.len() - 1;
        let power: Vec<Vec<f64>> = parts_mm
            .windows(2)
            .enumerate()
            .map(|(part, e)| {
                let (a, b) = (e[0], e[1]);
                let left = part / PARTS;
                let (from, to) = (rings.nodes_mm[left], rings.nodes_mm[left + 1]);
                // ∫ 2πr dr and ∫ (r − from)/(to − from) 2πr dr over the part.
                let area = PI * (b - a) * (b + a);
                let moment = TAU / 3.0 * (b.powi(3) - a.powi(3));
                let rising = (moment - from * area) / (to - from);
                let mut row = vec![0.0; nodes];
                row[left] = area - rising;
                if left + 1 < nodes {
                    row[left + 1] = rising;
                }
                row
            })
            .collect();
        let seen: Vec<Vec<f64>> = match glow {
            None => rings.points.iter().map(|p| shares(p, &parts_mm)).collect(),
            Some(glow) => glowing(rings, &parts_mm, glow),
        };
        let means = seen
            .iter()
            .map(|seen| {
                let of = |node: usize| seen.iter().zip(&power).map(|(s, p)| s * p[node]).sum();
                (0..nodes).map(of).collect()
            })
            .collect();
        Self {
            parts_mm,
            power,
            means,
        }
    }

    /// The spread behind `values`, and the means that it gives.
    fn solve(&self, rings: &Rings, values: &[f64]) -> Option<(RadialSpread, Vec<f64>)> {
        let nodes = self.power[0].len();
        let mut matrix = vec![vec![0.0; nodes]; nodes];
        let mut side = vec![0.0; nodes];
        for ((row, value), u) in self.means.iter().zip(values).zip(&rings.u) {
            let weight = u.powi(-2);
            if !weight.is_finite() {
                return None;
            }
            for a in 0..nodes {
                side[a] += weight * row[a] * value;
                for b in 0..nodes {
                    matrix[a][b] += weight * row[a] * row[b];
                }
            }
        }
        let light: f64 = (rings.points.iter().zip(values))
            .map(|(p, v)| p.area_mm2() * v)
            .sum();
        let peak = light * LN_2 / (PI * rings.half_mm * rings.half_mm);
        let weight = (BEND * peak).powi(-2);
        for middle in 0..nodes {
            // Beyond the last node stands the 0 at the end, before the first its mirror.
            let left = if middle == 0 { 1 } else { middle - 1 };
            let mut row = vec![(left, 1.0), (middle, -2.0)];
            if middle + 1 < nodes {
                row.push((middle + 1, 1.0));
            }
            for (a, x) in &row {
                for (b, y) in &row {
                    matrix[*a][*b] += weight * x * y;
                }
            }
        }
        let density = not_negative(&matrix, &side);
        let times = |rows: &[Vec<f64>]| -> Vec<f64> {
            let row = |row: &Vec<f64>| row.iter().zip(&density).map(|(a, x)| a * x).sum();
            rows.iter().map(row).collect()
        };
        let spread = RadialSpread::new(self.parts_mm.clone(), &times(&self.power))?;
        Some((spread, times(&self.means)))
    }
}

/// Mean over the ring of `point` for unit light in each part, on a surface that does not spread it.
fn shares(point: &ProfilePoint, parts_mm: &[f64]) -> Vec<f64> {
    let (inner, outer) = point.ring_mm.unwrap_or((0.0, 0.0));
    let area = point.area_mm2();
    parts_mm
        .windows(2)
        .map(|e| {
            let (low, high) = (e[0].max(inner), e[1].min(outer));
            if low < high {
                (high - low) * (high + low) / ((e[1] - e[0]) * (e[1] + e[0])) / area
            } else {
                0.0
            }
        })
        .collect()
}

/// The same on matter that glows: the mean over ring and part of the glow at the distance between
/// them.
///
/// It is one integral over the distance s, ∫ R_d(s) s · angle(s) ds, where the angle that a circle
/// of radius s about a point of the ring has inside the part is known in closed form, and s takes
/// away what light that scattered once has of a pole.
fn glowing(rings: &Rings, parts_mm: &[f64], glow: Glow<'_>) -> Vec<Vec<f64>> {
    let depth = 1.0 / glow.at.sigma_t_prime();
    let total = glow.model.beyond(glow.at, 0.0);
    let rule = GaussLegendre::new(NonZeroUsize::new(8).expect("8 is not zero"));
    let mut reflectance = vec![];
    rings
        .points
        .iter()
        .map(|point| {
            let (inner, outer) = point.ring_mm.unwrap_or((0.0, 0.0));
            let mut means = vec![0.0; parts_mm.len() - 1];
            for (r, w) in even(3, inner, outer) {
                let nodes = distances(r, parts_mm, depth, &rule);
                let radii: Vec<f64> = nodes.iter().map(|(s, _)| *s).collect();
                reflectance.resize(radii.len(), 0.0);
                glow.model
                    .diffuse_reflectance(glow.at, &radii, &mut reflectance);
                for ((s, ds), value) in nodes.iter().zip(&reflectance) {
                    // Half of the angle that the circle has inside each edge.
                    let angle = |edge: f64| {
                        let cos = (r * r + (s - edge) * (s + edge)) / (2.0 * r * s);
                        cos.clamp(-1.0, 1.0).acos()
                    };
                    let mut before = angle(parts_mm[0]);
                    for (mean, part) in means.iter_mut().zip(parts_mm.windows(2)) {
                        let after = angle(part[1]);
                        let area = PI * (part[1] - part[0]) * (part[1] + part[0]);
                        *mean += w * value / total * s * ds * 2.0 * (after - before) / area;
                        before = after;
                    }
                }
            }
            means
        })
        .collect()
}

/// Nodes and weights over the distances between a point at `r` and the parts between `edges`.
///
/// Angles start and end like a root where a circle touches an edge: cuts are made there, with
/// nodes that crowd at both ends of each piece, and no piece is longer than the glow is smooth.
fn distances(r: f64, edges: &[f64], depth: f64, rule: &GaussLegendre) -> Vec<(f64, f64)> {
    let mut cuts: Vec<f64> = edges.iter().flat_map(|e| [(r - e).abs(), r + e]).collect();
    cuts.push(0.0);
    cuts.sort_by(f64::total_cmp);
    let mut nodes = vec![];
    for pair in cuts.windows(2) {
        let (mut low, high) = (pair[0], pair[1]);
        while high - low > 1e-9 * high {
            let width = (high - low).min(low.max(depth));
            for (x, weight) in rule.as_node_weight_pairs() {
                let x = 0.5 + 0.5 * x;
                let ds = 6.0 * x * (1.0 - x) * width;
                nodes.push((low + width * x * x * (3.0 - 2.0 * x), 0.5 * weight * ds));
            }
            low += width;
        }
    }
    nodes
}

/// Nodes and weights of the mean over the area of a ring.
fn even(count: usize, inner: f64, outer: f64) -> Vec<(f64, f64)> {
    let rule = GaussLegendre::new(NonZeroUsize::new(count.max(1)).expect("at least 1"));
    let (half, middle) = (0.5 * (outer - inner), 0.5 * (outer + inner));
    rule.as_node_weight_pairs()
        .iter()
        .map(|(x, w)| {
            let r = middle + half * x;
            (r, w * half * 2.0 * r / ((outer - inner) * (outer + inner)))
        })
        .collect()
}

/// The minimum of ½ xᵀMx − bᵀx over x ≥ 0, coordinate by coordinate.
fn not_negative(matrix: &[Vec<f64>], side: &[f64]) -> Vec<f64> {
    let n = side.len();
    let mut x = vec![0.0; n];
    for _ in 0..50_000 {
        let (mut moved, mut largest) = (0.0_f64, 0.0_f64);
        for a in 0..n {
            let slope: f64 = matrix[a].iter().zip(&x).map(|(m, x)| m * x).sum::<f64>() - side[a];
            let next = (x[a] - slope / matrix[a][a]).max(0.0);
            moved = moved.max((next - x[a]).abs());
            largest = largest.max(next);
            x[a] = next;
        }
        if moved <= 1e-9 * largest {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests;
