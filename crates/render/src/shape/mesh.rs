use super::grid::Grid;
use super::{Hit, Solid};
use crate::Vec3;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::ray::{Ray, RayHit};
use std::collections::HashMap;
use std::fmt;
use thiserror::Error;

/// Most triangles: what fits the indices of the tree with room.
const MOST_TRIANGLES: usize = 100_000_000;

/// Why triangles cannot be a solid.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// There is no triangle.
    #[error("the mesh has no triangle; expected the faces of a closed solid: export it with them")]
    Empty,
    /// There are too many.
    #[error("the mesh has {0} triangles; at most 100 million can be used")]
    Huge(usize),
    /// A coordinate is not a number, or infinite.
    #[error("vertex {index} is at ({}, {}, {}); expected finite numbers: look for nan and inf in the file, or export it anew", at.x, at.y, at.z)]
    NotFinite {
        /// The vertex, from 1.
        index: usize,
        /// Where it is.
        at: Vec3,
    },
    /// A normal or a texture coordinate is not a number, or infinite.
    #[error(
        "the {what} of vertex {index} are not finite; save the mesh with them right, or without"
    )]
    NotFiniteOf {
        /// Of what.
        what: &'static str,
        /// The vertex, from 1.
        index: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error(
        "triangle {triangle} uses vertex {vertex}, but there are {vertices}; the file is damaged: export the mesh anew"
    )]
    NoSuchVertex {
        /// The triangle, from 1.
        triangle: usize,
        /// The vertex, from 1.
        vertex: usize,
        /// How many there are.
        vertices: usize,
    },
    /// The triangles enclose nothing.
    #[error(
        "the mesh encloses no volume: all its {0} triangles are degenerate or lie in one plane; a sheet needs a thickness and a back, or take a block"
    )]
    Flat(usize),
    /// A list has not one entry for each vertex.
    #[error("{found} {what} for {vertices} vertices")]
    Unmatched {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        vertices: usize,
    },
}

/// What is odd about a mesh that can still be used.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum MeshWarning {
    /// Edges with one triangle only.
    Open(usize),
    /// Edges with more than two triangles, or with two that disagree on which side is out.
    Disordered(usize),
    /// Triangles without area, left out.
    Degenerate(usize),
    /// All triangles looked inward and were turned.
    InsideOut,
}

impl fmt::Display for MeshWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open(n) => write!(
                f,
                "the mesh is not closed ({n} edges have one triangle): light that finds a hole is lost; close it, or take the picture as a sketch"
            ),
            Self::Disordered(n) => write!(
                f,
                "{n} edges of the mesh have triangles that disagree on which side is out: light that finds them is lost; let all face outward (\"recalculate normals\"), or take the picture as a sketch"
            ),
            Self::Degenerate(n) => write!(f, "{n} triangles without area were left out"),
            Self::InsideOut => write!(f, "the mesh was inside out and has been turned"),
        }
    }
}

/// A solid enclosed by triangles.
pub struct Mesh {
    vertices: Vec<Vec3>,
    normals: Vec<Vec3>,
    coordinates: Vec<[f64; 2]>,
    triangles: Vec<[u32; 3]>,
    /// In the order of the tree: a corner, two edges, and the triangle.
    leaves: Vec<Leaf>,
    tree: Bvh2,
    grid: Grid,
    bounds: (Vec3, Vec3),
    warnings: Vec<MeshWarning>,
}

struct Leaf {
    corner: Vec3,
    edges: [Vec3; 2],
    triangle: u32,
}

impl fmt::Debug for Mesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Mesh of {} triangles", self.triangles.len())
    }
}

