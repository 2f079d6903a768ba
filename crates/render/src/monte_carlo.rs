//! The method `monte-carlo`: volume transport through refracting surfaces, without bias.
//!
//! Light of a beam, or of any lamp that shines on flat solids alone, is followed from the lamp
//! and connected to the camera at every scattering; an even sky, and lamps with a size over
//! curved solids, are found from the camera. What the lamps of the first kind show without any
//! scattering (their mirror images) is found from the camera as well.

use crate::guide::Guide;
use crate::light::Light;
use crate::method::{Method, Picture, Planes};
use crate::paths::{self, Wanted};
use crate::photons::{Ledger, Photons, Rings, SEEN_DEPTH};
use crate::scene::{Object, Scene, SceneError};

/// How a picture is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Seed of every random number.
    pub seed: u64,
    /// Effort of a round: so many photons of each light and channel. Those of a beam are fewer, and
    /// split on their way.
    pub photons: u64,
    /// Tell apart light that scattered once, more often and never.
    pub components: bool,
    /// Rings in which leaving light is counted.
    pub rings: Option<Rings>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            photons: 40_000,
            components: false,
            rings: None,
        }
    }
}

/// A scene and how light is followed in it.
#[derive(Debug)]
pub struct MonteCarlo<'a> {
    scene: &'a Scene,
    options: Options,
    from_lamps: Vec<bool>,
    wanted: Wanted,
    ledger: Ledger,
    /// For each channel and, within it, light.
    guides: Vec<Option<Guide>>,
    seen_depth: f64,
}

impl<'a> MonteCarlo<'a> {
    /// Decides for each light from which side it is followed.
    ///
    /// # Errors
    ///
    /// [`SceneError::OutOfReach`] or [`SceneError::Unbounded`]: a light that neither way does
    /// justice to. [`SceneError::Textured`]: a solid whose inside nobody has told.
    pub fn new(scene: &'a Scene, options: Options) -> Result<Self, SceneError> {
        let textured = |o: &&Object| o.material.texture.is_some();
        if let Some(object) = scene.objects.iter().find(textured) {
            return Err(SceneError::Textured(object.name.clone()));
        }
        let flat = scene.objects.iter().all(|o| o.shape.flat_faces().is_some());
        let endless = scene.objects.iter().any(|o| o.shape.bounds().is_none());
        let mut from_lamps = vec![];
        for (index, lamp) in scene.lamps.iter().enumerate() {
            from_lamps.push(match lamp.light {
                Light::Sky => false,
                Light::Beam { .. } if flat => true,
                _ if flat && !endless => true,
                _ if lamp.light.can_be_met() => false,
                _ if flat => return Err(SceneError::Unbounded(index + 1)),
                _ => return Err(SceneError::OutOfReach(index + 1)),
            });
        }
        let ledger = Ledger::new(scene, options.rings.as_ref());
        let guides = (0..scene.channels.len())
            .flat_map(|channel| {
                from_lamps
                    .iter()
                    .enumerate()
                    .map(move |lamp| (channel, lamp))
            })
            .map(|(channel, (lamp, followed))| {
                followed.then(|| Guide::new(scene, channel, lamp)).flatten()
            })
            .collect();
        Ok(Self {
            scene,
            wanted: Wanted {
                scattered: from_lamps.iter().map(|followed| !followed).collect(),
                unscattered: vec![true; from_lamps.len()],
            },
            from_lamps,
            ledger,
            guides,
            seen_depth: SEEN_DEPTH,
            options,
        })
    }

    fn planes(&self) -> Planes {
        Planes {
            channels: self.scene.channels.len(),
            components: self.options.components,
        }
    }

    /// Where the powers stand.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}

impl Method for MonteCarlo<'_> {
    fn scene(&self) -> &Scene {
        self.scene
    }

    fn empty(&self) -> Picture {
        Picture::empty(self.planes(), self.scene, self.ledger.len())
    }

