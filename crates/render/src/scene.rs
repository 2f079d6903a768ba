//! All that a picture is made of.

use crate::Vec3;
use crate::camera::Camera;
use crate::light::{Light, Reach};
use crate::overlap::{Shared, shared};
use crate::shape::{Hit, Shape};
use crate::surface::Point;
use crate::texture::Texture;
use physics::{InvalidMedium, Medium};
use std::borrow::Cow;
use thiserror::Error;

/// What a solid is filled with, in each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// One medium a channel; all have their own index, relative to the air around.
    pub media: Vec<Medium>,
    /// Coefficients over the surface in the place of those of `media`, which keep g and η.
    pub texture: Option<Texture>,
}

impl Material {
    /// Media that stand for all of a channel: its own or, under a texture, those that are farthest
    /// apart.
    pub fn representatives(&self, channel: usize) -> Vec<Medium> {
        let base = self.media[channel];
        self.texture
            .as_ref()
            .map_or_else(|| vec![base], |texture| texture.extremes(base, channel))
    }
}

/// A solid.
#[derive(Debug)]
pub struct Object {
    /// What messages call it.
    pub name: String,
    /// Where it is.
    pub shape: Shape,
    /// What it is filled with.
    pub material: Material,
}

/// A light and its strength in each channel; what unit that has stands at [`Light`].
#[derive(Clone, Debug, PartialEq)]
pub struct Lamp {
    /// Where the light comes from.
    pub light: Light,
    /// One strength a channel.
    pub strength: Vec<f64>,
}

/// Solids, lights and a camera in clear surroundings.
#[derive(Debug)]
pub struct Scene {
    /// Names of the channels.
    pub channels: Vec<String>,
    /// The solids; none touches another.
    pub objects: Vec<Object>,
    /// The lights.
    pub lamps: Vec<Lamp>,
    /// The camera.
    pub camera: Camera,
}

/// A scene cannot be rendered.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SceneError {
    /// No solid, no light or no channel.
    #[error("the scene has no {0}; scenes/jensen8.toml shows a whole scene")]
    Nothing(&'static str),
    /// Media or strengths are not one for each channel.
    #[error("{of} has {found} channels, the scene {channels}")]
    Channels {
        /// Whose.
        of: String,
        /// How many it has.
        found: usize,
        /// How many it should have.
        channels: usize,
    },
    /// A medium cannot be.
    #[error("object {object}, channel {channel}: {error}")]
    Medium {
        /// The object.
        object: String,
        /// The channel.
        channel: String,
        /// What is wrong.
        error: InvalidMedium,
    },
    /// A texture is not one value a texel and channel.
    #[error("object {object}: its texture has no {what}")]
    Texture {
        /// The object.
        object: String,
        /// What is missing.
        what: &'static str,
    },
    /// A texel is no medium that models of the surface can show.
    #[error(
        "object {object}, channel {channel}: pixel {column}, {row} of its texture has sigma_a {sigma_a} and sigma_s {sigma_s} mm^-1; expected numbers of at least 0, not both 0"
    )]
    Texel {
        /// The object.
        object: String,
        /// The channel.
        channel: String,
        /// Its column, from 0.
        column: usize,
        /// Its row, from 0 at the top.
        row: usize,
        /// σₐ, mm⁻¹.
        sigma_a: f32,
        /// σₛ, mm⁻¹.
        sigma_s: f32,
    },
    /// Models of the surface know of nothing behind it.
    #[error(
        "object {object}, channel {channel}: a clear medium, which neither absorbs nor scatters, is nothing that a model of the surface can show; take --method monte-carlo, or give it coefficients"
    )]
    Clear {
        /// The object.
        object: String,
        /// The channel.
        channel: String,
    },
    /// A texture of the surface says nothing of the inside.
    #[error(
        "monte-carlo: object {0} has a texture, which says what its surface is like and nothing of the medium inside; take --method bssrdf, point-cloud or brdf, or leave the texture out"
    )]
    Textured(String),
    /// Light would wander in it for ever.
    #[error(
        "object {object}, channel {channel}: a half-space without absorption keeps light for ever; give it absorption, or make it a block"
    )]
    Endless {
        /// The object.
        object: String,
        /// The channel.
        channel: String,
    },
    /// A strength is negative or not finite.
    #[error("light {lamp}: expected strengths of at least 0, found {found}")]
    Strength {
        /// The light, from 1.
        lamp: usize,
        /// What was found.
        found: f64,
    },
    /// Two solids are in the same place.
    #[error(
        "objects {first} and {second} share space around ({:.4}, {:.4}, {:.4}) mm; between solids there has to be air: move one, or make it smaller", at.x, at.y, at.z
    )]
    Overlap {
        /// One.
        first: String,
        /// The other.
        second: String,
        /// A point of both.
        at: Vec3,
    },
    /// One solid is inside another.
    #[error(
        "object {inner} is inside {outer}, where no light would find it: a solid is filled with one medium; leave one of them out, or move it"
    )]
    Nested {
        /// One.
        inner: String,
        /// The other.
        outer: String,
    },
    /// The camera is in a solid.
    #[error("the camera stands inside {0}; move it out")]
    CameraInside(String),
    /// A light is in a solid.
    #[error("light {lamp} is inside {object}; move it out")]
    LightInside {
        /// The light, from 1.
        lamp: usize,
        /// The object.
        object: String,
    },
    /// No unbiased path joins light and camera.
    #[error(
        "monte-carlo: light {0} has no size, and behind a curved smooth surface no path finds it; give it a size (radius_deg of a distant light, an area light), or use flat solids (block, half-space)"
    )]
    OutOfReach(usize),
    /// Parallel or even light onto something without end.
    #[error(
        "monte-carlo: light {0} falls on a half-space everywhere; use a beam, or a block of finite size"
    )]
    Unbounded(usize),
    /// Points would have to cover a surface without end.
    #[error(
        "point-cloud: no number of points covers {0}, a half-space; use a block of finite size, or light it by beams alone"
    )]
    Coverless(String),
}

