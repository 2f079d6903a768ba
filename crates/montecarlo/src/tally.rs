//! What a simulation has found so far, with a standard error for every number.

use crate::boundary::Side;
use crate::cells::{
    BlockCells, ExactCells, Layout, MOST_BLOCKS, PHOTONS_PER_BLOCK, Total, add_block, inexact,
};
use crate::error::CannotMerge;
use physics::ProfilePoint;
use physics::profile::mean_radius;
use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

/// A share of the incident power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The share.
    pub value: f64,
    /// Its standard error.
    pub u: f64,
}

/// Shares by bins of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Binned {
    /// Edges of the bins, one more than there are bins.
    pub edges: Vec<f64>,
    /// The share in each bin.
    pub bins: Vec<Estimate>,
    /// The share beyond the last edge.
    pub beyond: Estimate,
}

/// Shares by bins of two quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct Binned2 {
    /// Edges of the rows.
    pub row_edges: Vec<f64>,
    /// Edges of the columns.
    pub column_edges: Vec<f64>,
    /// Row by row; each row ends with what lies beyond the last column, and the last row holds
    /// what lies beyond the last row.
    pub cells: Vec<Estimate>,
}

/// A result, complete at any moment: more blocks make it more precise and nothing else.
#[derive(Clone, Debug)]
pub struct Tally {
    fingerprint: u64,
    layout: Arc<Layout>,
    /// The blocks it holds, apart from one another and in order.
    blocks: Vec<Range<u64>>,
    sums: ExactCells,
    events: u64,
}

/// A tally to keep: integers that restore it to the byte.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TallyState {
    /// Which simulation it belongs to.
    pub fingerprint: u64,
    /// The blocks it holds, as half-open ranges.
    pub blocks: Vec<(u64, u64)>,
    /// Scatterings so far.
    pub events: u64,
    /// Sums and sums of squares, in units of 2⁻⁸⁰.
    pub sums: Vec<[i128; 2]>,
}

impl Binned {
    /// Share per unit of `measure(lower, upper)`, for instance [`ring_area`] or [`solid_angle`].
    pub fn density(&self, measure: impl Fn(f64, f64) -> f64) -> Vec<Estimate> {
        let pairs = self.edges.windows(2).zip(&self.bins);
        pairs
            .map(|(edge, share)| {
                let size = measure(edge[0], edge[1]);
                Estimate {
                    value: share.value / size,
                    u: share.u / size,
                }
            })
            .collect()
    }

    /// The sum of all bins, without what lies beyond.
    pub fn sum(&self) -> f64 {
        self.bins.iter().map(|bin| bin.value).sum()
    }
}

/// Area between two radii.
pub fn ring_area(inner: f64, outer: f64) -> f64 {
    PI * (outer - inner) * (outer + inner)
}

/// Solid angle between two angles from the normal, in radians.
pub fn solid_angle(inner: f64, outer: f64) -> f64 {
    // cos a − cos b without cancellation.
    2.0 * TAU * (0.5 * (outer - inner)).sin() * (0.5 * (outer + inner)).sin()
}

impl Tally {
    pub(crate) fn new(fingerprint: u64, layout: Arc<Layout>) -> Self {
        let sums = vec![[0; 2]; layout.cells()];
        Self {
            fingerprint,
            layout,
            blocks: Vec::new(),
            sums,
            events: 0,
        }
    }

    /// Adds block number `block`.
    pub(crate) fn push(&mut self, block: u64, cells: &BlockCells<'_>) {
        self.blocks = union(&self.blocks, std::slice::from_ref(&(block..block + 1)));
        add_block(&mut self.sums, cells);
        self.events += cells.events;
    }

    /// Puts two results of one simulation together, in any order, with the same bytes as if they
    /// had been one run.
    ///
    /// # Errors
    ///
    /// [`CannotMerge`] if they are of different simulations or hold the same photons.
    pub fn merge(mut self, other: &Self) -> Result<Self, CannotMerge> {
        if self.fingerprint != other.fingerprint {
            return Err(CannotMerge::OtherSimulation(
                self.fingerprint,
                other.fingerprint,
            ));
        }
        if let Some(block) = first_common(&self.blocks, &other.blocks) {
            return Err(CannotMerge::SamePhotons { block });
        }
        self.blocks = union(&self.blocks, &other.blocks);
        for (sum, more) in self.sums.iter_mut().zip(&other.sums) {
            sum[0] = sum[0].saturating_add(more[0]);
            sum[1] = sum[1].saturating_add(more[1]);
        }
        self.events = self.events.saturating_add(other.events);
        Ok(self)
    }

