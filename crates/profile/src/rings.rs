//! Rings about the spot, and which pixels lie in them.

use std::ops::Range;

/// Contiguous rings from the centre to the largest full circle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rings {
    /// Edges, px, one more than there are rings; the first is 0.
    edges: Vec<f64>,
}

/// A row's pixels that lie in one ring.
#[derive(Default)]
pub(crate) struct Run {
    /// The ring.
    pub(crate) ring: usize,
    /// Indices into the picture.
    pub(crate) pixels: Range<usize>,
    /// Column of the first pixel's centre less that of the spot, px.
    pub(crate) dx: f64,
    /// Row of the pixels' centre less that of the spot, px.
    pub(crate) dy: f64,
}

impl Rings {
    /// Rings up to `radius` px, each `relative_width` of its radius wide, but no narrower than
    /// `min_width` px but for the share that makes the last one end at `radius`.
    pub(crate) fn new(radius: f64, relative_width: f64, min_width: f64) -> Self {
        // u counts rings: du/dr is one over the width, which is even up to `turn`.
        let turn = min_width / relative_width;
        let rings_to = |r: f64| {
            let even = r.min(turn) / min_width;
            even + (r.max(turn) / turn).ln() / relative_width
        };
        let radius_of = |u: f64| {
            let even = turn / min_width;
            if u <= even {
                u * min_width
            } else {
                turn * ((u - even) * relative_width).exp()
            }
        };
        let all = rings_to(radius);
        let count = (all.floor() as usize).max(1);
        let mut edges: Vec<f64> = (0..=count)
            .map(|k| radius_of(all * k as f64 / count as f64))
            .collect();
        edges[count] = radius;
        Self { edges }
    }

    pub(crate) fn len(&self) -> usize {
        self.edges.len() - 1
    }

    /// Inner and outer edge of `ring`, px.
    pub(crate) fn edges(&self, ring: usize) -> (f64, f64) {
        (self.edges[ring], self.edges[ring + 1])
    }

    /// Area of `ring`, px².
    pub(crate) fn area(&self, ring: usize) -> f64 {
        let (inner, outer) = self.edges(ring);
        std::f64::consts::PI * (outer - inner) * (outer + inner)
    }

    /// Middle and half width of `ring` in r², px². The area is even in r²: a mean over the
    /// ring's area is a mean over this interval.
    pub(crate) fn square(&self, ring: usize) -> (f64, f64) {
        let (inner, outer) = self.edges(ring);
        let (a, b) = (inner * inner, outer * outer);
        (0.5 * (a + b), 0.5 * (b - a))
    }

    /// Every run of pixels of row `y`, of `width`, whose centres lie in one of the first `rings`
    /// rings about `center` (px; the middle of the first pixel is at 0, 0), from left to right, in
    /// `room`.
    ///
    /// A list, since what is done with runs is too large to be compiled into the loop that finds
    /// them, and would go without the instructions that the loop was compiled for.
    #[inline(always)]
    pub(crate) fn runs_of_row<'r>(
        &self,
        width: usize,
        center: [f64; 2],
        y: usize,
        rings: usize,
        room: &'r mut Vec<Run>,
    ) -> &'r [Run] {
        let edges = &self.edges[..=rings];
        // Those to the left are found from right to left.
        room.resize_with(2 * rings, Run::default);
        let (mut first, mut end) = (rings, rings);
        let dy = y as f64 - center[1];
        let outside = edges.partition_point(|e| *e <= dy.abs());
        let run = |ring: usize, from: usize, to: usize| Run {
            ring,
            pixels: y * width + from..y * width + to,
            dx: from as f64 - center[0],
            dy,
        };
        // From the centre line outwards, edge by edge.
        let mut inside: Option<Range<usize>> = None;
        for (edge, radius) in edges.iter().enumerate().skip(outside) {
            let half = ((radius - dy) * (radius + dy)).sqrt();
            // First column whose centre is not left of x.
            let [left, right] = [center[0] - half, center[0] + half]
                .map(|x| x.ceil().clamp(0.0, width as f64) as usize);
            let inner = inside.unwrap_or(right..right);
            if left < inner.start {
                first -= 1;
                room[first] = run(edge - 1, left, inner.start);
            }
            if inner.end < right {
                room[end] = run(edge - 1, inner.end, right);
                end += 1;
            }
            inside = Some(left..right);
        }
        &room[first..end]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_touch_and_end_at_the_radius() {
        for (radius, relative, least) in
            [(512.0, 0.025, 1.5), (17.3, 0.025, 1.5), (900.0, 0.1, 2.0)]
        {
            let rings = Rings::new(radius, relative, least);
            assert_eq!(rings.edges[0], 0.0);
            assert_eq!(*rings.edges.last().unwrap(), radius);
            for ring in 0..rings.len() {
                let (inner, outer) = rings.edges(ring);
                let width = outer - inner;
                assert!(width >= least * (1.0 - 1e-9), "{ring}: {width}");
                assert!(width < 1.3 * least.max(relative * outer), "{ring}: {width}");
            }
        }
        assert_eq!(Rings::new(512.0, 0.025, 1.5).len(), 125);
        // The fewest that the options allow still make a spline.
        assert!(Rings::new(16.0, 0.25, 3.0).len() >= 4);
    }

    #[test]
    fn each_pixel_lies_in_the_ring_of_its_centre() {
        let size = (61, 47);
        let rings = Rings::new(20.3, 0.1, 1.5);
        for center in [[30.5, 23.5], [31.0, 23.0], [29.137, 22.81]] {
            let mut found = vec![None; size.0 * size.1];
            let mut visit = |run: &Run| {
                for (k, i) in run.pixels.clone().enumerate() {
                    assert_eq!(found[i].replace(run.ring), None);
                    let (x, y) = ((i % size.0) as f64, (i / size.0) as f64);
                    assert!((run.dx + k as f64 - (x - center[0])).abs() < 1e-12);
                    assert!((run.dy - (y - center[1])).abs() < 1e-12);
                }
            };
            let mut runs = vec![];
            for y in 0..size.1 {
                let runs = rings.runs_of_row(size.0, center, y, rings.len(), &mut runs);
                runs.iter().for_each(&mut visit);
            }
            for (i, found) in found.iter().enumerate() {
                let (x, y) = ((i % size.0) as f64, (i / size.0) as f64);
                let r = (x - center[0]).hypot(y - center[1]);
                let expected = (0..rings.len()).find(|k| {
                    let (inner, outer) = rings.edges(*k);
                    (inner..outer).contains(&r)
                });
                // On an edge itself either side will do.
                let on_edge = rings.edges.iter().any(|e| (e - r).abs() < 1e-9);
                assert!(
                    on_edge || *found == expected,
                    "{i}: {found:?} for {expected:?}"
                );
            }
        }
    }
}