impl Mesh {
    /// From vertices and the triangles between them, counter-clockwise seen from outside.
    ///
    /// `normals` and `coordinates` are one for each vertex, or none at all.
    ///
    /// # Errors
    ///
    /// [`MeshError`]: what no picture can be made of. What is merely odd is in
    /// [`Self::warnings`].
    pub fn new(
        vertices: Vec<Vec3>,
        mut triangles: Vec<[u32; 3]>,
        mut normals: Vec<Vec3>,
        coordinates: Vec<[f64; 2]>,
    ) -> Result<Self, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        if triangles.len() > MOST_TRIANGLES {
            return Err(MeshError::Huge(triangles.len()));
        }
        if let Some(index) = vertices.iter().position(|v| !v.is_finite()) {
            let at = vertices[index];
            return Err(MeshError::NotFinite {
                index: index + 1,
                at,
            });
        }
        for (what, found) in [
            ("normals", normals.len()),
            ("texture coordinates", coordinates.len()),
        ] {
            if found != 0 && found != vertices.len() {
                let vertices = vertices.len();
                return Err(MeshError::Unmatched {
                    what,
                    found,
                    vertices,
                });
            }
        }
        let normal = normals.iter().position(|n| !n.is_finite());
        let coordinate = coordinates
            .iter()
            .position(|c| !c.iter().all(|x| x.is_finite()));
        for (what, found) in [("normals", normal), ("texture coordinates", coordinate)] {
            if let Some(index) = found {
                let index = index + 1;
                return Err(MeshError::NotFiniteOf { what, index });
            }
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(vertex) = corners.iter().find(|v| **v as usize >= vertices.len()) {
                return Err(MeshError::NoSuchVertex {
                    triangle: triangle + 1,
                    vertex: *vertex as usize + 1,
                    vertices: vertices.len(),
                });
            }
        }