    /// Everything there is to keep.
    pub fn state(&self) -> TallyState {
        TallyState {
            fingerprint: self.fingerprint,
            blocks: self
                .blocks
                .iter()
                .map(|range| (range.start, range.end))
                .collect(),
            events: self.events,
            sums: self.sums.clone(),
        }
    }

    /// What was kept, if it belongs to this simulation and is whole.
    pub(crate) fn restored(mut self, state: TallyState) -> Result<Self, CannotMerge> {
        if self.fingerprint != state.fingerprint {
            return Err(CannotMerge::OtherSimulation(
                self.fingerprint,
                state.fingerprint,
            ));
        }
        let (found, expected) = (state.sums.len(), self.sums.len());
        let in_order = state
            .blocks
            .iter()
            .all(|(start, end)| start < end && *end <= MOST_BLOCKS)
            && state.blocks.windows(2).all(|pair| pair[0].1 < pair[1].0);
        if found != expected || !in_order {
            return Err(CannotMerge::Damaged { found, expected });
        }
        self.blocks = state
            .blocks
            .into_iter()
            .map(|(start, end)| start..end)
            .collect();
        self.events = state.events;
        self.sums = state.sums;
        Ok(self)
    }

    /// Photons so far.
    pub fn photons(&self) -> u64 {
        self.block_count() * PHOTONS_PER_BLOCK
    }

    /// The blocks it holds, apart from one another and in order.
    pub fn blocks(&self) -> &[Range<u64>] {
        &self.blocks
    }

    /// The first block after all that it holds: where to go on.
    pub fn next_block(&self) -> u64 {
        self.blocks.last().map_or(0, |range| range.end)
    }

    /// Scatterings so far.
    pub fn events(&self) -> u64 {
        self.events
    }

    fn block_count(&self) -> u64 {
        self.blocks
            .iter()
            .map(|range| range.end - range.start)
            .sum()
    }

    /// The mean of a cell and its standard error, from the spread over photons or, where a photon
    /// contributes many times, over blocks. Infinite while there is a single sample.
    fn cell(&self, cell: usize) -> Estimate {
        let by_blocks = cell >= self.layout.many_times() || cell == Total::Roulette as usize;
        let samples = if by_blocks {
            self.block_count()
        } else {
            self.photons()
        } as f64;
        if samples == 0.0 {
            return Estimate {
                value: 0.0,
                u: f64::INFINITY,
            };
        }
        let [sum, squares] = self.sums[cell].map(inexact);
        let value = sum / samples;
        let u = if samples > 1.0 {
            ((squares / samples - value * value).max(0.0) / (samples - 1.0)).sqrt()
        } else {
            f64::INFINITY
        };
        Estimate { value, u }
    }

    fn cells(&self, start: usize, count: usize) -> Vec<Estimate> {
        (start..start + count).map(|cell| self.cell(cell)).collect()
    }

    fn binned(&self, start: usize, edges: &[f64]) -> Binned {
        let count = edges.len().saturating_sub(1);
        Binned {
            edges: edges.to_vec(),
            bins: self.cells(start, count),
            beyond: self.cell(start + count),
        }
    }

    /// Light that returns on the lit side without having scattered.
    pub fn specular(&self) -> Estimate {
        self.cell(Total::Specular as usize)
    }

    /// Light that returns on the lit side after scattering.
    pub fn reflectance(&self) -> Estimate {
        self.cell(Total::Reflectance as usize)
    }

    /// Light that leaves on the far side, scattered or not.
    pub fn transmittance(&self) -> Estimate {
        self.cell(Total::Transmittance as usize)
    }

    /// The part of the transmittance that has not scattered.
    pub fn unscattered_transmittance(&self) -> Estimate {
        self.cell(Total::Unscattered as usize)
    }

    /// Light absorbed.
    pub fn absorbed(&self) -> Estimate {
        self.cell(Total::Absorbed as usize)
    }

    /// Light still on its way at the cut-off of the path length.
    pub fn cut_off(&self) -> Estimate {
        self.cell(Total::CutOff as usize)
    }

    /// What roulette has taken more than given: 0 on average.
    pub fn roulette(&self) -> Estimate {
        self.cell(Total::Roulette as usize)
    }

    /// Everything, less the 1 that came in: 0 up to rounding.
    pub fn energy_error(&self) -> f64 {
        let parts = [
            self.specular(),
            self.reflectance(),
            self.transmittance(),
            self.absorbed(),
            self.cut_off(),
            self.roulette(),
        ];
        parts.iter().map(|part| part.value).sum::<f64>() - 1.0
    }

    /// The larger standard error of reflectance and transmittance: what a run is stopped by.
    pub fn u(&self) -> f64 {
        self.reflectance().u.max(self.transmittance().u)
    }

