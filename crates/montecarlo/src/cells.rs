//! Where tallies are kept: one flat row of cells, summed exactly.
//!
//! A block of photons sums in `f64`, always in the same order. Blocks add up as integers, in units
//! of 2⁻⁸⁰, and integers may be added in any order: results are the same bytes on any number of
//! threads, continued or in one go, and gathered from several machines.

use crate::bins::{Axis, Bins};
use crate::boundary::Side;
use crate::error::InvalidSimulation;
use std::f64::consts::{FRAC_PI_2, PI};

/// Photons in a block: the unit of work, and of the statistics of tallies to which one photon
/// contributes many times.
pub const PHOTONS_PER_BLOCK: u64 = 1 << 12;

/// Blocks that the sums can hold without overflow: 10¹² photons and more.
pub(crate) const MOST_BLOCKS: u64 = 1 << 30;

/// Cells of a tally that memory is asked to hold.
const MOST_CELLS: usize = 1 << 22;

/// What is counted besides the totals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TallySpec {
    /// Edges of rings about the beam, mm, from 0 upward. None: no profile.
    pub radius_mm: Vec<f64>,
    /// Bins of the angle of exit between 0 and 90 degrees. 0: none.
    pub angle_bins: usize,
    /// Also by radius and angle together.
    pub radius_and_angle: bool,
    /// Edges of the depth at which light is absorbed, mm, from 0 upward. None: no such tally.
    /// It follows every flight, which doubles the time of a run or more.
    pub depth_mm: Vec<f64>,
    /// Also absorption by depth and radius together.
    pub depth_and_radius: bool,
    /// Highest order of scattering told apart.
    pub orders: usize,
    /// Bins of the azimuth between 0 and 180 degrees, where 0 is the side to which an oblique beam
    /// travels. With them light that leaves is also counted by order of scattering, angle and
    /// azimuth together. 0: none.
    pub azimuth_bins: usize,
    /// Edges of the path length of light that leaves, mm, from 0 upward.
    pub path_mm: Vec<f64>,
    /// Path length at which photons are dropped, mm; what they still carried is told apart.
    pub path_cutoff_mm: Option<f64>,
}

/// A total.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum Total {
    Specular,
    Reflectance,
    Transmittance,
    Unscattered,
    Absorbed,
    CutOff,
    Roulette,
}

const TOTALS: usize = 7;

/// The place of every tally in the row of cells.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) radius: Bins,
    pub(crate) angle: Bins,
    pub(crate) depth: Bins,
    pub(crate) path: Bins,
    /// Cells by order: 0 to the highest told apart, and beyond.
    pub(crate) orders: usize,
    pub(crate) radius_and_angle: bool,
    pub(crate) azimuth: Bins,
    pub(crate) depth_and_radius: bool,
    pub(crate) layers: usize,
}

impl Layout {
    pub(crate) fn new(spec: &TallySpec, layers: usize) -> Result<Self, InvalidSimulation> {
        let layout = Self {
            radius: Bins::new(Axis::Radius, &spec.radius_mm)?,
            angle: Bins::new(Axis::Angle, &even(spec.angle_bins, FRAC_PI_2))?,
            azimuth: Bins::new(Axis::Azimuth, &even(spec.azimuth_bins, PI))?,
            depth: Bins::new(Axis::Depth, &spec.depth_mm)?,
            path: Bins::new(Axis::Path, &spec.path_mm)?,
            orders: spec.orders.min(MOST_CELLS) + 2,
            radius_and_angle: spec.radius_and_angle,
            depth_and_radius: spec.depth_and_radius,
            layers,
        };
        let [radius, angle, depth] =
            [&layout.radius, &layout.angle, &layout.depth].map(|bins| bins.count() > 0);
        for (asked, whole, rows, columns) in [
            (
                spec.radius_and_angle,
                radius && angle,
                Axis::Radius,
                Axis::Angle,
            ),
            (
                spec.depth_and_radius,
                depth && radius,
                Axis::Depth,
                Axis::Radius,
            ),
        ] {
            if asked && !whole {
                return Err(InvalidSimulation::Joint { rows, columns });
            }
        }
        let side = layout.side_cells();
        match layout.cells().max(side) {
            cells if cells > MOST_CELLS => Err(InvalidSimulation::TooManyCells {
                cells,
                limit: MOST_CELLS,
            }),
            _ => Ok(layout),
        }
    }

