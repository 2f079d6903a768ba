//! `SCENE.toml`: solids, lights and a camera.
//!
//! ```
//! let scene = formats::scene_toml::parse(r#"
//!     [camera]
//!     kind = "orthographic"
//!     from_mm = [0, -200, 60]
//!     to_mm = [0, 0, 0]
//!     height_mm = 60
//!
//!     [[object]]
//!     shape = "block"
//!     min_mm = [-20, -20, -20]
//!     max_mm = [20, 20, 20]
//!     material = "marble"
//!
//!     [[light]]
//!     kind = "beam"
//!     from_mm = [0, -10, 60]
//!     direction = [0, 0, -1]
//!     radius_mm = 0.5
//! "#)?;
//! assert_eq!(scene.camera.width_px, 512);
//! # Ok::<(), formats::TomlError>(())
//! ```

use crate::toml_text::{TomlError, parse_toml};
use serde::{Deserialize, Serialize};

/// A scene. Its numbers are for the renderer to judge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Names of the channels of media that are given inline. Default R, G, B.
    #[serde(default = "colours")]
    pub channels: Vec<String>,
    /// The camera.
    pub camera: CameraEntry,
    /// The solids.
    #[serde(default)]
    pub object: Vec<ObjectEntry>,
    /// The lights.
    #[serde(default)]
    pub light: Vec<LightEntry>,
    /// Rings in which light that leaves is counted, if any.
    pub rings: Option<RingsEntry>,
}

/// `[camera]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraEntry {
    /// How rays fall into it.
    pub kind: CameraKind,
    /// Where it stands, mm.
    pub from_mm: [f64; 3],
    /// What is in the middle of the picture, mm.
    pub to_mm: [f64; 3],
    /// What is up. Default +z.
    #[serde(default = "z")]
    pub up: [f64; 3],
    /// Height of what an orthographic camera sees, mm.
    pub height_mm: Option<f64>,
    /// Angle over the height of the picture of a pinhole camera, degrees.
    pub field_deg: Option<f64>,
    /// Pixels of a row. Default 512.
    #[serde(default = "pixels")]
    pub width_px: usize,
    /// Rows. Default 512.
    #[serde(default = "pixels")]
    pub height_px: usize,
}

/// How rays fall into a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraKind {
    /// All through one point.
    Pinhole,
    /// All parallel.
    Orthographic,
}

/// `[[object]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectEntry {
    /// What messages and tables call it. Default: its shape and number.
    pub name: Option<String>,
    /// Its shape.
    pub shape: ShapeKind,
    /// Half-space: a point of its plane.
    pub point_mm: Option<[f64; 3]>,
    /// Half-space: the normal out of it.
    pub normal: Option<[f64; 3]>,
    /// Block: the corner of the smallest coordinates.
    pub min_mm: Option<[f64; 3]>,
    /// Block: the corner of the largest.
    pub max_mm: Option<[f64; 3]>,
    /// Sphere: its centre.
    pub center_mm: Option<[f64; 3]>,
    /// Sphere: its radius.
    pub radius_mm: Option<f64>,
    /// Mesh: OBJ or PLY beside the scene.
    pub file: Option<String>,
    /// Mesh: mm for each unit of the file. Default 1.
    pub mm_per_unit: Option<f64>,
    /// Mesh: turned about z by this, degrees, after `up` has become z.
    pub turn_deg: Option<f64>,
    /// Mesh: which axis of the file is up, `y` or `z`. Default z.
    pub up: Option<UpAxis>,
    /// Mesh: moved so far, mm, last of all.
    pub move_mm: Option<[f64; 3]>,
    /// Mesh: shaded as a smooth surface, with normals between those of its triangles; a file with
    /// normals has its own. Default false.
    #[serde(default)]
    pub smooth: bool,
    /// A material of the shipped table, or a file of materials (csv or json) beside the scene
    /// followed by `#` and the name in it.
    pub material: Option<String>,
    /// Mean cosine of the scattering angle, for a material that does not know its own. Default 0.
    pub g: Option<f64>,
    /// Relative index in the place of the material's own.
    pub eta: Option<f64>,
    /// Coefficients inline, in the place of `material`.
    pub medium: Option<InlineMedium>,
    /// Layers of the surface, for the layered BRDF: a `MEDIUM.toml` beside the scene or a shipped
    /// medium, one for all channels or one for each.
    pub layers: Option<Names>,
    /// Pictures that vary the coefficients over the surface.
    pub texture: Option<TextureEntry>,
}

/// `texture` of an object: pictures in the place of coefficients of its material, which keeps the
/// others, g and eta. Models of the surface show it; volume transport refuses it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureEntry {
    /// Half-space and block: width and height of the picture, which is repeated, mm. A mesh has
    /// texture coordinates of its own, a ball longitude and latitude.
    pub size_mm: Option<[f64; 2]>,
    /// Share that leaves of the light that enters, 0 to 1: α′ is made such that it is the dipole's
    /// total, at the material's σₜ′. Whole numbers are sRGB, floating-point numbers linear.
    pub albedo: Option<PictureEntry>,
    /// Absorption coefficient: the picture, linear, times `scale`, mm⁻¹.
    pub sigma_a_per_mm: Option<PictureEntry>,
    /// Scattering coefficient, likewise; or else the reduced one.
    pub sigma_s_per_mm: Option<PictureEntry>,
    /// Reduced scattering coefficient, likewise.
    pub sigma_s_prime_per_mm: Option<PictureEntry>,
}