impl Scene {
    /// The same scene, or what is wrong with it.
    ///
    /// # Errors
    ///
    /// [`SceneError`] names the part.
    pub fn validated(self) -> Result<Self, SceneError> {
        for (what, empty) in [
            ("channel", self.channels.is_empty()),
            ("object", self.objects.is_empty()),
            ("light", self.lamps.is_empty()),
        ] {
            if empty {
                return Err(SceneError::Nothing(what));
            }
        }
        let channels = self.channels.len();
        let count = |of: String, found| {
            if found == channels {
                Ok(())
            } else {
                Err(SceneError::Channels {
                    of,
                    found,
                    channels,
                })
            }
        };
        for object in &self.objects {
            count(object.name.clone(), object.material.media.len())?;
            for (medium, channel) in object.material.media.iter().zip(&self.channels) {
                if let Err(error) = medium.validated() {
                    return Err(SceneError::Medium {
                        object: object.name.clone(),
                        channel: channel.clone(),
                        error,
                    });
                }
                let endless = medium.sigma_a == 0.0 && medium.sigma_s > 0.0;
                if endless && object.shape.bounds().is_none() {
                    return Err(SceneError::Endless {
                        object: object.name.clone(),
                        channel: channel.clone(),
                    });
                }
            }
        }
        for object in &self.objects {
            self.check_texture(object)?;
        }
        self.check_overlaps()?;
        for (lamp, Lamp { light, strength }) in self.lamps.iter().enumerate() {
            let lamp = lamp + 1;
            count(format!("light {lamp}"), strength.len())?;
            if let Some(&found) = strength.iter().find(|s| !(**s >= 0.0 && s.is_finite())) {
                return Err(SceneError::Strength { lamp, found });
            }
            let places = match *light {
                Light::Beam { from: at, .. } | Light::Point { at } => vec![at],
                Light::Area { corner, u, v } => {
                    let corners = [Vec3::ZERO, u, v, u + v, 0.5 * (u + v)];
                    corners.map(|across| corner + across).to_vec()
                }
                Light::Distant { .. } | Light::Sky => vec![],
            };
            if let Some(object) = places.iter().find_map(|p| self.around(*p)) {
                let object = object.to_owned();
                return Err(SceneError::LightInside { lamp, object });
            }
        }
        // Every ray of a camera starts outside, those of its corners at least.
        let [width, height] = self.camera.size().map(|n| n as f64);
        for (x, y) in [(0.5, 0.5), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let (origin, _) = self.camera.ray(x * width, y * height);
            if let Some(object) = self.around(origin) {
                return Err(SceneError::CameraInside(object.to_owned()));
            }
        }
        Ok(self)
    }

    /// Whether a model of the surface can show every solid.
    ///
    /// # Errors
    ///
    /// [`SceneError::Clear`].
    pub fn check_for_surfaces(&self) -> Result<(), SceneError> {
        for object in &self.objects {
            let Material { media, texture } = &object.material;
            let clear = media.iter().position(|medium| medium.sigma_t() == 0.0);
            if let Some(channel) = clear.filter(|_| texture.is_none()) {
                return Err(SceneError::Clear {
                    object: object.name.clone(),
                    channel: self.channels[channel].clone(),
                });
            }
        }
        Ok(())
    }

