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
    /// Square of the distance up to which its groups stand for their media, mm².
    reach: f64,
    /// The node after all that are below this one.
    next: usize,
}

/// Media whose σₜᵣ times the distance is apart by less, and whose σₜ′ by this share, may have one
/// that stands for all: what is of the second order is then below 0.3 %. Far away, where there is
/// little light, they may be further apart by the root of what is left of it.
const ALIKE: f64 = 0.25;

/// Media whose σₜᵣ is apart by less, over the least, share a [`Group`] of a node: then they are
/// alike at any distance, since 0.3 x e^(−x/2) is never above [`ALIKE`].
const GROUP: f64 = 0.3;
/// The same for media that hardly absorb, whose σₜᵣ is small beside this share of σₜ′: they are
/// alike for 400 transport lengths.
const CLEAR: f64 = 0.002;

/// Light of one channel that enters media which are much alike.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// W.
    power: f64,
    /// The mean of the light's own.
    medium: Medium,
    /// The least and the greatest.
    sigma_tr: [f64; 2],
    sigma_t_prime: [f64; 2],
}

impl Group {
    fn new(power: f64, medium: Medium) -> Self {
        let coefficients = medium.reduced().coefficients();
        Self {
            power,
            medium,
            sigma_tr: [coefficients.sigma_tr(); 2],
            sigma_t_prime: [coefficients.sigma_t_prime(); 2],
        }
    }

    /// Square of the distance up to which one stands for all, mm².
    fn reach(&self) -> f64 {
        let [low, high] = self.sigma_tr;
        let apart = high - low;
        // The farthest that apart · d · e^(−low d/2) ever gets.
        if apart * 2.0 <= ALIKE * std::f64::consts::E * low {
            f64::INFINITY
        } else {
            (ALIKE / apart).powi(2)
        }
    }

    /// Both together, if they are alike enough.
    fn with(&self, other: &Self) -> Option<Self> {
        let both = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let sigma_tr = both(self.sigma_tr, other.sigma_tr);
        let sigma_t_prime = both(self.sigma_t_prime, other.sigma_t_prime);
        let most = GROUP * (sigma_tr[0] + CLEAR * sigma_t_prime[0]);
        let paths = sigma_t_prime[1] / sigma_t_prime[0] - 1.0;
        if sigma_tr[1] - sigma_tr[0] > most || paths >= ALIKE {
            return None;
        }
        let power = self.power + other.power;
        let part = other.power / power;
        let mean = |a: f64, b: f64| a + part * (b - a);
        Some(Self {
            power,
            medium: Medium {
                sigma_a: mean(self.medium.sigma_a, other.medium.sigma_a),
                sigma_s: mean(self.medium.sigma_s, other.medium.sigma_s),
                ..self.medium
            },
            sigma_tr,
            sigma_t_prime,
        })
    }
}

/// As few groups as there can be, from the least σₜᵣ to the greatest.
fn joined(mut groups: Vec<Group>) -> Vec<Group> {
    groups.sort_unstable_by(|a, b| a.sigma_tr[0].total_cmp(&b.sigma_tr[0]));
    let mut found: Vec<Group> = vec![];
    for group in groups {
        match found
            .last_mut()
            .and_then(|last| Some((last.with(&group)?, last)))
        {
            Some((both, last)) => *last = both,
            None => found.push(group),
        }
    }
    found
}

/// What stands for all points as seen from somewhere: some of them, and nodes for the others.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seen {
    Point(usize),
    Node(usize),
}

/// Points with the power that enters at each, in every channel. Where media differ from point to
/// point, there is a `K` for the power and the medium of each, and several for a node.
#[derive(Clone, Debug)]
pub(super) struct Tree<K> {
    channels: usize,
    points: Vec<Lit>,
    /// Channel by channel within a point, W.
    powers: Vec<f64>,
    /// Likewise the media there; none where they are the same everywhere.
    media: Vec<Medium>,
    of_points: Vec<K>,
    nodes: Vec<Node>,
    node_powers: Vec<f64>,
    /// For each node, channel by channel, where its own are.
    node_ranges: Vec<[u32; 2]>,
    of_nodes: Vec<K>,
}

