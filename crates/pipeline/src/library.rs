//! The tables that ship with beamspot.

use crate::error::{Blame, Error, Kind, Result};
use crate::unknown_g;
use formats::materials_csv;
use physics::{
    BetterDipoleModel, DiffuseFresnel, DipoleModel, DirectionalModel, ForwardModel,
    KienlePattersonModel, Material, MultipoleModel, ObliqueBeam, PhotonBeamDiffusionModel, Slab,
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
pub const MODELS: [&str; 8] = [
    "dipole",
    "jensen2001",
    "better-dipole",
    "kienle-patterson",
    "photon-beam-diffusion",
    "multipole",
    "directional",
    "monte-carlo",
];

/// Which model, at every relative index.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelChoice {
    /// Its name, one of [`MODELS`].
    pub name: String,
    /// Mean cosine of the scattering angle, where it is known.
    pub g: Option<f64>,
    /// The slab that the sample is, where it has an end.
    pub slab: Option<SlabChoice>,
    /// The beam: which way it falls, and where the profile has its centre.
    pub beam: ObliqueBeam,
}

/// A slab, at every relative index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlabChoice {
    /// Thickness, mm.
    pub thickness_mm: f64,
    /// Index of the slab over that of what lies below; `None` where that is what lies above.
    pub eta_below: Option<f64>,
}

impl SlabChoice {
    /// The slab at relative index `eta`.
    pub fn at(&self, eta: f64) -> Slab {
        Slab {
            thickness_mm: self.thickness_mm,
            eta_below: self.eta_below.unwrap_or(eta),
        }
    }
}

impl ModelChoice {
    /// Whether the model depends on g.
    pub fn uses_g(&self) -> bool {
        ["monte-carlo", "photon-beam-diffusion"].contains(&self.name.as_str())
    }

    /// Whether the model cannot do without a g that is not known, so that a fit has to find it.
    pub fn lacks_g(&self) -> bool {
        self.solves_transport() && self.g.is_none()
    }

    /// The same with a g that stands in where the model lacks one.
    pub(crate) fn with_stand_in(&self) -> Self {
        let mut choice = self.clone();
        if choice.lacks_g() {
            choice.g = Some(unknown_g::STAND_IN);
        }
        choice
    }

    /// Whether the model depends on the thickness of the sample.
    pub fn uses_slab(&self) -> bool {
        self.name == "multipole"
    }

    /// Whether the model depends on the way the beam falls.
    pub fn uses_beam(&self) -> bool {
        self.name == "directional"
    }

    /// Every model that what is known here allows, in the order of [`MODELS`]: the one of slabs
    /// where there is a thickness, and transport where its table reaches; without g it lacks it
    /// ([`Self::lacks_g`]), and a fit has to find it.
    pub fn all(&self, eta: f64) -> Vec<Self> {
        MODELS
            .iter()
            .map(|name| self.called(name))
            .filter(|choice| model(&choice.with_stand_in(), eta).is_ok())
            .collect()
    }

    /// The same sample under the model called `name`, without what that does not use.
    pub fn called(&self, name: &str) -> Self {
        let mut choice = Self {
            name: name.to_owned(),
            ..self.clone()
        };
        if !choice.uses_g() {
            choice.g = None;
        }
        if !choice.uses_slab() {
            choice.slab = None;
        }
        choice
    }

    /// Whether the model is the transport equation, and not a closed form that approximates it.
    pub fn solves_transport(&self) -> bool {
        self.name == "monte-carlo"
    }
}

impl Default for ModelChoice {
    fn default() -> Self {
        Self {
            name: MODELS[0].to_owned(),
            g: None,
            slab: None,
            beam: ObliqueBeam::NORMAL,
        }
    }
}

/// Whether there is a model of this name.
///
/// # Errors
///
/// A name that is not there is answered with those that are.
pub fn named(name: &str) -> Result<()> {
    if MODELS.contains(&name) {
        return Ok(());
    }
    let message = format!(
        "no model is called `{name}`; there are {}, and all",
        MODELS.join(", ")
    );
    Err(Error::new(Kind::Usage, message))
}