    /// Light absorbed in each layer.
    pub fn absorbed_by_layer(&self) -> Vec<Estimate> {
        self.cells(self.layout.by_layer(), self.layout.layers)
    }

    /// Light that leaves, by the distance from the beam, mm. The specular part is left out.
    pub fn by_radius(&self, side: Side) -> Binned {
        self.binned(self.layout.by_radius(side), self.layout.radius.edges())
    }

    /// Light that leaves, by its angle from the normal outside, radians.
    pub fn by_angle(&self, side: Side) -> Binned {
        self.binned(self.layout.by_angle(side), self.layout.angle.edges())
    }

    /// Light that leaves, by the length of its path inside, mm.
    pub fn by_path(&self, side: Side) -> Binned {
        self.binned(self.layout.by_path(side), self.layout.path.edges())
    }

    /// Light that leaves, by how often it has scattered: bin k holds order k, and order 0 on the
    /// lit side is the specular part.
    pub fn by_order(&self, side: Side) -> Binned {
        let edges: Vec<f64> = (0..self.layout.orders).map(|order| order as f64).collect();
        self.binned(self.layout.by_order(side), &edges)
    }

    /// Light that leaves, by radius (rows) and angle (columns), if it was asked for.
    pub fn by_radius_and_angle(&self, side: Side) -> Option<Binned2> {
        let Layout { radius, angle, .. } = &*self.layout;
        self.layout.radius_and_angle.then(|| Binned2 {
            row_edges: radius.edges().to_vec(),
            column_edges: angle.edges().to_vec(),
            cells: self.cells(
                self.layout.by_radius_and_angle(side),
                radius.cells() * angle.cells(),
            ),
        })
    }

    /// Light that leaves, by order of scattering, then angle (rows) and azimuth (columns) outside,
    /// radians, if it was asked for. The last entry holds all orders beyond those told apart;
    /// order 0 on the lit side, the specular part, is left out.
    pub fn by_order_and_direction(&self, side: Side) -> Option<Vec<Binned2>> {
        let Layout { angle, azimuth, .. } = &*self.layout;
        let (start, size) = (
            self.layout.by_order_and_direction(side),
            angle.cells() * azimuth.cells(),
        );
        (azimuth.count() > 0).then(|| {
            (0..self.layout.orders)
                .map(|order| Binned2 {
                    row_edges: angle.edges().to_vec(),
                    column_edges: azimuth.edges().to_vec(),
                    cells: self.cells(start + order * size, size),
                })
                .collect()
        })
    }

    /// Light absorbed, by depth, mm.
    pub fn absorbed_by_depth(&self) -> Option<Binned> {
        let depth = &self.layout.depth;
        (depth.count() > 0).then(|| self.binned(self.layout.by_depth(), depth.edges()))
    }

    /// Light absorbed, by depth (rows) and radius (columns), if it was asked for.
    pub fn absorbed_by_depth_and_radius(&self) -> Option<Binned2> {
        let Layout { depth, radius, .. } = &*self.layout;
        (depth.count() > 0 && self.layout.depth_and_radius).then(|| Binned2 {
            row_edges: depth.edges().to_vec(),
            column_edges: radius.edges().to_vec(),
            cells: self.cells(
                self.layout.by_depth_and_radius(),
                depth.cells() * radius.cells(),
            ),
        })
    }

    /// The profile on one side, as a fit takes it: exitance per incident power, mm⁻².
    pub fn profile(&self, side: Side) -> Vec<ProfilePoint> {
        let binned = self.by_radius(side);
        let rings = binned.edges.windows(2).zip(binned.density(ring_area));
        rings
            .map(|(edge, exitance)| ProfilePoint {
                ring_mm: Some((edge[0], edge[1])),
                radius_mm: mean_radius(edge[0], edge[1]),
                reflectance_per_mm2: exitance.value,
                u_reflectance_per_mm2: exitance.u,
                pixels: None,
            })
            .collect()
    }
}

/// Both sets of blocks as one, neighbours joined.
fn union(a: &[Range<u64>], b: &[Range<u64>]) -> Vec<Range<u64>> {
    let mut all: Vec<Range<u64>> = a.iter().chain(b).cloned().collect();
    all.sort_by_key(|range| range.start);
    let mut joined: Vec<Range<u64>> = Vec::with_capacity(all.len());
    for range in all {
        match joined.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => joined.push(range),
        }
    }
    joined
}

fn first_common(a: &[Range<u64>], b: &[Range<u64>]) -> Option<u64> {
    let pairs = a.iter().flat_map(|x| b.iter().map(move |y| (x, y)));
    let starts = pairs.filter_map(|(x, y)| {
        let start = x.start.max(y.start);
        (start < x.end.min(y.end)).then_some(start)
    });
    starts.min()
}
