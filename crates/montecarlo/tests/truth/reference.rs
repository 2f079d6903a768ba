//! The rows of `fixtures/monte-carlo/adding-doubling.csv` as simulations.

use montecarlo::{
    Beam, Direction, Incidence, InvalidSimulation, Layer, LayeredMedium, Phase, Simulation,
    TallySpec,
};

/// Optical thickness from which a slab of the table stands for a half-space.
const HALF_SPACE: f64 = 1e5;

/// One row: a medium with σₜ = 1 mm⁻¹, its light, and what it reflects and transmits.
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) medium: LayeredMedium,
    pub(crate) incidence: Incidence,
    /// Total reflectance, the specular part included, and its uncertainty.
    pub(crate) reflectance: [f64; 2],
    /// Transmittance and its uncertainty.
    pub(crate) transmittance: [f64; 2],
}

impl Row {
    pub(crate) fn simulation(
        &self,
        tally: &TallySpec,
        seed: u64,
    ) -> Result<Simulation, InvalidSimulation> {
        Simulation::new(self.medium.clone(), self.incidence.clone(), tally, seed)
    }
}

/// All rows.
pub(crate) fn adding_doubling() -> Vec<Row> {
    let table = include_str!("../../../../fixtures/monte-carlo/adding-doubling.csv");
    table.lines().skip(1).map(row).collect()
}

fn row(line: &'static str) -> Row {
    let fields: Vec<&str> = line.split(',').collect();
    let number = |k: usize| fields[k].parse::<f64>().expect("a number");
    let list = |k: usize| {
        fields[k]
            .split(';')
            .map(|n| n.parse::<f64>().expect("a number"))
    };
    let eta = number(4);
    let layers = list(1)
        .zip(list(2))
        .zip(list(3))
        .map(|((albedo, thickness), g)| Layer {
            sigma_a: 1.0 - albedo,
            sigma_s: albedo,
            phase: Phase::HenyeyGreenstein { g },
            eta,
            thickness_mm: (thickness < HALF_SPACE).then_some(thickness),
        });
    let angle = number(7).acos();
    Row {
        name: fields[0],
        medium: LayeredMedium {
            layers: layers.collect(),
            eta_above: 1.0,
            eta_below: 1.0,
        },
        incidence: Incidence {
            beam: Beam::Point,
            direction: Direction::Collimated { angle },
        },
        reflectance: [number(8), number(10)],
        transmittance: [number(9), number(11)],
    }
}
