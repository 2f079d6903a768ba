//! Scenes as files, pictures as files.

mod difference;
mod flip;
mod layers;
mod outputs;
mod scene;
mod srgb;
mod texture;
mod validation;

pub use difference::{
    ChannelDifference, Drawn, FaceDifference, PictureDifference, RingDifference, compare_pictures,
    differences, read_pictures,
};
pub use flip::hdr_flip;
pub use layers::sheet;
pub(crate) use outputs::developed;
pub use outputs::{Outcome, PictureFiles};
pub use scene::{Loaded, load};
pub use validation::{MethodLine, Validation, validate};

use crate::error::{Blame, Error, Kind, Result};
use crate::monitor::Monitor;
use gauss_quad::GaussLegendre;
use physics::brdf::{BrdfApproximation, Directions};
use physics::{
    BetterDipoleModel, DiffuseFresnel, DipoleModel, DirectionalModel, ForwardModel, Layer,
    LayeredMedium, Medium, ObliqueBeam, Phase, ReducedMedium, fresnel,
};
use rayon::prelude::*;
use render::bssrdf::{Bssrdf, Diffusion, Exit, Family, Profile, Sampling};
use render::{
    Brdf, Gather, Kind as BrdfKind, Layered, Material, Method, MonteCarlo, Options, Picture,
    PointCloud, Pooled, Scene, Shaded,
};
use std::f64::consts::PI;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use transport::TransportModel;

/// How to make a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// The method.
    pub method: MethodChoice,
    /// Most rounds.
    pub rounds: u64,
    /// Stop once the rms of the pixels' standard errors is this share of the mean pixel.
    pub until_error: Option<f64>,
    /// Photons of each light and channel in a round.
    pub photons: u64,
    /// Seed of every random number.
    pub seed: u64,
    /// Tell components apart.
    pub components: bool,
    /// Factor on radiances before the tone curve of the PNG; found from the picture if left out.
    pub exposure: Option<f64>,
}

/// Which method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MethodChoice {
    /// Volume transport.
    MonteCarlo,
    /// A BRDF.
    Brdf(BrdfKind),
    /// BRDF and BTDF of the layers of each solid.
    Layered,
    /// A BSSRDF.
    Bssrdf(BssrdfModel, Sampling),
    /// The diffusion of a BSSRDF gathered from points over the surface.
    PointCloud(BssrdfModel, Gather),
}

/// Which BSSRDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BssrdfModel {
    /// The paper's, misprints mended.
    Jensen2001,
    /// The same, balanced: single scattering once, no light lost at the exit.
    Corrected,
    /// d'Eon's better dipole.
    BetterDipole,
    /// Frisvad's directional dipole, for light along the normal.
    Directional,
    /// The transport equation's own R_d.
    MonteCarlo,
}

impl BssrdfModel {
    /// All of them, with the names that commands call them by.
    pub const ALL: [(&'static str, Self); 5] = [
        ("jensen2001", Self::Jensen2001),
        ("corrected", Self::Corrected),
        ("better-dipole", Self::BetterDipole),
        ("directional", Self::Directional),
        ("monte-carlo", Self::MonteCarlo),
    ];

    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, model)| *model == self);
        found.map_or("", |(name, _)| name)
    }

    fn exit(self) -> Exit {
        match self {
            Self::Jensen2001 => Exit::Paper,
            _ => Exit::Balanced,
        }
    }

    /// Whether light that scattered once is added to the diffusion, which else has it already
    /// (as Jensen's has, too: his model counts it twice).
    fn adds_single(self) -> bool {
        matches!(
            self,
            Self::Jensen2001 | Self::Corrected | Self::BetterDipole
        )
    }

    /// The diffusion of one medium.
    ///
    /// # Errors
    ///
    /// The table of the transport equation does not reach the medium.
    pub fn diffusion(self, medium: &Medium) -> Result<Diffusion> {
        let coefficients = medium.reduced().coefficients();
        let of = |model: &dyn ForwardModel| {
            Profile::new(medium, |radii, out| {
                model.diffuse_reflectance(coefficients, radii, out);
            })
        };
        let eta = medium.eta;
        let profile = match self {
            Self::Jensen2001 => of(&DipoleModel::new(eta, DiffuseFresnel::RationalFit)),
            Self::Corrected => of(&DipoleModel::new(eta, DiffuseFresnel::Exact)),
            Self::BetterDipole => of(&BetterDipoleModel::new(eta)),
            Self::Directional => of(&DirectionalModel::new(eta, ObliqueBeam::NORMAL)),
            Self::MonteCarlo => {
                let model = TransportModel::new(eta, medium.g)
                    .fault("the table of the transport equation")?;
                of(&model)
            }
        };
        let share = match self {
            // What single scattering leaves of the light that a half-space returns.
            Self::Corrected => {
                let (exact, single) = returned(medium)?;
                ((exact - single) / fresnel::entry_factor(eta, 1.0) / profile.total()).max(0.0)
            }
            _ => 1.0,
        };
        let source_depth_mm = match self {
            // Their light is thought to come from the surface itself, near which R_d has no bound.
            Self::Directional | Self::MonteCarlo => 0.0,
            Self::Jensen2001 | Self::Corrected | Self::BetterDipole => {
                1.0 / medium.reduced().coefficients().sigma_t_prime()
            }
        };
        Ok(Diffusion {
            profile,
            share,
            source_depth_mm,
        })
    }
}