    fn joint_exit_cells(&self) -> usize {
        if self.radius_and_angle {
            self.radius.cells().saturating_mul(self.angle.cells())
        } else {
            0
        }
    }

    fn side_cells(&self) -> usize {
        let single = self.radius.cells() + self.angle.cells() + self.path.cells() + self.orders;
        (single + self.joint_exit_cells()).saturating_add(self.directional_cells())
    }

    fn directional_cells(&self) -> usize {
        if self.azimuth.count() == 0 {
            return 0;
        }
        let directions = self.angle.cells().saturating_mul(self.azimuth.cells());
        self.orders.saturating_mul(directions)
    }

    fn side(&self, side: Side) -> usize {
        TOTALS
            + if side == Side::Below {
                self.side_cells()
            } else {
                0
            }
    }

    pub(crate) fn by_radius(&self, side: Side) -> usize {
        self.side(side)
    }

    pub(crate) fn by_angle(&self, side: Side) -> usize {
        self.by_radius(side) + self.radius.cells()
    }

    pub(crate) fn by_path(&self, side: Side) -> usize {
        self.by_angle(side) + self.angle.cells()
    }

    pub(crate) fn by_order(&self, side: Side) -> usize {
        self.by_path(side) + self.path.cells()
    }

    pub(crate) fn by_radius_and_angle(&self, side: Side) -> usize {
        self.by_order(side) + self.orders
    }

    pub(crate) fn by_order_and_direction(&self, side: Side) -> usize {
        self.by_radius_and_angle(side) + self.joint_exit_cells()
    }

    /// From here on a photon contributes to a cell more than once, and errors come from the
    /// spread of blocks.
    pub(crate) fn many_times(&self) -> usize {
        self.side(Side::Below).saturating_add(self.side_cells())
    }

    pub(crate) fn by_layer(&self) -> usize {
        self.many_times()
    }

    pub(crate) fn by_depth(&self) -> usize {
        self.by_layer() + self.layers
    }

    pub(crate) fn by_depth_and_radius(&self) -> usize {
        self.by_depth() + self.depth.cells()
    }

    pub(crate) fn cells(&self) -> usize {
        let joint = if self.depth_and_radius {
            self.depth.cells().saturating_mul(self.radius.cells())
        } else {
            0
        };
        self.by_depth_and_radius().saturating_add(joint)
    }
}

/// Edges of so many bins of equal width from 0 to `end`.
fn even(bins: usize, end: f64) -> Vec<f64> {
    match bins.min(MOST_CELLS) {
        0 => Vec::new(),
        bins => (0..=bins).map(|k| end * k as f64 / bins as f64).collect(),
    }
}

/// A photon that leaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exit {
    pub(crate) side: Side,
    pub(crate) weight: f64,
    pub(crate) radius: f64,
    pub(crate) cos: f64,
    /// Its direction along the surface, of any length.
    pub(crate) along: [f64; 2],
    pub(crate) path: f64,
    pub(crate) order: u32,
    /// What the surface reflected of it before it entered.
    pub(crate) specular: f64,
}

/// The tallies of one block of photons.
#[derive(Debug)]
pub(crate) struct BlockCells<'a> {
    layout: &'a Layout,
    /// Σ w and Σ w² of each cell.
    cells: Vec<[f64; 2]>,
    /// Scatterings.
    pub(crate) events: u64,
}

impl<'a> BlockCells<'a> {
    pub(crate) fn new(layout: &'a Layout) -> Self {
        Self {
            layout,
            cells: vec![[0.0; 2]; layout.cells()],
            events: 0,
        }
    }

    /// Whether absorption is tallied along flights.
    pub(crate) fn follows_flights(&self) -> bool {
        self.layout.depth.count() > 0
    }

    fn add(&mut self, cell: usize, weight: f64) {
        let [sum, squares] = &mut self.cells[cell];
        *sum += weight;
        *squares += weight * weight;
    }

    /// A photon's reflection on arrival.
    pub(crate) fn arrive(&mut self, specular: f64) {
        self.add(Total::Specular as usize, specular);
        self.add(self.layout.by_order(Side::Above), specular);
    }

