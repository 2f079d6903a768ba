//! The tables that ship with beamspot.

use crate::error::{Blame, Error, Kind, Result};
use formats::materials_csv;
use physics::{
    BetterDipoleModel, DiffuseFresnel, DipoleModel, ForwardModel, KienlePattersonModel, Material,
};
use transport::TransportModel;

/// Jensen et al. (2001), Figure 5, as `data/materials.csv`.
const MATERIALS: &str = include_str!("../../../data/materials.csv");

/// The materials of Jensen's table, three channels each.
pub fn materials() -> Vec<Material> {
    materials_csv::read(MATERIALS.as_bytes()).expect("the shipped table is read by the tests")
}

/// The text of Jensen's table, for those who want the digits as printed.
pub fn materials_text() -> &'static str {
    MATERIALS
}

/// The channels of the shipped material called `name`, whatever its case.
///
/// # Errors
///
/// A name that is not there is answered with those that are.
pub fn material(name: &str) -> Result<Vec<Material>> {
    let all = materials();
    let found: Vec<Material> = all
        .iter()
        .filter(|m| m.material.eq_ignore_ascii_case(name))
        .cloned()
        .collect();
    if found.is_empty() {
        let mut names: Vec<&str> = all.iter().map(|m| m.material.as_str()).collect();
        names.dedup();
        let message = format!(
            "no material is called `{name}`; there are {}",
            names.join(", ")
        );
        return Err(Error::new(Kind::Usage, message));
    }
    Ok(found)
}

/// The names of the models that a fit can use.
pub const MODELS: [&str; 5] = [
    "dipole",
    "jensen2001",
    "better-dipole",
    "kienle-patterson",
    "monte-carlo",
];

/// Which model, at every relative index.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelChoice {
    /// Its name, one of [`MODELS`].
    pub name: String,
    /// Mean cosine of the scattering angle, where it is known.
    pub g: Option<f64>,
}

impl ModelChoice {
    /// Whether the model depends on g.
    pub fn uses_g(&self) -> bool {
        self.name == "monte-carlo"
    }
}

impl Default for ModelChoice {
    fn default() -> Self {
        Self {
            name: MODELS[0].to_owned(),
            g: None,
        }
    }
}

/// The model of `choice` at relative index `eta`.
///
/// # Errors
///
/// A name that is not there is answered with those that are; a g that the model does not use is
/// refused, not ignored.
pub fn model(choice: &ModelChoice, eta: f64) -> Result<Box<dyn ForwardModel>> {
    let name = choice.name.as_str();
    physics::ReducedMedium {
        sigma_a: 0.0,
        sigma_s_prime: 1.0,
        eta,
    }
    .validated()
    .input("eta")?;
    if choice.uses_g() {
        let g = choice.g.ok_or_else(|| {
            let message = "model monte-carlo needs g, the mean cosine of the scattering angle, which \
                           shapes the profile near the beam: give --g (0.8 to 0.95 for tissue and \
                           milk, 0 if scattering is isotropic)";
            Error::new(Kind::Usage, message)
        })?;
        return Ok(Box::new(
            TransportModel::new(eta, g).input("model monte-carlo")?,
        ));
    }
    if let Some(g) = choice.g {
        let message = format!("model {name} does not use g, got {g}: leave it out");
        return Err(Error::new(Kind::Usage, message));
    }
    match name {
        "dipole" => Ok(Box::new(DipoleModel::new(eta, DiffuseFresnel::Exact))),
        "jensen2001" => Ok(Box::new(DipoleModel::new(eta, DiffuseFresnel::RationalFit))),
        "better-dipole" => Ok(Box::new(BetterDipoleModel::new(eta))),
        "kienle-patterson" => Ok(Box::new(KienlePattersonModel::new(eta))),
        _ => {
            let message = format!(
                "no model is called `{name}`; there are {}",
                MODELS.join(", ")
            );
            Err(Error::new(Kind::Usage, message))
        }
    }
}