/// What a half-space returns of light along its normal, the specular part left out, by adding and
/// doubling; and what of it scattered once.
///
/// # Errors
///
/// The medium is none.
pub fn returned(medium: &Medium) -> Result<(f64, f64)> {
    let layered = LayeredMedium {
        layers: vec![Layer {
            sigma_a: medium.sigma_a,
            sigma_s: medium.sigma_s,
            phase: Phase::HenyeyGreenstein { g: medium.g },
            eta: medium.eta,
            thickness_mm: None,
        }],
        eta_above: 1.0,
        eta_below: 1.0,
    };
    let response = ::layers::solve(&layered, &[1.0], &[]).fault("energy")?;
    let brdf = BrdfApproximation::new(medium, DiffuseFresnel::Exact);
    let rule = GaussLegendre::new(NonZeroUsize::new(64).expect("64 is not zero"));
    let single = rule.integrate(0.0, 1.0, |cos_out| {
        let directions = Directions {
            cos_in: 1.0,
            cos_out,
            cos_azimuth: 1.0,
        };
        2.0 * PI * cos_out * brdf.single_scattering(&directions)
    });
    let exact = response.reflectance[0] - fresnel::reflectance(medium.eta, 1.0);
    Ok((exact, single))
}

/// What a half-space returns under a model of light along its normal: diffuse and single, shares
/// of the incident power, the specular part left out. [`returned`] is the truth beside it.
///
/// # Errors
///
/// As [`BssrdfModel::diffusion`].
pub fn audit(model: BssrdfModel, medium: &Medium) -> Result<(f64, f64)> {
    let Diffusion { profile, share, .. } = model.diffusion(medium)?;
    let leaves = match model.exit() {
        Exit::Paper => 1.0 - fresnel::diffuse_reflectance(medium.eta),
        Exit::Balanced => 1.0,
    };
    let diffuse = fresnel::entry_factor(medium.eta, 1.0) * share * profile.total() * leaves;
    let single = if model.adds_single() {
        returned(medium)?.1
    } else {
        0.0
    };
    Ok((diffuse, single))
}

/// The diffusion of a channel of a material: of its medium or, under a texture, of all between.
fn family(model: BssrdfModel, material: &Material, channel: usize) -> Result<Family> {
    let base = material.media[channel];
    if material.texture.is_none() {
        return Ok(model.diffusion(&base)?.into());
    }
    let media = material.representatives(channel);
    let albedos = media
        .iter()
        .map(|m| m.reduced().coefficients().albedo_prime());
    let ends = albedos.fold([1.0_f64, 0.0_f64], |[low, high], a| {
        [low.min(a), high.max(a)]
    });
    let albedos = Family::albedos(ends);
    let tables = albedos.par_iter().map(|albedo| {
        let reduced = ReducedMedium {
            sigma_a: 1.0 - albedo,
            sigma_s_prime: *albedo,
            eta: base.eta,
        };
        model.diffusion(&reduced.with_g(base.g))
    });
    Ok(Family::between(&albedos, tables.collect::<Result<_>>()?))
}