impl<K: Copy> Tree<K> {
    /// Of points with their powers and, where they differ from point to point, media. `make` is told
    /// of a channel, a power and a medium.
    pub(super) fn new(
        points: &[Lit],
        powers: &[f64],
        media: &[Medium],
        channels: usize,
        make: &dyn Fn(usize, f64, &Medium) -> K,
    ) -> Self {
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
        let each = media.iter().zip(&powers).enumerate();
        let mut tree = Self {
            channels,
            points: order.iter().map(|&(_, k)| points[k]).collect(),
            of_points: each
                .map(|(k, (medium, power))| make(k % channels, *power, medium))
                .collect(),
            powers,
            media,
            nodes: vec![],
            node_powers: vec![],
            node_ranges: vec![],
            of_nodes: vec![],
        };
        if !points.is_empty() {
            let codes: Vec<u64> = order.into_iter().map(|(code, _)| code).collect();
            tree.grow(&codes, 0..points.len(), LEVELS, make);
        }
        tree
    }

    /// Adds the node of `range`, whose codes agree down to `level`, and all below it; says what
    /// enters which media there, channel by channel.
    fn grow(
        &mut self,
        codes: &[u64],
        range: Range<usize>,
        level: u32,
        make: &dyn Fn(usize, f64, &Medium) -> K,
    ) -> Vec<Vec<Group>> {
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
            reach: f64::INFINITY,
            next: 0,
        });
        let textured = !self.media.is_empty();
        if textured {
            self.node_ranges.resize((index + 1) * channels, [0; 2]);
        }
        let mut groups: Vec<Vec<Group>> = vec![vec![]; if textured { channels } else { 0 }];
        if range.len() > LEAF && level > 0 {
            let shift = 3 * (level - 1);
            let mut start = range.start;
            while start < range.end {
                let digit = codes[start] >> shift;
                let len = codes[start..range.end].partition_point(|code| code >> shift == digit);
                let below = self.grow(codes, start..start + len, level - 1, make);
                for (groups, below) in groups.iter_mut().zip(below) {
                    groups.extend(below);
                }
                start += len;
            }
        } else if textured {
            for k in range.start * channels..range.end * channels {
                if self.powers[k] > 0.0 {
                    groups[k % channels].push(Group::new(self.powers[k], self.media[k]));
                }
            }
        }
        for (channel, groups) in groups.iter_mut().enumerate() {
            *groups = joined(std::mem::take(groups));
            let start = self.of_nodes.len() as u32;
            let all = groups.iter().map(|g| make(channel, g.power, &g.medium));
            self.of_nodes.extend(all);
            let end = self.of_nodes.len() as u32;
            self.node_ranges[index * channels + channel] = [start, end];
        }
        let reaches = groups.iter().flatten().map(Group::reach);
        self.nodes[index].reach = reaches.fold(f64::INFINITY, f64::min);
        self.nodes[index].next = self.nodes.len();
        groups
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
        let of_point = index * self.channels..(index + 1) * self.channels;
        self.media.get(of_point).unwrap_or_default()
    }

    /// The power of a point or node, by channel.
    #[inline]
    pub(super) fn powers(&self, seen: Seen) -> &[f64] {
        let (index, powers) = match seen {
            Seen::Point(index) => (index, &self.powers),
            Seen::Node(index) => (index, &self.node_powers),
        };
        &powers[index * self.channels..][..self.channels]
    }

    /// What was made of the power of a point or node in a channel, where media differ.
    #[inline]
    pub(super) fn made(&self, seen: Seen, channel: usize) -> &[K] {
        match seen {
            Seen::Point(index) => {
                std::slice::from_ref(&self.of_points[index * self.channels + channel])
            }
            Seen::Node(index) => {
                let [start, end] = self.node_ranges[index * self.channels + channel];
                &self.of_nodes[start as usize..end as usize]
            }
        }
    }

    /// Tells `add` of what stands for all points as seen from `from`: nodes whose surface fills less
    /// than `solid_angle` there, and the points of the others. Where no light enters is left out.
    #[inline]
    pub(super) fn seen(&self, from: Vec3, solid_angle: f64, mut add: impl FnMut(&Lit, Seen)) {
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let powers = self.powers(Seen::Node(index));
            if powers.iter().all(|power| *power == 0.0) {
                index = node.next;
                continue;
            }
            let inside = from.cmpge(node.low).all() && from.cmple(node.high).all();
            let square = (node.mean.at - from).length_squared();
            let far = !inside && node.mean.area < solid_angle * square;
            if far && square < node.reach {
                add(&node.mean, Seen::Node(index));
                index = node.next;
            } else if node.next == index + 1 {
                for k in node.points.clone() {
                    add(&self.points[k], Seen::Point(k));
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