    fn round(&self, index: u64) -> (Vec<f64>, Vec<f64>) {
        let planes = self.planes();
        let plane = |channel: usize, order: u32| planes.of(channel, order);
        let mut radiance = vec![0.0; planes.len() * self.scene.pixels()];
        let mut powers = vec![0.0; self.ledger.len()];
        if self.from_lamps.contains(&true) {
            let photons = Photons {
                scene: self.scene,
                lamps: self.from_lamps.clone(),
                photons: self.options.photons,
                seed: self.options.seed,
                rings: self.options.rings.as_ref(),
                ledger: self.ledger.clone(),
                guides: &self.guides,
                seen_depth: self.seen_depth,
            };
            photons.round(index, plane, &mut radiance, &mut powers);
        }
        if self.scene.lamps.iter().any(|lamp| lamp.light.can_be_met()) {
            let seed = self.options.seed;
            paths::round(self.scene, &self.wanted, seed, index, plane, &mut radiance);
        }
        (radiance, powers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Lens, View};
    use crate::light::Spot;
    use crate::scene::{Lamp, Material};
    use crate::shape::{Block, Shape};
    use crate::{Estimate, Vec3};
    use physics::Medium;
    use std::ops::{ControlFlow, Range};

    /// A block of `size` transport lengths or so under a light, seen from a corner: its walls show
    /// in the picture, and mirror images of what scatters near them.
    fn scene(lens: Lens, size: f64, light: Light) -> Scene {
        let medium = Medium {
            sigma_a: 0.05 * size,
            sigma_s: 0.7 * size,
            g: 0.4,
            eta: 1.5,
        };
        let view = View {
            from: Vec3::new(9.0, -12.0, 8.0),
            to: Vec3::new(0.0, 0.0, 0.0),
            up: Vec3::Z,
            width: 6,
            height: 6,
        };
        Scene {
            channels: vec!["G".into()],
            objects: vec![Object {
                name: "block".into(),
                shape: Shape::Block(Block {
                    min: Vec3::new(-1.5, -1.0, -1.0),
                    max: Vec3::new(1.5, 1.0, 0.8),
                }),
                material: Material {
                    media: vec![medium],
                    texture: None,
                },
            }],
            lamps: vec![Lamp {
                light,
                strength: vec![1.0],
            }],
            camera: Camera::new(view, lens).unwrap(),
        }
        .validated()
        .unwrap()
    }

    const LAMP: Light = Light::Area {
        corner: Vec3::new(-6.0, -6.0, 3.0),
        u: Vec3::new(0.0, 12.0, 0.0),
        v: Vec3::new(12.0, 0.0, 0.0),
    };

    /// Two pictures of the same light are the same, in both components of what scattered.
    fn agree(what: &str, pixels: usize, a: &Picture, b: &Picture) {
        let (mut chi2, mut lit) = (0.0, 0);
        // Of each component: of the one, of the other, variance of the difference.
        let mut sums = [[0.0; 3]; 3];
        for index in 0..a.radiance.len() {
            let x: Estimate = a.radiance.estimate(index);
            let y: Estimate = b.radiance.estimate(index);
            sums[index / pixels][0] += x.value;
            sums[index / pixels][1] += y.value;
            let u2 = x.u * x.u + y.u * y.u;
            sums[index / pixels][2] += u2;
            // What did not scatter is found the same way by both.
            if index < 2 * pixels && y.value > 5.0 * y.u {
                lit += 1;
                chi2 += (x.value - y.value).powi(2) / u2;
            }
        }
        println!("{what}: chi2 {chi2:.1} of {lit}, {sums:?}");
        assert!(lit > 10, "{what}: {lit}");
        let expected = f64::from(lit);
        assert!(
            (chi2 - expected).abs() < 4.0 * (2.0 * expected).sqrt(),
            "{what}: {chi2} of {lit}"
        );
        for [x, y, u2] in &sums[..2] {
            let u = u2.sqrt();
            assert!((x - y).abs() < 3.5 * u && u < 0.05 * x, "{what}: {sums:?}");
        }
    }

    /// From the lamp and from the camera the same picture, in all of its components: in a small
    /// block, in one so thick that most of the way inside is leapt, and where one hides another.
    #[test]
    fn both_directions_make_one_picture() {
        let (parallel, pinhole) = (
            Lens::Orthographic { height: 4.0 },
            Lens::Pinhole { field: 0.24 },
        );
        for (lens, size, blocks, rounds) in [
            (parallel, 1.0, 1, [30, 4_000]),
            (pinhole, 1.0, 1, [30, 4_000]),
            (pinhole, 12.0, 1, [30, 6_000]),
            (parallel, 12.0, 2, [60, 6_000]),
        ] {
            let mut scene = scene(lens, size, LAMP);
            if blocks == 2 {
                // Another, which scatters evenly, hides a part of the first.
                let mut medium = scene.objects[0].material.media[0];
                medium.g = 0.0;
                scene.objects.push(Object {
                    name: "other".into(),
                    shape: Shape::Block(Block {
                        min: Vec3::new(-0.5, -2.0, -1.0),
                        max: Vec3::new(1.0, -1.3, 0.3),
                    }),
                    material: Material {
                        media: vec![medium],
                        texture: None,
                    },
                });
            }
            let options = Options {
                components: true,
                photons: 2000,
                ..Options::default()
            };
            let from_lamp = MonteCarlo::new(&scene, options.clone()).unwrap();
            assert_eq!(from_lamp.from_lamps, [true]);
            let mut a = from_lamp.empty();
            from_lamp.run(0..rounds[0], &mut a, &mut |_| ControlFlow::Continue(()));

            let mut from_camera = MonteCarlo::new(&scene, options).unwrap();
            from_camera.from_lamps = vec![false];
            from_camera.wanted.scattered = vec![true];
            let mut b = from_camera.empty();
            from_camera.run(0..rounds[1], &mut b, &mut |_| ControlFlow::Continue(()));
            agree(
                &format!("{lens:?}, {size}, {blocks}"),
                scene.pixels(),
                &a,
                &b,
            );
        }
    }

    /// Splitting far from a beam and leaps change no mean, of pixels or of powers.
    #[test]
    fn photons_as_they_come_make_the_same_picture() {
        let beam = Light::Beam {
            from: Vec3::new(-0.8, -0.5, 3.0),
            direction: Vec3::NEG_Z,
            spot: Spot::Disk(0.1),
        };
        let scene = scene(Lens::Orthographic { height: 4.0 }, 40.0, beam);
        let pictures = [false, true].map(|plain| {
            let options = Options {
                components: true,
                photons: 10_000,
                ..Options::default()
            };
            let mut method = MonteCarlo::new(&scene, options).unwrap();
            // Leaps as near to the surface as can be, or none.
            method.seen_depth = 0.0;
            if plain {
                method.seen_depth = f64::INFINITY;
                method.guides = vec![None];
            }
            let mut picture = method.empty();
            method.run(0..60, &mut picture, &mut |_| ControlFlow::Continue(()));
            picture
        });
        let [guided, plain] = &pictures;
        agree("plain", scene.pixels(), guided, plain);
        let sum = |p: &Picture| {
            let diffuse = (scene.pixels()..2 * scene.pixels()).map(|i| p.radiance.estimate(i));
            diffuse.map(|e| e.value).sum::<f64>()
        };
        // A pixel has noise enough to hide what is lost where light is leapt over.
        let ratio = sum(guided) / sum(plain);
        assert!((ratio - 1.0).abs() < 0.012, "{ratio}");
        for index in 0..guided.powers.len() {
            let [x, y] = [guided, plain].map(|p| p.powers.estimate(index));
            let u = x.u.hypot(y.u);
            assert!((x.value - y.value).abs() <= 4.0 * u, "{index}: {x:?} {y:?}");
        }
    }

    #[test]
    fn a_picture_is_its_seed_whatever_the_threads() {
        let scene = scene(Lens::Orthographic { height: 4.0 }, 1.0, LAMP);
        let options = Options {
            photons: 50,
            ..Options::default()
        };
        let method = MonteCarlo::new(&scene, options).unwrap();
        let make = |threads: usize, parts: [Range<u64>; 2]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let mut picture = method.empty();
                for part in parts.clone() {
                    method.run(part.clone(), &mut picture, &mut |_| {
                        ControlFlow::Continue(())
                    });
                }
                picture
            })
        };
        assert_eq!(make(1, [0..3, 3..7]), make(3, [0..4, 4..7]));
    }
}
