//! Points in an octree, whose nodes stand for all points below them.

use super::Source;
use super::palette::{Mixture, Palette, Patch};
use super::samples::morton;
use crate::Vec3;
use crate::bssrdf::Family;
use physics::Medium;
use physics::random::{Stream, uniform};
use std::ops::Range;

/// Points of a leaf.
const LEAF: usize = 8;
/// Bits of each coordinate that tell nodes apart.
const LEVELS: u32 = 21;

/// A point that light enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lit {
    pub(crate) at: Vec3,
    /// Out of the solid.
    pub(crate) normal: Vec3,
    /// The surface that it stands for, mm².
    pub(crate) area: f64,
}

#[derive(Clone, Debug)]
struct Node {
    /// What stands for all points below: means weighted by their light, and the sum of the areas.
    mean: Lit,
    low: Vec3,
    high: Vec3,
    points: Range<usize>,
    /// The node after all that are below this one.
    next: usize,
}

/// Where the powers of a mixture are.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    patch: Patch,
    start: u32,
    source_depth_mm: f32,
}

/// What stands for all points as seen from somewhere: some of them, and nodes for the others.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Seen {
    Point(usize),
    Node(usize),
}

/// Points with the power that enters at each, in every channel. Where media differ from point to
/// point, a [`Source`] for each, and for a node a [`Mixture`].
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    channels: usize,
    points: Vec<Lit>,
    /// Channel by channel within a point, W.
    powers: Vec<f64>,
    /// Likewise the media there; none where they are the same everywhere.
    media: Vec<Medium>,
    sources: Vec<Source>,
    /// Power of all points before each and, at the end, of all; channels together.
    below: Vec<f64>,
    nodes: Vec<Node>,
    node_powers: Vec<f64>,
    /// For each node, channel by channel, its mixture, whose powers are in `shares`.
    mixtures: Vec<Place>,
    shares: Vec<f32>,
}

/// A patch with its powers, and depths of sources times power, mm W.
type Mixed = (Patch, Vec<f32>, f64);

/// What mixtures of a channel are together.
fn sum(parts: &[(Patch, &[f32], f64)]) -> Mixed {
    let patches = parts.iter().map(|(patch, ..)| *patch);
    let whole = patches.fold(Patch::default(), Patch::with);
    let mut sums = vec![0.0; whole.len()];
    let mut moments = 0.0;
    for (patch, powers, moment) in parts {
        patch.add_to(powers, &whole, &mut sums);
        moments += moment;
    }
    (whole, sums, moments)
}

impl Tree {
    /// Of points with their powers and, where they differ from point to point, media, with what
    /// each channel makes of them.
    pub(crate) fn new(
        points: &[Lit],
        powers: &[f64],
        media: &[Medium],
        families: &[Family],
        palettes: &[Palette],
    ) -> Self {
        let channels = families.len();
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
        let powers = sorted(powers, &order, channels);
        let media = if media.is_empty() {
            vec![]
        } else {
            sorted(media, &order, channels)
        };
        let mut sum = 0.0;
        let all = powers.chunks_exact(channels).map(|of_point| {
            sum += of_point.iter().sum::<f64>();
            sum
        });
        let below = std::iter::once(0.0).chain(all).collect();
        let each = media.iter().zip(&powers).enumerate();
        let mut tree = Self {
            channels,
            points: order.iter().map(|&(_, k)| points[k]).collect(),
            sources: each
                .map(|(k, (medium, power))| Source::new(&families[k % channels].of(medium), *power))
                .collect(),
            powers,
            media,
            below,
            nodes: vec![],
            node_powers: vec![],
            mixtures: vec![],
            shares: vec![],
        };
        if !points.is_empty() {
            let codes: Vec<u64> = order.into_iter().map(|(code, _)| code).collect();
            tree.grow(&codes, 0..points.len(), LEVELS, palettes);
        }
        tree
    }