    fn check_overlaps(&self) -> Result<(), SceneError> {
        for (index, a) in self.objects.iter().enumerate() {
            for b in &self.objects[..index] {
                let found = [(a, b), (b, a)].map(|(a, b)| (a, b, shared(&a.shape, &b.shape)));
                for (inner, outer, found) in &found {
                    if *found == Some(Shared::Inside) {
                        return Err(SceneError::Nested {
                            inner: inner.name.clone(),
                            outer: outer.name.clone(),
                        });
                    }
                }
                let at = found.iter().find_map(|(_, _, found)| match found {
                    Some(Shared::Around(at)) => Some(*at),
                    _ => None,
                });
                if let Some(at) = at {
                    return Err(SceneError::Overlap {
                        first: b.name.clone(),
                        second: a.name.clone(),
                        at,
                    });
                }
            }
        }
        Ok(())
    }

    fn check_texture(&self, object: &Object) -> Result<(), SceneError> {
        let Some(texture) = &object.material.texture else {
            return Ok(());
        };
        let missing = |what| SceneError::Texture {
            object: object.name.clone(),
            what,
        };
        let count = texture.width * texture.height;
        if count == 0 || texture.texels.len() != self.channels.len() {
            return Err(missing("texels in every channel"));
        }
        if !texture.size.iter().all(|side| *side > 0.0) {
            return Err(missing("size"));
        }
        if let Shape::Mesh(mesh) = &object.shape
            && !mesh.has_texture_coordinates()
        {
            return Err(missing("place: its mesh has no texture coordinates"));
        }
        for (texels, channel) in texture.texels.iter().zip(&self.channels) {
            if texels.len() != count {
                return Err(missing("texel for each of its pixels"));
            }
            let usable = |x: &f32| *x >= 0.0 && x.is_finite();
            let bad = |texel: &[f32; 2]| !texel.iter().all(usable) || texel[0] + texel[1] <= 0.0;
            if let Some(index) = texels.iter().position(bad) {
                let [sigma_a, sigma_s] = texels[index];
                return Err(SceneError::Texel {
                    object: object.name.clone(),
                    channel: channel.clone(),
                    column: index % texture.width,
                    row: index / texture.width,
                    sigma_a,
                    sigma_s,
                });
            }
        }
        Ok(())
    }

    /// The media at a point of a surface, by channel.
    pub(crate) fn media(&self, point: &Point) -> Cow<'_, [Medium]> {
        let Material { media, texture } = &self.objects[point.object].material;
        match (texture, point.coordinates) {
            (Some(texture), Some(coordinates)) => {
                let all = media.iter().enumerate();
                all.map(|(channel, base)| texture.medium(*base, channel, coordinates))
                    .collect()
            }
            _ => Cow::Borrowed(media),
        }
    }

    fn around(&self, point: Vec3) -> Option<&str> {
        let found = self.objects.iter().find(|o| o.shape.contains(point));
        found.map(|o| o.name.as_str())
    }

    /// The first solid that a ray enters.
    pub fn enter(&self, origin: Vec3, direction: Vec3) -> Option<(usize, Hit)> {
        let hits = self.objects.iter().enumerate();
        hits.filter_map(|(index, object)| Some((index, object.shape.enter(origin, direction)?)))
            .min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
    }

    /// Pixels of the picture.
    pub fn pixels(&self) -> usize {
        self.camera.size().iter().product()
    }

    /// Panics if `of_object` has not one entry for each solid and, within it, channel.
    pub(crate) fn assert_one_each<T>(&self, of_object: &[Vec<T>]) {
        assert_eq!(of_object.len(), self.objects.len());
        for list in of_object {
            assert_eq!(list.len(), self.channels.len());
        }
    }

    /// Index of refraction of a solid in a channel.
    pub(crate) fn eta(&self, object: usize, channel: usize) -> f64 {
        self.objects[object].material.media[channel].eta
    }

    /// A ball around all solids that have an end.
    pub(crate) fn reach(&self) -> Reach {
        let bounds = self.objects.iter().filter_map(|o| o.shape.bounds());
        let around = bounds.reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
        around.map_or(
            Reach {
                center: Vec3::ZERO,
                radius: 1.0,
            },
            |(low, high)| Reach {
                center: 0.5 * (low + high),
                radius: 0.5 * (high - low).length(),
            },
        )
    }

    /// Radiance that a ray into the open finds, in a channel, and how far it gets.
    pub(crate) fn lit(
        &self,
        channel: usize,
        origin: Vec3,
        direction: Vec3,
        within: f64,
        wanted: &[bool],
    ) -> Option<f64> {
        let (mut nearest, mut value) = (f64::INFINITY, 0.0);
        for (lamp, wanted) in self.lamps.iter().zip(wanted) {
            let Some((distance, radiance)) = lamp.light.meet(origin, direction) else {
                continue;
            };
            // A lamp hides what is behind, also where its own light is not asked for.
            let radiance = if *wanted {
                radiance * lamp.strength[channel]
            } else {
                0.0
            };
            if distance < nearest {
                (nearest, value) = (distance, radiance);
            } else if distance == nearest {
                value += radiance;
            }
        }
        (nearest < within || within == f64::INFINITY).then_some(value)
    }
}