        let mut warnings = vec![];
        let all = triangles.len();
        let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
        triangles.retain(|t| {
            let [a, b, c] = corners(t);
            (b - a).cross(c - a).length_squared() > 0.0
        });
        if triangles.len() < all {
            warnings.push(MeshWarning::Degenerate(all - triangles.len()));
        }
        let (low, high) = triangles
            .iter()
            .flat_map(corners)
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
        // Six times the volume, about the middle: what lies in a plane has none.
        let middle =
            triangles.iter().flat_map(corners).sum::<Vec3>() / (3 * triangles.len().max(1)) as f64;
        let volume: f64 = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners(t).map(|v| v - middle);
                a.dot(b.cross(c))
            })
            .sum();
        let size = (high - low).length();
        if triangles.is_empty() || volume.abs() <= 1e-12 * size.powi(3) {
            return Err(MeshError::Flat(all));
        }
        if volume < 0.0 {
            warnings.push(MeshWarning::InsideOut);
            for t in &mut triangles {
                t.swap(1, 2);
            }
            for n in &mut normals {
                *n = -*n;
            }
        }
        warnings.extend(seams(&vertices, &triangles));

        let pad = Vec3A::splat((1e-5 * size) as f32);
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners(t);
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                // The tree is in single precision: no box may be too small by a rounding.
                Aabb::new(low.as_vec3a() - pad, high.as_vec3a() + pad)
            })
            .collect();
        let tree = build_bvh2(
            &boxes,
            obvhs::BvhBuildParams::medium_build(),
            &mut std::time::Duration::default(),
        );
        let leaves = tree
            .primitive_indices
            .iter()
            .map(|&triangle| {
                let [a, b, c] = corners(&triangles[triangle as usize]);
                Leaf {
                    corner: a,
                    edges: [b - a, c - a],
                    triangle,
                }
            })
            .collect();
        let grid = Grid::new(low, high, triangles.iter().map(corners));
        Ok(Self {
            bounds: (low, high),
            leaves,
            tree,
            grid,
            vertices,
            normals,
            coordinates,
            triangles,
            warnings,
        })
    }

    /// The same mesh with a normal of its own making at every vertex: the mean of those of the
    /// triangles that meet in its place, by their angles there (Thürmer and Wüthrich 1998).
    pub fn smoothed(mut self) -> Self {
        // Vertices in one place are one: files repeat them where texture coordinates part.
        let place = |v: Vec3| (v + Vec3::ZERO).to_array().map(f64::to_bits);
        let mut sums: HashMap<[u64; 3], Vec3> = HashMap::new();
        for triangle in 0..self.len() {
            let corners = self.corners(triangle);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize();
            for k in 0..3 {
                let [here, next, last] = [0, 1, 2].map(|turn| corners[(k + turn) % 3]);
                let angle = (next - here).angle_between(last - here);
                *sums.entry(place(here)).or_default() += angle * normal;
            }
        }
        let of_vertex = |v: &Vec3| {
            sums.get(&place(*v))
                .map_or(Vec3::Z, |n| n.normalize_or(Vec3::Z))
        };
        self.normals = self.vertices.iter().map(of_vertex).collect();
        self
    }

    /// Whether its vertices have normals.
    pub fn has_normals(&self) -> bool {
        !self.normals.is_empty()
    }

    /// What is odd about it.
    pub fn warnings(&self) -> &[MeshWarning] {
        &self.warnings
    }

    /// How many triangles there are.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Never: a mesh has triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|v| self.vertices[v as usize])
    }

    /// Whether its points have texture coordinates.
    pub fn has_texture_coordinates(&self) -> bool {
        !self.coordinates.is_empty()
    }

    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }

    /// Whether a ray from here leaves the mesh through its nearest surface.
    pub(super) fn contains(&self, point: Vec3) -> bool {
        // Off the axes, where edges and corners like to lie.
        let direction = Vec3::new(0.123_456, 0.345_678, 0.930_2).normalize();
        let any = self.nearest(point, direction, f64::INFINITY, 0.0, |_| true);
        any.is_some_and(|hit| hit.normal.dot(direction) > 0.0)
    }

    /// Weights of the corners at a point of a triangle.
    fn weights(&self, point: Vec3, triangle: usize) -> [f64; 3] {
        let [a, b, c] = self.corners(triangle);
        let normal = (b - a).cross(c - a);
        let all = normal.length_squared();
        let of_b = (point - a).cross(c - a).dot(normal) / all;
        let of_c = (b - a).cross(point - a).dot(normal) / all;
        [1.0 - of_b - of_c, of_b, of_c]
    }

    pub(super) fn shading_normal(&self, point: Vec3, hit: &Hit) -> Vec3 {
        if self.normals.is_empty() {
            return hit.normal;
        }
        let weights = self.weights(point, hit.face);
        let corners = self.triangles[hit.face];
        let sum: Vec3 = (0..3)
            .map(|k| weights[k] * self.normals[corners[k] as usize])
            .sum();
        let normal = sum.normalize_or(hit.normal);
        // A normal that looks into the solid is no normal.
        if normal.dot(hit.normal) > 0.05 {
            normal
        } else {
            hit.normal
        }
    }

    pub(super) fn texture_coordinates(&self, point: Vec3, hit: &Hit) -> Option<[f64; 2]> {
        if self.coordinates.is_empty() {
            return None;
        }
        let weights = self.weights(point, hit.face);
        let corners = self.triangles[hit.face];
        let mean = |axis: usize| {
            (0..3)
                .map(|k| weights[k] * self.coordinates[corners[k] as usize][axis])
                .sum()
        };
        Some([mean(0), mean(1)])
    }

    /// The nearest triangle `within` a length along a ray whose normal times the direction passes `wanted`.
    #[inline]
    fn nearest(
        &self,
        origin: Vec3,
        direction: Vec3,
        within: f64,
        slack: f64,
        wanted: impl Fn(f64) -> bool,
    ) -> Option<Hit> {
        let mut best: Option<(f64, usize)> = None;
        self.traverse(origin, direction, within, wanted, |distance, index| {
            if distance < -slack
                || distance > within
                || best.is_some_and(|(before, _)| distance >= before)
            {
                return f32::INFINITY;
            }
            best = Some((distance, index));
            // Up, so that the tree drops nothing that is as near.
            (distance.max(0.0) * (1.0 + 1e-6) + 1e-6) as f32
        });
        best.map(|(distance, index)| self.hit(distance, index))
    }

    fn hit(&self, distance: f64, leaf: usize) -> Hit {
        let leaf = &self.leaves[leaf];
        Hit {
            distance: distance.max(0.0),
            normal: leaf.edges[0].cross(leaf.edges[1]).normalize(),
            face: leaf.triangle as usize,
        }
    }

    /// Shows `visit` the triangles that a ray meets and whose normal times the direction is
    /// `wanted`: distance and leaf. It returns how far the rest is to be looked for.
    #[inline]
    fn traverse(
        &self,
        origin: Vec3,
        direction: Vec3,
        within: f64,
        wanted: impl Fn(f64) -> bool,
        mut visit: impl FnMut(f64, usize) -> f32,
    ) {
        let most = (within * (1.0 + 1e-6) + 1e-6) as f32;
        let ray = Ray::new(origin.as_vec3a(), direction.as_vec3a(), 0.0, most);
        let mut seen = RayHit::none();
        self.tree.ray_traverse(ray, &mut seen, |_, index| {
            let leaf = &self.leaves[index];
            let [u, v] = leaf.edges;
            // Möller and Trumbore (1997), in double precision.
            let p = direction.cross(v);
            let determinant = u.dot(p);
            if determinant == 0.0 || !wanted(-determinant) {
                return f32::INFINITY;
            }
            let from = origin - leaf.corner;
            let a = from.dot(p) / determinant;
            if !(-1e-12..=1.0 + 1e-12).contains(&a) {
                return f32::INFINITY;
            }
            let q = from.cross(u);
            let b = direction.dot(q) / determinant;
            if b < -1e-12 || a + b > 1.0 + 1e-12 {
                return f32::INFINITY;
            }
            visit(v.dot(q) / determinant, index)
        });
    }

    /// Every point in which a line crosses the surface, in no order.
    pub(crate) fn crossings(&self, through: Vec3, axis: Vec3) -> Vec<(Vec3, Hit)> {
        let (low, high) = self.bounds;
        let back = (through - 0.5 * (low + high)).length() + (high - low).length();
        let origin = through - back * axis;
        let mut found = vec![];
        let any = |_| true;
        self.traverse(origin, axis, f64::INFINITY, any, |distance, index| {
            let hit = self.hit(distance, index);
            found.push((origin + distance * axis, hit));
            f32::INFINITY
        });
        found
    }

    fn slack(&self) -> f64 {
        1e-9 * (self.bounds.1 - self.bounds.0).max_element()
    }
}