/// The shader of a BSSRDF for a scene.
///
/// # Errors
///
/// As [`BssrdfModel::diffusion`].
pub fn bssrdf(scene: &Scene, model: BssrdfModel, sampling: Sampling) -> Result<Bssrdf> {
    let of_object = scene
        .objects
        .iter()
        .map(|object| {
            let channels = 0..scene.channels.len();
            channels
                .map(|channel| family(model, &object.material, channel))
                .collect()
        })
        .collect::<Result<Vec<Vec<Family>>>>()?;
    Ok(Bssrdf::new(
        scene,
        of_object,
        model.exit(),
        model.adds_single(),
        sampling,
    ))
}

/// The method of the options for a scene.
fn method<'a>(loaded: &'a Loaded, options: &RenderOptions) -> Result<Box<dyn Method + 'a>> {
    let scene: &Scene = &loaded.scene;
    let RenderOptions {
        seed, components, ..
    } = *options;
    if options.method != MethodChoice::MonteCarlo {
        scene.check_for_surfaces().input(loaded.path.display())?;
    }
    Ok(match options.method {
        MethodChoice::MonteCarlo => {
            let options = Options {
                seed,
                photons: options.photons,
                components,
                rings: loaded.rings.clone(),
            };
            Box::new(MonteCarlo::new(scene, options).input(loaded.path.display())?)
        }
        MethodChoice::Brdf(kind) => {
            Box::new(Shaded::new(scene, Brdf::new(scene, kind), seed, components))
        }
        MethodChoice::Layered => {
            let of_object = scene
                .objects
                .iter()
                .zip(&loaded.layers)
                .map(|(object, found)| {
                    if object.material.texture.is_some() {
                        let message = format!(
                            "object `{}` has a `texture`, which --brdf layered does not show: its layers have media of their own; leave one of the two out",
                            object.name
                        );
                        return Err(Error::new(Kind::Input, message).within(loaded.path.display()));
                    }
                    if found.is_empty() {
                        let message = format!(
                            "object `{}` has no `layers`, which --brdf layered shows",
                            object.name
                        );
                        return Err(Error::new(Kind::Input, message).within(loaded.path.display()));
                    }
                    found.iter().map(sheet).collect()
                });
            let layered = Layered::new(scene, of_object.collect::<Result<_>>()?);
            Box::new(Shaded::new(scene, layered, seed, components))
        }
        MethodChoice::Bssrdf(model, sampling) => {
            let shader = bssrdf(scene, model, sampling);
            let shader = shader.map_err(|e| e.within(loaded.path.display()))?;
            Box::new(Pooled::new(scene, shader, seed, components))
        }
        MethodChoice::PointCloud(model, gather) => {
            let shader = bssrdf(scene, model, Sampling::Axes);
            let shader = shader.map_err(|e| e.within(loaded.path.display()))?;
            let cloud = PointCloud::new(scene, shader, gather, seed, components);
            Box::new(cloud.input(loaded.path.display())?)
        }
    })
}

