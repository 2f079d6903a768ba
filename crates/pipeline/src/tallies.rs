//! The tallies of a simulation as tables.

use formats::medium_toml::TallyEntry;
use montecarlo::{Binned, Estimate, Side, Tally, ring_area, solid_angle};

/// The two sides of a medium, and what the light that leaves there is called.
pub(crate) const SIDES: [(Side, &str); 2] =
    [(Side::Above, "reflectance"), (Side::Below, "transmittance")];

/// One tally, bin by bin; what lies beyond the last bin of an axis has rows of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// What it counts, for instance `reflectance_angle`.
    pub name: String,
    /// Names of the columns, with their units.
    pub columns: Vec<&'static str>,
    /// Row by row. What lies beyond has no upper edge, and no density.
    pub rows: Vec<Vec<Option<f64>>>,
}

impl Table {
    /// The table as csv; what is absent is blank.
    pub(crate) fn csv(&self) -> String {
        let mut text = self.columns.join(",") + "\n";
        for row in &self.rows {
            let cells = row
                .iter()
                .map(|x| x.map_or(String::new(), |x| x.to_string()));
            text += &(cells.collect::<Vec<_>>().join(",") + "\n");
        }
        text
    }
}

/// What bins run over: names of their edges, the unit of these, the size of a bin.
struct Axis<'a> {
    names: [&'static str; 2],
    edges: &'a [f64],
    unit: fn(f64) -> f64,
    size: fn(f64, f64) -> f64,
}

impl<'a> Axis<'a> {
    fn radius(edges: &'a [f64]) -> Self {
        Self {
            size: ring_area,
            ..Self::length(["radius_min_mm", "radius_max_mm"], edges)
        }
    }

    fn angle(edges: &'a [f64]) -> Self {
        Self {
            names: ["angle_min_deg", "angle_max_deg"],
            edges,
            unit: f64::to_degrees,
            size: solid_angle,
        }
    }

    fn depth(edges: &'a [f64]) -> Self {
        Self::length(["depth_min_mm", "depth_max_mm"], edges)
    }

    fn length(names: [&'static str; 2], edges: &'a [f64]) -> Self {
        Self {
            names,
            edges,
            unit: |x| x,
            size: |low, high| high - low,
        }
    }

    fn bins(&self) -> impl Iterator<Item = (f64, Option<f64>)> {
        let upper = self.edges.iter().skip(1).map(|&edge| Some(edge));
        self.edges.iter().copied().zip(upper.chain([None]))
    }
}

/// `cells` row by row over the bins of `axes`, those beyond included; `per` names the density.
fn table(name: String, axes: &[Axis<'_>], per: [&'static str; 2], cells: &[Estimate]) -> Table {
    let mut bins: Vec<Vec<(f64, Option<f64>)>> = vec![vec![]];
    for axis in axes {
        bins = bins
            .iter()
            .flat_map(|outer| {
                axis.bins()
                    .map(move |bin| [outer.as_slice(), &[bin]].concat())
            })
            .collect();
    }
    let row = |bins: &Vec<(f64, Option<f64>)>, cell: &Estimate| {
        let mut row = vec![];
        let mut size = Some(1.0);
        for (axis, &(low, high)) in axes.iter().zip(bins) {
            row.extend([Some((axis.unit)(low)), high.map(axis.unit)]);
            size = size
                .zip(high)
                .map(|(size, high)| size * (axis.size)(low, high));
        }
        row.extend([Some(cell.value), Some(cell.u)]);
        row.extend([cell.value, cell.u].map(|x| size.map(|size| x / size)));
        row
    };
    Table {
        name,
        columns: axes
            .iter()
            .flat_map(|axis| axis.names)
            .chain(["share", "u_share"])
            .chain(per)
            .collect(),
        rows: bins.iter().zip(cells).map(|(b, c)| row(b, c)).collect(),
    }
}

fn with_beyond(binned: &Binned) -> Vec<Estimate> {
    [&binned.bins[..], &[binned.beyond]].concat()
}

/// Every tally that `spec` asks for, but the totals and the profiles over the radius.
pub fn tables(spec: &TallyEntry, tally: &Tally) -> Vec<Table> {
    let mut tables = vec![];
    for (side, name) in SIDES {
        if spec.angle_bins > 0 {
            let by = tally.by_angle(side);
            let per = ["share_per_sr", "u_share_per_sr"];
            let axes = [Axis::angle(&by.edges)];
            tables.push(table(
                format!("{name}_angle"),
                &axes,
                per,
                &with_beyond(&by),
            ));
        }
        if let Some(by) = tally.by_radius_and_angle(side) {
            let per = ["share_per_mm2_sr", "u_share_per_mm2_sr"];
            let axes = [Axis::radius(&by.row_edges), Axis::angle(&by.column_edges)];
            tables.push(table(format!("{name}_r_angle"), &axes, per, &by.cells));
        }
        if spec.orders > 0 {
            tables.push(by_order(format!("{name}_order"), &tally.by_order(side)));
        }
        if spec.path_bins > 0 {
            let by = tally.by_path(side);
            let per = ["share_per_mm", "u_share_per_mm"];
            let axes = [Axis::length(["path_min_mm", "path_max_mm"], &by.edges)];
            tables.push(table(format!("{name}_path"), &axes, per, &with_beyond(&by)));
        }
    }
    if let Some(by) = tally.absorbed_by_depth() {
        let per = ["share_per_mm", "u_share_per_mm"];
        let axes = [Axis::depth(&by.edges)];
        tables.push(table(
            "absorbed_z".to_owned(),
            &axes,
            per,
            &with_beyond(&by),
        ));
    }
    if let Some(by) = tally.absorbed_by_depth_and_radius() {
        let per = ["share_per_mm3", "u_share_per_mm3"];
        let axes = [Axis::depth(&by.row_edges), Axis::radius(&by.column_edges)];
        tables.push(table("absorbed_z_r".to_owned(), &axes, per, &by.cells));
    }
    tables
}

/// Orders have no width; the last row, without a number, holds all beyond.
fn by_order(name: String, by: &Binned) -> Table {
    let orders = (0..by.bins.len())
        .map(|order| Some(order as f64))
        .chain([None]);
    Table {
        name,
        columns: vec!["order", "share", "u_share"],
        rows: orders
            .zip(with_beyond(by))
            .map(|(order, cell)| vec![order, Some(cell.value), Some(cell.u)])
            .collect(),
    }
}