/// The model of `choice` at relative index `eta`.
///
/// # Errors
///
/// A name that is not there is answered with those that are; a g or a thickness that the model does
/// not use is refused, not ignored.
pub fn model(choice: &ModelChoice, eta: f64) -> Result<Box<dyn ForwardModel>> {
    let name = choice.name.as_str();
    physics::ReducedMedium {
        sigma_a: 0.0,
        sigma_s_prime: 1.0,
        eta,
    }
    .validated()
    .input("eta")?;
    named(name)?;
    if let Some(g) = choice.g.filter(|_| !choice.uses_g()) {
        let message = format!("model {name} does not use g, got {g}: leave it out");
        return Err(Error::new(Kind::Usage, message));
    }
    if let Some(slab) = choice.slab.filter(|_| !choice.uses_slab()) {
        let message = format!(
            "model {name} takes the sample as infinitely thick, got a thickness of {} mm: leave \
             it out, or take model multipole",
            slab.thickness_mm
        );
        return Err(Error::new(Kind::Usage, message));
    }
    if name == "monte-carlo" {
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
    if name == "multipole" {
        let slab = choice.slab.ok_or_else(|| {
            let message = "model multipole needs the thickness of the sample: give --thickness, or \
                           thickness_mm under [sample]";
            Error::new(Kind::Usage, message)
        })?;
        return Ok(Box::new(MultipoleModel::new(eta, checked(&slab, eta)?)));
    }
    match name {
        "dipole" => Ok(Box::new(DipoleModel::new(eta, DiffuseFresnel::Exact))),
        "jensen2001" => Ok(Box::new(DipoleModel::new(eta, DiffuseFresnel::RationalFit))),
        "better-dipole" => Ok(Box::new(BetterDipoleModel::new(eta))),
        "kienle-patterson" => Ok(Box::new(KienlePattersonModel::new(eta))),
        "photon-beam-diffusion" => {
            let g = choice.g.unwrap_or(0.0);
            // The phase function needs a g of its own domain.
            physics::Medium {
                sigma_a: 0.0,
                sigma_s: 1.0,
                g,
                eta,
            }
            .validated()
            .input("model photon-beam-diffusion")?;
            Ok(Box::new(PhotonBeamDiffusionModel::new(eta, g)))
        }
        "directional" => Ok(Box::new(DirectionalModel::new(eta, choice.beam))),
        _ => unreachable!("every name in MODELS has its arm"),
    }
}

/// The slab of `choice` at relative index `eta`, if there can be one.
fn checked(choice: &SlabChoice, eta: f64) -> Result<Slab> {
    let slab = choice.at(eta);
    if !(slab.thickness_mm > 0.0 && slab.thickness_mm.is_finite()) {
        let message = format!(
            "the thickness of a slab must be above 0 mm, got {} mm: leave it out for a sample \
             without end",
            slab.thickness_mm
        );
        return Err(Error::new(Kind::Usage, message));
    }
    physics::ReducedMedium {
        sigma_a: 0.0,
        sigma_s_prime: 1.0,
        eta: slab.eta_below,
    }
    .validated()
    .input("eta_below, the index of the sample over that of what lies below")?;
    Ok(slab)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(known: &ModelChoice) -> Vec<String> {
        known.all(1.4).into_iter().map(|m| m.name).collect()
    }

    #[test]
    fn all_models_are_those_that_the_sample_allows() {
        let bare = ModelChoice::default();
        assert_eq!(
            names(&bare),
            [
                "dipole",
                "jensen2001",
                "better-dipole",
                "kienle-patterson",
                "photon-beam-diffusion",
                "directional",
                "monte-carlo"
            ]
        );
        let known = ModelChoice {
            g: Some(0.8),
            slab: Some(SlabChoice {
                thickness_mm: 2.0,
                eta_below: None,
            }),
            ..bare
        };
        assert_eq!(names(&known), MODELS);
    }

    #[test]
    fn what_a_model_does_not_use_is_refused() {
        let slab = |thickness_mm, eta_below| SlabChoice {
            thickness_mm,
            eta_below,
        };
        let cases = [
            ("dipole", Some(0.8), None, "does not use g"),
            ("dipole", None, Some(slab(2.0, None)), "infinitely thick"),
            ("multipole", None, None, "needs the thickness"),
            (
                "multipole",
                None,
                Some(slab(-1.0, None)),
                "above 0 mm, got -1",
            ),
            (
                "multipole",
                None,
                Some(slab(1.0, Some(9.0))),
                "between 0.2 and 5",
            ),
            ("photon-beam-diffusion", Some(1.0), None, "between -1 and 1"),
            ("monte-carlo", None, None, "needs g"),
            ("monopole", None, None, "no model is called `monopole`"),
        ];
        for (name, g, slab, said) in cases {
            let choice = ModelChoice {
                name: name.to_owned(),
                g,
                slab,
                ..ModelChoice::default()
            };
            let error = model(&choice, 1.4).map(|m| m.name()).unwrap_err();
            assert!(format!("{error:#}").contains(said), "{name}: {error:#}");
        }
    }
}
