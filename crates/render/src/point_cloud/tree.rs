//! Points in an octree, whose nodes stand for all points below them.

use super::samples::morton;
use crate::Vec3;
use physics::Medium;
use std::ops::Range;

/// Points of a leaf.
const LEAF: usize = 8;
/// Bits of each coordinate that tell nodes apart.
const LEVELS: u32 = 21;

/// A point that light enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lit {
    pub(super) at: Vec3,
    /// Out of the solid.
    pub(super) normal: Vec3,
    /// The surface that it stands for, mm².
    pub(super) area: f64,
}

#[derive(Clone, Debug)]
struct Node {
    /// What stands for all points below: means weighted by their light, and the sum of the areas.
    mean: Lit,
    low: Vec3,
    high: Vec3,
    points: Range<usize>,
    /// How far the media of its points are apart; none where they are the same everywhere.
    mixed: Mixed,
    /// The node after all that are below this one.
    next: usize,
}

/// How far media are apart, in the channel where they are farthest.
#[derive(Clone, Copy, Debug, Default)]
struct Mixed {
    /// Of σₜᵣ, mm⁻¹, and the least.
    sigma_tr: f64,
    least_sigma_tr: f64,
    /// Of σₜ′, over the least.
    paths: f64,
}

/// Media whose σₜᵣ times the distance is apart by less, and whose σₜ′ by this share, may have one
/// that stands for all: what is of the second order is then below 0.3 %. Far away, where there is
/// little light, they may be further apart by the root of what is left of it.
const ALIKE: f64 = 0.25;

impl Mixed {
    /// Of media, channel by channel within a point.
    fn new(media: &[Medium], channels: usize) -> Self {
        let mut mixed = Self {
            least_sigma_tr: f64::INFINITY,
            ..Self::default()
        };
        for channel in 0..channels {
            let ends = |of: &dyn Fn(&Medium) -> f64| {
                let of_channel = media.iter().skip(channel).step_by(channels).map(of);
                of_channel.fold((f64::INFINITY, 0.0_f64), |(low, high), x| {
                    (low.min(x), high.max(x))
                })
            };
            let (low, high) = ends(&|m| m.reduced().coefficients().sigma_tr());
            mixed.sigma_tr = mixed.sigma_tr.max(high - low);
            mixed.least_sigma_tr = mixed.least_sigma_tr.min(low);
            let (low, high) = ends(&|m| m.reduced().coefficients().sigma_t_prime());
            mixed.paths = mixed.paths.max(high / low - 1.0);
        }
        mixed
    }

    fn alike(&self, square: f64) -> bool {
        let apart = self.sigma_tr * self.sigma_tr * square;
        let left = || (-self.least_sigma_tr * square.sqrt()).exp();
        self.paths < ALIKE && (apart < ALIKE * ALIKE || apart * left() < ALIKE * ALIKE)
    }
}

/// Points with the power that enters at each, in every channel.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    channels: usize,
    points: Vec<Lit>,
    /// Channel by channel within a point, W.
    powers: Vec<f64>,
    /// Likewise the media there; none where they are the same everywhere.
    media: Vec<Medium>,
    nodes: Vec<Node>,
    node_powers: Vec<f64>,
    node_media: Vec<Medium>,
}

