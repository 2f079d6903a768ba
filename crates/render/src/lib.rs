//! The validation renderer: light through translucent solids, by full transport and by the
//! models of it, on one scene.
//!
//! It knows no files and no progress bars. Lengths are mm, coefficients mm⁻¹; a radiance is per
//! mm² and sr for each unit of power of the lights.
//!
//! | module | holds |
//! |---|---|
//! | [`shape`] | half-spaces, blocks, spheres, meshes: where a ray enters and leaves |
//! | [`boundary`] | a smooth dielectric surface met by a ray |
//! | [`camera`] | pinhole and orthographic cameras, also seen through a flat surface |
//! | [`light`] | beams, distant, point and area lights, an even sky |
//! | [`scene`] | [`Scene`]: all of it together, checked |
//! | [`walk`] | the random walk of a photon inside a solid |
//! | `lanes` | the same of many photons at once in a block |
//! | [`leap`] | many steps of such a walk at once, where no surface is near |
//! | [`photons`] | `monte-carlo` from the lights, connected to the camera through flat faces |
//! | `guide` | how light photons should be, and so how many, far from a beam |
//! | [`paths`] | `monte-carlo` from the camera |
//! | `overlap` | solids that share space, which are refused |
//! | [`monte_carlo`] | the method `monte-carlo`: which light goes which way |
//! | [`method`] | [`Method`]: what all ways to a picture have in common |
//! | [`surface`] | models of the surface: what comes out of a solid at a point |
//! | [`brdf`] | the method `brdf` |
//! | [`layered`] | `brdf` of layers, with a BTDF |
//! | [`bssrdf`] | diffusion from all over the surface, and light that scattered once |
//! | [`pool`] | the method `bssrdf`: that, with light drawn once for all pixels |
//! | [`point_cloud`] | the method `point-cloud` |
//! | [`texture`] | coefficients that vary over a surface |
//! | [`film`] | pictures with a standard error in every pixel |
//! | [`blocks`] | what that error leaves out: noise that neighbouring pixels share |

pub mod blocks;
pub mod boundary;
pub mod brdf;
pub mod bssrdf;
pub mod camera;
pub mod film;
mod guide;
mod lanes;
pub mod layered;
pub mod leap;
pub mod light;
pub mod method;
pub mod monte_carlo;
mod overlap;
pub mod paths;
pub mod photons;
pub mod point_cloud;
pub mod pool;
pub mod scene;
pub mod shape;
pub mod surface;
pub mod texture;
pub mod walk;

pub use blocks::{Blocks, SharedNoise};
pub use brdf::{Brdf, Kind};
pub use bssrdf::Bssrdf;
pub use camera::{Camera, View};
pub use film::{Estimate, Film};
pub use layered::{Layered, Sheet};
pub use light::{Light, Spot};
pub use method::{Method, Picture};
pub use monte_carlo::{MonteCarlo, Options};
pub use photons::{Entry, Ledger, Rings};
pub use point_cloud::{Gather, PointCloud};
pub use pool::{Pool, Pooled};
pub use scene::{Lamp, Material, Object, Scene, SceneError};
pub use shape::{Block, HalfSpace, Mesh, MeshError, Shape, Sphere};
pub use surface::Shaded;
pub use texture::Texture;

/// A point or a direction, mm.
pub type Vec3 = glam::DVec3;