/// Makes a picture of a scene, from `before` on if there is something.
///
/// An interrupt keeps what is done.
///
/// # Errors
///
/// The method cannot do justice to the scene, or there is not one round before the interrupt.
pub fn render(
    loaded: &Loaded,
    options: &RenderOptions,
    before: Option<Picture>,
    monitor: &dyn Monitor,
) -> Result<Picture> {
    if options.rounds == 0 || options.photons == 0 {
        return Err(Error::new(
            Kind::Usage,
            "expected at least one round and one photon",
        ));
    }
    if options
        .until_error
        .is_some_and(|e| !(e > 0.0 && e.is_finite()))
    {
        return Err(Error::new(
            Kind::Usage,
            "--until-error: expected a number above 0",
        ));
    }
    let method = method(loaded, options)?;
    let mut picture = method.empty();
    if let Some(before) = before {
        let fits = before.radiance.len() == picture.radiance.len()
            && before.powers.len() == picture.powers.len();
        if !fits {
            return Err(Error::new(
                Kind::Input,
                "the state belongs to a picture of another size; render anew with --force",
            ));
        }
        picture = before;
    }
    // A standard error of few rounds is not known well enough to stop by.
    const LEAST: u64 = 16;
    let enough = |picture: &Picture| {
        let rounds = picture.radiance.rounds();
        options
            .until_error
            .is_some_and(|e| rounds >= LEAST && picture.radiance.relative_error() <= e)
    };
    let first = picture.radiance.rounds();
    monitor.begin("rounds", options.rounds.saturating_sub(first));
    if first < options.rounds && !enough(&picture) {
        method.run(first..options.rounds, &mut picture, &mut |picture| {
            monitor.step();
            // Looking at all pixels takes its time, too.
            let due = picture.radiance.rounds().is_multiple_of(8);
            if monitor.stopped() || (due && enough(picture)) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
    }
    if picture.radiance.rounds() == 0 {
        return Err(Error::interrupted());
    }
    Ok(picture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::random::{stream, uniform};
    use render::camera::Lens;
    use render::surface::{Point, Shader};
    use render::{Camera, HalfSpace, Lamp, Light, Object, Shape, Vec3, View};

    fn medium(albedo: f64, eta: f64) -> Medium {
        Medium {
            sigma_a: 1.0 - albedo,
            sigma_s: albedo,
            g: 0.0,
            eta,
        }
    }

    /// The audit table. Under the paper's model 3 % too little comes out of marble and twice too
    /// much of a dark medium; the corrected one returns what transport does.
    #[test]
    fn the_corrected_model_has_the_energy_of_transport() {
        println!("model: returned over the truth");
        for (name, albedo, eta) in [
            ("marble G", 2.62 / 2.6241, 1.5),
            ("0.95", 0.95, 1.3),
            ("0.9", 0.9, 1.5),
            ("skin1 G", 0.88 / 1.05, 1.3),
            ("0.7", 0.7, 1.4),
            ("half", 0.5, 1.5),
        ] {
            let medium = medium(albedo, eta);
            let (exact, _) = returned(&medium).unwrap();
            for (model_name, model) in BssrdfModel::ALL {
                let (diffuse, single) = audit(model, &medium).unwrap();
                let ratio = (diffuse + single) / exact;
                println!(
                    "{name:>9} {model_name:>13}: {diffuse:.4} + {single:.4} for {exact:.4}: {ratio:.3}"
                );
                if model == BssrdfModel::Corrected {
                    assert!((ratio - 1.0).abs() < 0.03, "{name}: {ratio}");
                }
            }
        }
    }

    /// The renderer itself returns what the audit says, to all sides together.
    #[test]
    fn the_shader_returns_what_the_audit_says() {
        let medium = medium(0.8, 1.4);
        let view = View {
            from: Vec3::Z,
            to: Vec3::ZERO,
            up: Vec3::Y,
            width: 1,
            height: 1,
        };
        let scene = Scene {
            channels: vec!["Y".into()],
            objects: vec![Object {
                name: "sample".into(),
                shape: Shape::HalfSpace(HalfSpace {
                    point: Vec3::ZERO,
                    normal: Vec3::Z,
                }),
                material: Material {
                    media: vec![medium],
                    texture: None,
                },
            }],
            lamps: vec![Lamp {
                light: Light::Distant {
                    direction: Vec3::NEG_Z,
                    radius: 0.0,
                },
                strength: vec![1.0],
            }],
            camera: Camera::new(view, Lens::Orthographic { height: 1.0 }).unwrap(),
        };
        let point = Point {
            object: 0,
            at: Vec3::ZERO,
            true_normal: Vec3::Z,
            normal: Vec3::Z,
            coordinates: None,
        };
        for (name, model) in BssrdfModel::ALL {
            let shader = bssrdf(&scene, model, Sampling::Axes).unwrap();
            let mut rng = stream(2, &[]);
            let n = 200_000;
            let (mut diffuse, mut single) = ([0.0; 1], [0.0; 1]);
            for _ in 0..n {
                let cos = uniform(&mut rng).sqrt();
                let view = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                shader.shade(&scene, &point, view, &mut rng, &mut single, &mut diffuse);
            }
            let [diffuse, single] =
                [diffuse, single].map(|sum: [f64; 1]| PI * sum[0] / f64::from(n));
            let expected = audit(model, &medium).unwrap();
            println!("{name}: {diffuse:.5}, {single:.5} for {expected:?}");
            assert!((diffuse / expected.0 - 1.0).abs() < 0.005, "{name}");
            assert!((single - expected.1).abs() <= 0.01 * expected.1, "{name}");
        }
    }
}
