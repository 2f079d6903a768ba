//! Fills `data/discrepancy.csv`: the relative error of every closed form against the transport
//! equation, over a training set of media.
//!
//! `cargo run --release -p beamspot-pipeline --example discrepancy > data/discrepancy.csv`; takes a
//! second, once the transport table is there.

use physics::{Coefficients, ForwardModel};
use pipeline::discrepancy::{ETA, G, K, entry, radii, relative_error};
use pipeline::library::{self, MODELS, ModelChoice};
use std::error::Error;
use std::io::{Write, stdout};
use transport::TransportModel;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = stdout().lock();
    writeln!(
        out,
        "model,eta,g,k,relative errors of R_d at each radius then of the light within it"
    )?;
    let choices = MODELS.map(|name| ModelChoice {
        name: name.to_owned(),
        ..ModelChoice::default()
    });
    // What depends on more than the medium would need a table over that as well.
    let forms = choices
        .into_iter()
        .filter(|choice| !choice.solves_transport() && !choice.uses_slab() && !choice.uses_beam());
    for choice in forms {
        let told = [false, true]
            .into_iter()
            .filter(|told| !told || choice.uses_g());
        for (told, eta) in told.flat_map(|told| ETA.map(|eta| (told, eta))) {
            let truths = G.map(|g| TransportModel::new(eta, g));
            for k in K {
                let at = Coefficients::from_sigma_tr(k, 1.0);
                for (g, truth) in G.iter().zip(&truths) {
                    let truth = truth.as_ref().map_err(|e| *e)?;
                    let choice = ModelChoice {
                        g: told.then_some(*g),
                        ..choice.clone()
                    };
                    let model = library::model(&choice, eta)?;
                    let name = entry(&choice);
                    write!(out, "{name},{eta},{g},{k}")?;
                    for radius in radii() {
                        let of = |model: &dyn ForwardModel| {
                            let mut value = [0.0];
                            model.diffuse_reflectance(at, &[radius], &mut value);
                            value[0]
                        };
                        write!(out, ",{:.4}", relative_error(of(truth), of(&*model)))?;
                    }
                    for radius in radii() {
                        let of = |model: &dyn ForwardModel| model.within(at, radius).value;
                        write!(out, ",{:.4}", relative_error(of(truth), of(&*model)))?;
                    }
                    writeln!(out)?;
                }
            }
        }
    }
    Ok(())
}