impl Solid for Mesh {
    #[inline]
    fn clearance(&self, point: Vec3) -> f64 {
        let (low, high) = self.bounds;
        let outside = (low - point).max(point - high).max_element();
        if outside > 1e-6 * (high - low).max_element() {
            return f64::NEG_INFINITY;
        }
        self.grid.at(point)
    }

    #[inline]
    fn leave(&self, origin: Vec3, direction: Vec3, within: f64) -> Option<Hit> {
        self.nearest(origin, direction, within, self.slack(), |along| along > 0.0)
    }

    fn enter(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.nearest(origin, direction, f64::INFINITY, self.slack(), |along| {
            along < 0.0
        })
    }
}

/// Edges that are not shared by two triangles that agree. Vertices at one place are one.
fn seams(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<MeshWarning> {
    let mut places = HashMap::new();
    let names: Vec<u32> = vertices
        .iter()
        .enumerate()
        .map(|(i, v)| {
            // Zero has two signs.
            let bits = (*v + Vec3::ZERO).to_array().map(f64::to_bits);
            *places.entry(bits).or_insert(i as u32)
        })
        .collect();
    // For each edge, how often it is walked up and down.
    let mut edges: HashMap<(u32, u32), [u32; 2]> = HashMap::new();
    for t in triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (names[a as usize], names[b as usize]);
            let count = edges.entry((a.min(b), a.max(b))).or_default();
            count[usize::from(a > b)] += 1;
        }
    }
    let open = edges.values().filter(|c| c[0] + c[1] == 1).count();
    let odd = edges
        .values()
        .filter(|c| c[0] + c[1] > 1 && c[0] != c[1])
        .count();
    let mut warnings = vec![];
    if open > 0 {
        warnings.push(MeshWarning::Open(open));
    }
    if odd > 0 {
        warnings.push(MeshWarning::Disordered(odd));
    }
    warnings
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn octahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let vertices = axes.iter().flat_map(|a| [*a, -*a]).collect();
        let mut triangles = vec![];
        for x in [0, 1] {
            for y in [2, 3] {
                for z in [4, 5] {
                    let turned = (x + y + z) % 2 == 1;
                    triangles.push(if turned { [x, z, y] } else { [x, y, z] });
                }
            }
        }
        (vertices, triangles)
    }

    /// A ball of triangles, with the normals of the true one.
    pub(crate) fn ball(levels: usize, radius: f64) -> Mesh {
        let (mut vertices, mut triangles) = octahedron();
        for _ in 0..levels {
            let mut middles = HashMap::new();
            let mut finer = vec![];
            for [a, b, c] in triangles {
                let mut middle = |i: u32, j: u32| {
                    *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                        let between = vertices[i as usize] + vertices[j as usize];
                        vertices.push(between.normalize());
                        vertices.len() as u32 - 1
                    })
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            triangles = finer;
        }
        let normals = vertices.clone();
        let vertices = vertices.into_iter().map(|v| radius * v).collect();
        Mesh::new(vertices, triangles, normals, vec![]).unwrap()
    }

    #[test]
    fn a_closed_ball_has_nothing_odd_and_its_grid_bounds_the_distance() {
        let mesh = ball(4, 10.0);
        assert!(mesh.warnings().is_empty(), "{:?}", mesh.warnings());
        let center = mesh.clearance(Vec3::ZERO);
        assert!(center > 9.0 && center < 10.0, "{center}");
        let hit = mesh.enter(Vec3::new(0.1, 0.2, 20.0), Vec3::NEG_Z).unwrap();
        let point = Vec3::new(0.1, 0.2, 20.0 - hit.distance);
        let smooth = mesh.shading_normal(point, &hit);
        assert!(smooth.dot(point.normalize()) > 1.0 - 1e-4);
    }

    /// A ball that forgot its normals finds them again, also where two vertices are in one place.
    #[test]
    fn a_smoothed_ball_is_round_across_its_seams() {
        let round = ball(4, 10.0);
        let vertices: Vec<Vec3> = (0..round.len()).flat_map(|k| round.corners(k)).collect();
        let triangles = (0..round.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]);
        let flat = Mesh::new(vertices, triangles.collect(), vec![], vec![]).unwrap();
        assert!(!flat.has_normals());
        let smooth = flat.smoothed();
        for (place, normal) in smooth.vertices.iter().zip(&smooth.normals) {
            assert!(
                normal.dot(place.normalize()) > 1.0 - 1e-4,
                "{place} {normal}"
            );
        }
    }

    #[test]
    fn what_is_wrong_with_triangles_is_said() {
        let (vertices, triangles) = octahedron();
        let new = |v: &[Vec3], t: &[[u32; 3]]| Mesh::new(v.to_vec(), t.to_vec(), vec![], vec![]);
        let mut normals = vertices.clone();
        normals[3].x = f64::INFINITY;
        let mut coordinates = vec![[0.5, 0.5]; 6];
        coordinates[4][1] = f64::NAN;
        for (normals, coordinates, index) in [(normals, vec![], 4), (vec![], coordinates, 5)] {
            let found = Mesh::new(vertices.clone(), triangles.clone(), normals, coordinates);
            assert!(
                matches!(found, Err(MeshError::NotFiniteOf { index: i, .. }) if i == index),
                "{found:?}"
            );
        }
        assert_eq!(new(&vertices, &[]).unwrap_err(), MeshError::Empty);
        let mut bad = vertices.clone();
        bad[2].y = f64::NAN;
        assert!(matches!(
            new(&bad, &triangles).unwrap_err(),
            MeshError::NotFinite { index: 3, .. }
        ));
        assert!(matches!(
            new(&vertices, &[[0, 2, 9]]).unwrap_err(),
            MeshError::NoSuchVertex { vertex: 10, .. }
        ));
        assert_eq!(
            new(&vertices, &[[0, 2, 4]]).unwrap_err(),
            MeshError::Flat(1)
        );
        assert_eq!(
            new(&vertices, &triangles[1..]).unwrap().warnings(),
            [MeshWarning::Open(3)]
        );
        let turned: Vec<[u32; 3]> = triangles.iter().map(|t| [t[0], t[2], t[1]]).collect();
        let mesh = new(&vertices, &turned).unwrap();
        assert_eq!(mesh.warnings(), [MeshWarning::InsideOut]);
        assert!(mesh.contains(Vec3::ZERO));
        let mut one_turned = triangles.clone();
        one_turned[0].swap(1, 2);
        assert_eq!(
            new(&vertices, &one_turned).unwrap().warnings(),
            [MeshWarning::Disordered(3)]
        );
        let mut needle = triangles.clone();
        needle.push([0, 0, 2]);
        assert!(
            new(&vertices, &needle)
                .unwrap()
                .warnings()
                .contains(&MeshWarning::Degenerate(1))
        );
    }
}