    /// A photon leaves. What returns without having scattered belongs to the specular part.
    pub(crate) fn leave(&mut self, exit: &Exit) {
        let Exit {
            side,
            weight,
            specular,
            ..
        } = *exit;
        if side == Side::Above && exit.order == 0 {
            // The photon has been counted once already, on arrival.
            let squares = (specular + weight).powi(2) - specular * specular;
            for cell in [Total::Specular as usize, self.layout.by_order(Side::Above)] {
                self.cells[cell][0] += weight;
                self.cells[cell][1] += squares;
            }
            return;
        }
        let layout = self.layout;
        let total = match side {
            Side::Above => Total::Reflectance,
            Side::Below => Total::Transmittance,
        };
        self.add(total as usize, weight);
        if side == Side::Below && exit.order == 0 {
            self.add(Total::Unscattered as usize, weight);
        }
        let radius = layout.radius.find(exit.radius);
        let angle = layout.angle.find(exit.cos.clamp(0.0, 1.0).acos());
        self.add(layout.by_radius(side) + radius, weight);
        self.add(layout.by_angle(side) + angle, weight);
        self.add(layout.by_path(side) + layout.path.find(exit.path), weight);
        let order = (exit.order as usize).min(layout.orders - 1);
        self.add(layout.by_order(side) + order, weight);
        if layout.radius_and_angle {
            let joint = radius * layout.angle.cells() + angle;
            self.add(layout.by_radius_and_angle(side) + joint, weight);
        }
        if layout.azimuth.count() > 0 {
            let [x, y] = exit.along;
            // The last edge, π itself, belongs to the last bin.
            let azimuth = layout.azimuth.find(y.atan2(x).abs());
            let azimuth = azimuth.min(layout.azimuth.count() - 1);
            let direction = angle * layout.azimuth.cells() + azimuth;
            let joint = order * layout.angle.cells() * layout.azimuth.cells() + direction;
            self.add(layout.by_order_and_direction(side) + joint, weight);
        }
    }

    /// A photon has come to its end, having left `absorbed` in the medium.
    pub(crate) fn absorb(&mut self, absorbed: f64) {
        self.add(Total::Absorbed as usize, absorbed);
    }

    /// A photon is dropped with this weight because its path is too long.
    pub(crate) fn cut_off(&mut self, weight: f64) {
        self.add(Total::CutOff as usize, weight);
    }

    /// Roulette took this weight away, or gave it if negative.
    pub(crate) fn roulette(&mut self, weight: f64) {
        self.cells[Total::Roulette as usize][0] += weight;
    }

    /// A photon leaves weight in a layer.
    pub(crate) fn absorb_in_layer(&mut self, layer: usize, weight: f64) {
        self.cells[self.layout.by_layer() + layer][0] += weight;
    }

    /// A photon leaves weight at a point.
    pub(crate) fn absorb_at(&mut self, [x, y, z]: [f64; 3], weight: f64) {
        let layout = self.layout;
        let depth = layout.depth.find(z);
        self.cells[layout.by_depth() + depth][0] += weight;
        if layout.depth_and_radius {
            let joint = depth * layout.radius.cells() + layout.radius.find((x * x + y * y).sqrt());
            self.cells[layout.by_depth_and_radius() + joint][0] += weight;
        }
    }
}

/// Sums over blocks in units of 2⁻⁸⁰.
pub(crate) type ExactCells = Vec<[i128; 2]>;

const UNIT: f64 = 1.0 / (1_u128 << 80) as f64;

fn exact(value: f64) -> i128 {
    (value / UNIT).round() as i128
}

pub(crate) fn inexact(sum: i128) -> f64 {
    sum as f64 * UNIT
}

/// Adds a block to the sums.
pub(crate) fn add_block(sums: &mut ExactCells, block: &BlockCells<'_>) {
    let many_times = block.layout.many_times();
    for (cell, (sum, &[first, second])) in sums.iter_mut().zip(&block.cells).enumerate() {
        let (first, second) = if cell >= many_times || cell == Total::Roulette as usize {
            // The block is the sample: its mean per photon, and that mean's square.
            let mean = first / PHOTONS_PER_BLOCK as f64;
            (mean, mean * mean)
        } else {
            (first, second)
        };
        sum[0] = sum[0].saturating_add(exact(first));
        sum[1] = sum[1].saturating_add(exact(second));
    }
}