    /// Adds the node of `range`, whose codes agree down to `level`, and all below it.
    fn grow(&mut self, codes: &[u64], range: Range<usize>, level: u32, palettes: &[Palette]) {
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
            next: 0,
        });
        let textured = !self.media.is_empty();
        if textured {
            let all = (index + 1) * channels;
            self.mixtures.resize(all, Place::default());
        }
        let leaf = range.len() <= LEAF || level == 0;
        if !leaf {
            let shift = 3 * (level - 1);
            let mut start = range.start;
            while start < range.end {
                let digit = codes[start] >> shift;
                let len = codes[start..range.end].partition_point(|code| code >> shift == digit);
                self.grow(codes, start..start + len, level - 1, palettes);
                start += len;
            }
        }
        self.nodes[index].next = self.nodes.len();
        if textured {
            for (channel, palette) in palettes.iter().enumerate() {
                if leaf {
                    self.mix_points(index, channel, palette);
                } else {
                    self.mix_nodes(index, channel);
                }
            }
        }
    }

    /// Makes the mixture of a leaf from its points.
    fn mix_points(&mut self, index: usize, channel: usize, palette: &Palette) {
        let at = |k: usize| k * self.channels + channel;
        let lit = |k: &usize| self.powers[*k] > 0.0;
        let all = self.nodes[index].points.clone().map(at).filter(lit);
        let weighed = all.map(|k| {
            let (patch, weights) = palette.weights(&self.media[k]);
            let (power, depth) = (self.powers[k], self.sources[k].source_depth_mm);
            let powers = weights.map(|weight| weight * power as f32);
            (patch, powers, power * f64::from(depth))
        });
        let weighed: Vec<_> = weighed.collect();
        let parts = weighed.iter();
        let parts = parts.map(|(patch, powers, moment)| (*patch, &powers[..patch.len()], *moment));
        let mixed = sum(&parts.collect::<Vec<_>>());
        self.mixed(index, channel, mixed);
    }

    /// Makes the mixture of a node from those right below it.
    fn mix_nodes(&mut self, index: usize, channel: usize) {
        let mut parts = vec![];
        let mut node = index + 1;
        while node < self.nodes[index].next {
            let Mixture {
                patch,
                powers,
                source_depth_mm,
            } = self.mixture(node, channel);
            let power = self.node_powers[node * self.channels + channel];
            parts.push((patch, powers, power * f64::from(source_depth_mm)));
            node = self.nodes[node].next;
        }
        let mixed = sum(&parts);
        self.mixed(index, channel, mixed);
    }

    fn mixed(&mut self, index: usize, channel: usize, (patch, powers, moment): Mixed) {
        let place = index * self.channels + channel;
        let power = self.node_powers[place].max(f64::MIN_POSITIVE);
        self.mixtures[place] = Place {
            patch,
            start: self.shares.len() as u32,
            source_depth_mm: (moment / power) as f32,
        };
        self.shares.extend(powers);
    }

    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// Mean power over the surface, W mm⁻², channels together.
    pub(crate) fn irradiance(&self) -> f64 {
        let area = self.nodes.first().map_or(1.0, |node| node.mean.area);
        self.below[self.points.len()] / area
    }

    /// A point, in the order of the tree, and the power that enters there.
    pub(crate) fn point(&self, index: usize) -> (&Lit, &[f64]) {
        let powers = &self.powers[index * self.channels..][..self.channels];
        (&self.points[index], powers)
    }

    /// The media at a point, in the order of the tree; none where they are the same everywhere.
    pub(crate) fn media(&self, index: usize) -> &[Medium] {
        let of_point = index * self.channels..(index + 1) * self.channels;
        self.media.get(of_point).unwrap_or_default()
    }

    /// The power of a point or node, by channel.
    #[inline]
    pub(crate) fn powers(&self, seen: Seen) -> &[f64] {
        let (index, powers) = match seen {
            Seen::Point(index) => (index, &self.powers),
            Seen::Node(index) => (index, &self.node_powers),
        };
        &powers[index * self.channels..][..self.channels]
    }

    /// What a point is in a channel, where media differ.
    #[inline]
    pub(crate) fn source(&self, point: usize, channel: usize) -> &Source {
        &self.sources[point * self.channels + channel]
    }

    /// What a node is in a channel, where media differ.
    #[inline]
    pub(crate) fn mixture(&self, node: usize, channel: usize) -> Mixture<'_> {
        let Place {
            patch,
            start,
            source_depth_mm,
        } = self.mixtures[node * self.channels + channel];
        Mixture {
            patch,
            powers: &self.shares[start as usize..][..patch.len()],
            source_depth_mm,
        }
    }

    /// Offers what stands for all points as seen from `from`: nodes whose surface fills less than
    /// `loose` times `solid_angle` there, with how many times that is, and the points of the others
    /// with 0. What is below a node that `take` refuses is offered in its place; where no light
    /// enters is left out.
    #[inline]
    pub(crate) fn offered(
        &self,
        from: Vec3,
        solid_angle: f64,
        loose: f64,
        mut take: impl FnMut(&Lit, Seen, f64) -> bool,
    ) {
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let powers = self.powers(Seen::Node(index));
            if powers.iter().all(|power| *power == 0.0) {
                index = node.next;
                continue;
            }
            let inside = from.cmpge(node.low).all() && from.cmple(node.high).all();
            let square = (node.mean.at - from).length_squared();
            let times = node.mean.area / (solid_angle * square);
            if !inside && times < loose && take(&node.mean, Seen::Node(index), times) {
                index = node.next;
            } else if node.next == index + 1 {
                for k in node.points.clone() {
                    take(&self.points[k], Seen::Point(k), 0.0);
                }
                index = node.next;
            } else {
                index += 1;
            }
        }
    }

    /// Tells `add` of points and of how many times what each brings has to count, so that the sum is
    /// without bias that over all points: one of each node that is `small` enough, drawn by its
    /// power, and all of the others. `small` is asked of the power and the area of a node and of the
    /// square of the distance from `from` to its box.
    #[inline]
    pub(crate) fn drawn(
        &self,
        from: Vec3,
        small: impl Fn(f64, f64, f64) -> bool,
        rng: &mut Stream,
        mut add: impl FnMut(usize, f64),
    ) {
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let Range { start, end } = node.points;
            let power = self.below[end] - self.below[start];
            let square = (from.clamp(node.low, node.high) - from).length_squared();
            if power <= 0.0 {
                index = node.next;
            } else if end - start > 1 && small(power, node.mean.area, square) {
                let at = self.below[start] + uniform(rng) * power;
                let before = self.below[start + 1..end].partition_point(|sum| *sum <= at);
                let drawn = start + before;
                let own = self.below[drawn + 1] - self.below[drawn];
                if own > 0.0 {
                    add(drawn, power / own);
                }
                index = node.next;
            } else if node.next == index + 1 {
                for k in start..end {
                    add(k, 1.0);
                }
                index = node.next;
            } else {
                index += 1;
            }
        }
    }

    /// Tells `add` of the index and the squared distance of all points within a radius, but those
    /// of nodes that no light enters.
    pub(crate) fn within(&self, from: Vec3, radius: f64, mut add: impl FnMut(usize, f64)) {
        self.visit(from, radius * radius, true, &mut |k, square| {
            if square < radius * radius {
                add(k, square);
            }
            radius * radius
        });
    }

    /// Indices and squared distances of at most `count` points within a radius that `wanted`
    /// passes, the nearest, from the near to the far.
    pub(crate) fn nearest(
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