/// A picture beside the scene, gray or with the channels of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a picture, or { file = \"NAME\", scale = NUMBER } with one scale or one a channel"
)]
pub enum PictureEntry {
    /// As it is: whole numbers from 0 to 1, floating-point numbers themselves.
    File(String),
    /// Times a number.
    Scaled {
        /// The picture.
        file: String,
        /// The number.
        scale: PerChannel,
    },
}

/// One name or a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a name, or a list of one name a channel"
)]
pub enum Names {
    /// The same for all.
    One(String),
    /// One a channel.
    Each(Vec<String>),
}

/// Shape of a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShapeKind {
    /// All below a plane.
    HalfSpace,
    /// A box along the axes.
    Block,
    /// A ball.
    Sphere,
    /// Triangles of a file.
    Mesh,
}

/// Which axis of a mesh is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// The second.
    Y,
    /// The third.
    Z,
}

/// Coefficients, one a channel or one for all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InlineMedium {
    /// Absorption coefficient, mm⁻¹.
    pub sigma_a_per_mm: PerChannel,
    /// Scattering coefficient, mm⁻¹; or else the reduced one.
    pub sigma_s_per_mm: Option<PerChannel>,
    /// Reduced scattering coefficient, mm⁻¹.
    pub sigma_s_prime_per_mm: Option<PerChannel>,
}

/// A number for all channels or one for each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, or a list of one number a channel"
)]
pub enum PerChannel {
    /// The same in all.
    All(f64),
    /// One a channel.
    Each(Vec<f64>),
}

/// `[[light]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightEntry {
    /// What kind.
    pub kind: LightKind,
    /// Beam: a point of its axis in front of everything; point: where it is.
    pub from_mm: Option<[f64; 3]>,
    /// Beam and distant: where the light goes.
    pub direction: Option<[f64; 3]>,
    /// Beam: radius of an even disk. Default 0.
    pub radius_mm: Option<f64>,
    /// Beam: full width at half maximum of a Gaussian, in the place of the disk.
    pub fwhm_mm: Option<f64>,
    /// Distant: angular radius of the source, degrees. Default 0.
    pub radius_deg: Option<f64>,
    /// Area: a corner.
    pub corner_mm: Option<[f64; 3]>,
    /// Area: one side; it shines to the side of u × v.
    pub u_mm: Option<[f64; 3]>,
    /// Area: the other side.
    pub v_mm: Option<[f64; 3]>,
    /// Beam and point: power, W. Distant: irradiance across the light, W mm⁻². Area and sky:
    /// radiance, W mm⁻² sr⁻¹. Default 1.
    pub strength: Option<PerChannel>,
}

/// What kind of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightKind {
    /// Parallel rays of a small cross-section.
    Beam,
    /// Parallel rays everywhere.
    Distant,
    /// A point.
    Point,
    /// A parallelogram.
    Area,
    /// The same from everywhere.
    Sky,
}

/// `[rings]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RingsEntry {
    /// Name of the solid. Default: the first.
    pub object: Option<String>,
    /// Name of its face: `top` of a half-space, `+z` and the like of a block.
    pub face: String,
    /// Middle of the rings.
    pub center_mm: [f64; 3],
    /// Edges, from the inside out.
    pub edges_mm: Vec<f64>,
}

fn colours() -> Vec<String> {
    ["R", "G", "B"].map(str::to_owned).to_vec()
}

fn z() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn pixels() -> usize {
    512
}

/// Reads a scene.
///
/// # Errors
///
/// [`TomlError`] names line and key.
pub fn parse(text: &str) -> Result<SceneFile, TomlError> {
    parse_toml(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_or_one_a_channel_and_no_other_key() {
        let scene = "[camera]\nkind = \"pinhole\"\nfrom_mm = [0, 0, 9]\nto_mm = [0, 0, 0]\n\
                     field_deg = 30\n[[light]]\nkind = \"sky\"\nstrength = [1, 2, 3]\n\
                     [[object]]\nshape = \"sphere\"\nradius_mm = 2\n\
                     medium = { sigma_a_per_mm = 0.1, sigma_s_per_mm = [1, 2, 3] }\n";
        let read = parse(scene).unwrap();
        assert_eq!(read.channels, ["R", "G", "B"]);
        let medium = read.object[0].medium.as_ref().unwrap();
        assert_eq!(medium.sigma_a_per_mm, PerChannel::All(0.1));
        assert_eq!(
            read.light[0].strength,
            Some(PerChannel::Each(vec![1.0, 2.0, 3.0]))
        );
        let wrong = parse(&scene.replace("radius_mm", "radius")).unwrap_err();
        assert!(wrong.to_string().contains("radius_mm"), "{wrong}");
    }
}