impl Tree {
    /// Of points with their powers and, where they differ from point to point, media.
    pub(super) fn new(points: &[Lit], powers: &[f64], media: &[Medium], channels: usize) -> Self {
        assert_eq!(points.len() * channels, powers.len());
        assert!(media.is_empty() || media.len() == powers.len());
        let (low, high) = points
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                (low.min(p.at), high.max(p.at))
            });
        let mut order: Vec<(u64, usize)> = points
            .iter()
            .enumerate()
            .map(|(k, p)| (morton(p.at, low, high), k))
            .collect();
        order.sort_unstable();
        fn sorted<T: Copy>(list: &[T], order: &[(u64, usize)], channels: usize) -> Vec<T> {
            let of_point = |&(_, k): &(u64, usize)| &list[k * channels..(k + 1) * channels];
            order.iter().flat_map(of_point).copied().collect()
        }
        let mut tree = Self {
            channels,
            points: order.iter().map(|&(_, k)| points[k]).collect(),
            powers: sorted(powers, &order, channels),
            media: if media.is_empty() {
                vec![]
            } else {
                sorted(media, &order, channels)
            },
            nodes: vec![],
            node_powers: vec![],
            node_media: vec![],
        };
        if !points.is_empty() {
            let codes: Vec<u64> = order.into_iter().map(|(code, _)| code).collect();
            tree.grow(&codes, 0..points.len(), LEVELS);
        }
        tree
    }

    /// Adds the node of `range`, whose codes agree down to `level`, and all below it.
    fn grow(&mut self, codes: &[u64], range: Range<usize>, level: u32) {
        let index = self.nodes.len();
        let channels = self.channels;
        let points = &self.points[range.clone()];
        let mut sums = vec![0.0; channels];
        let (mut weights, mut at, mut normal, mut area) = (0.0, Vec3::ZERO, Vec3::ZERO, 0.0);
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (k, point) in points.iter().enumerate() {
            let powers = &self.powers[(range.start + k) * channels..][..channels];
            let power: f64 = powers.iter().sum();
            // Where there is no light at all, the place does not matter.
            let weight = power + 1e-30 * point.area + f64::MIN_POSITIVE;
            weights += weight;
            at += weight * point.at;
            normal += weight * point.normal;
            area += point.area;
            low = low.min(point.at);
            high = high.max(point.at);
            for (sum, power) in sums.iter_mut().zip(powers) {
                *sum += power;
            }
        }
        let mut mixed = Mixed::default();
        if !self.media.is_empty() {
            let of_points = range.start * channels..range.end * channels;
            let media = &self.media[of_points.clone()];
            mixed = Mixed::new(media, channels);
            let powers = &self.powers[of_points];
            for channel in 0..channels {
                // The mean of the light's own, or the first where there is none.
                let mut mean = media[channel];
                if sums[channel] > 0.0 {
                    (mean.sigma_a, mean.sigma_s) = (0.0, 0.0);
                    let all = media.iter().zip(powers).skip(channel).step_by(channels);
                    for (medium, power) in all {
                        mean.sigma_a += power / sums[channel] * medium.sigma_a;
                        mean.sigma_s += power / sums[channel] * medium.sigma_s;
                    }
                }
                self.node_media.push(mean);
            }
        }
        self.node_powers.extend(sums);
        self.nodes.push(Node {
            mean: Lit {
                at: at / weights,
                // Not of unit length: what bends away counts as much less.
                normal: normal / weights,
                area,
            },
            low,
            high,
            points: range.clone(),
            mixed,
            next: 0,
        });
        if range.len() > LEAF && level > 0 {
            let shift = 3 * (level - 1);
            let mut start = range.start;
            while start < range.end {
                let digit = codes[start] >> shift;
                let len = codes[start..range.end].partition_point(|code| code >> shift == digit);
                self.grow(codes, start..start + len, level - 1);
                start += len;
            }
        }
        self.nodes[index].next = self.nodes.len();
    }

    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// A point, in the order of the tree, and the power that enters there.
    pub(super) fn point(&self, index: usize) -> (&Lit, &[f64]) {
        let powers = &self.powers[index * self.channels..][..self.channels];
        (&self.points[index], powers)
    }

    /// The media at a point, in the order of the tree; none where they are the same everywhere.
    pub(super) fn media(&self, index: usize) -> &[Medium] {
        Self::of(&self.media, index, self.channels)
    }

    fn of(media: &[Medium], index: usize, channels: usize) -> &[Medium] {
        media
            .get(index * channels..(index + 1) * channels)
            .unwrap_or_default()
    }

    /// Tells `add` of what stands for all points as seen from `from`: nodes whose surface fills less
    /// than `solid_angle` there, and the points of the others; with the power and, where they
    /// differ from point to point, the media. Where no light enters is left out.
    #[inline]
    pub(super) fn seen(
        &self,
        from: Vec3,
        solid_angle: f64,
        mut add: impl FnMut(&Lit, &[f64], &[Medium]),
    ) {
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let powers = &self.node_powers[index * self.channels..][..self.channels];
            if powers.iter().all(|power| *power == 0.0) {
                index = node.next;
                continue;
            }
            let inside = from.cmpge(node.low).all() && from.cmple(node.high).all();
            let square = (node.mean.at - from).length_squared();
            let far = !inside && node.mean.area < solid_angle * square;
            if far && node.mixed.alike(square) {
                add(
                    &node.mean,
                    powers,
                    Self::of(&self.node_media, index, self.channels),
                );
                index = node.next;
            } else if node.next == index + 1 {
                for k in node.points.clone() {
                    let (point, powers) = self.point(k);
                    add(point, powers, self.media(k));
                }
                index = node.next;
            } else {
                index += 1;
            }
        }
    }

    /// Tells `add` of the index and the squared distance of all points within a radius, but those
    /// of nodes that no light enters.
    pub(super) fn within(&self, from: Vec3, radius: f64, mut add: impl FnMut(usize, f64)) {
        self.visit(from, radius * radius, true, &mut |k, square| {
            if square < radius * radius {
                add(k, square);
            }
            radius * radius
        });
    }

    /// Indices and squared distances of at most `count` points within a radius that `wanted`
    /// passes, the nearest, from the near to the far.
    pub(super) fn nearest(
        &self,
        from: Vec3,
        radius: f64,
        count: usize,
        wanted: impl Fn(&Lit) -> bool,
    ) -> Vec<(usize, f64)> {
        let mut found: Vec<(usize, f64)> = Vec::with_capacity(count + 1);
        let mut reach = radius * radius;
        self.visit(from, reach, false, &mut |k, square| {
            if square < reach && wanted(&self.points[k]) {
                let place = found.partition_point(|(_, before)| *before <= square);
                found.insert(place, (k, square));
                if found.len() > count {
                    found.pop();
                }
                if found.len() == count {
                    reach = found[count - 1].1;
                }
            }
            reach
        });
        found
    }

    /// Shows the points of every node whose box is nearer than the root of `reach`, which is
    /// afterwards what `look` returned last; those that no light enters only if not `lit`.
    fn visit(
        &self,
        from: Vec3,
        mut reach: f64,
        lit: bool,
        look: &mut impl FnMut(usize, f64) -> f64,
    ) {
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let nearest = from.clamp(node.low, node.high);
            let powers = &self.node_powers[index * self.channels..][..self.channels];
            let dark = lit && powers.iter().all(|power| *power == 0.0);
            if dark || (nearest - from).length_squared() > reach {
                index = node.next;
            } else if node.next == index + 1 {
                for k in node.points.clone() {
                    reach = look(k, (self.points[k].at - from).length_squared());
                }
                index = node.next;
            } else {
                index += 1;
            }
        }
    }
}
