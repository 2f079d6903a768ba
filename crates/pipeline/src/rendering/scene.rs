//! From `SCENE.toml` and what lies beside it to a scene.

use super::{layers, texture};
use crate::error::{Blame, Error, Kind, Result};
use crate::files::{open, read, read_text};
use crate::library;
use formats::mesh::{Triangles, read_obj, read_ply};
use formats::scene_toml::{
    self, CameraEntry, CameraKind, InlineMedium, LightEntry, LightKind, Names, ObjectEntry,
    PerChannel, RingsEntry, SceneFile, ShapeKind, UpAxis,
};
use formats::{materials_csv, materials_json};
use physics::{LayeredMedium, Material as Row, Medium};
use render::camera::Lens;
use render::{
    Block, Camera, HalfSpace, Lamp, Light, Material, Mesh, Object, Rings, Scene, Shape, Sphere,
    Spot, Vec3, View,
};
use std::path::{Path, PathBuf};

/// A scene, and what else its file says.
#[derive(Debug)]
pub struct Loaded {
    /// The file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// Every file that was read.
    pub inputs: Vec<PathBuf>,
    /// The scene.
    pub scene: Scene,
    /// Rings to count in.
    pub rings: Option<Rings>,
    /// Layers of the surface of each solid, by channel; none where it has none.
    pub layers: Vec<Vec<LayeredMedium>>,
    /// What is odd.
    pub warnings: Vec<String>,
}

pub(super) fn wrong(message: impl std::fmt::Display) -> Error {
    Error::new(Kind::Input, message.to_string())
}

/// Reads a scene with its meshes, materials and textures.
///
/// # Errors
///
/// The error names the file and the part.
pub fn load(path: &Path) -> Result<Loaded> {
    let text = read_text(path)?;
    let file = scene_toml::parse(&text).input(path.display())?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut inputs = vec![path.to_owned()];
    let mut warnings = vec![];
    let loaded = build(&file, folder, &mut inputs, &mut warnings);
    let (scene, rings, layers) = loaded.map_err(|e| e.within(path.display()))?;
    Ok(Loaded {
        path: path.to_owned(),
        text,
        inputs,
        scene,
        rings,
        layers,
        warnings,
    })
}

fn build(
    file: &SceneFile,
    folder: &Path,
    inputs: &mut Vec<PathBuf>,
    warnings: &mut Vec<String>,
) -> Result<(Scene, Option<Rings>, Vec<Vec<LayeredMedium>>)> {
    let camera = camera(&file.camera).map_err(|e| e.within("[camera]"))?;
    let mut channels: Option<Vec<String>> = None;
    let mut objects = vec![];
    let mut layers = vec![];
    for (index, entry) in file.object.iter().enumerate() {
        let kind = match entry.shape {
            ShapeKind::HalfSpace => "half-space",
            ShapeKind::Block => "block",
            ShapeKind::Sphere => "sphere",
            ShapeKind::Mesh => "mesh",
        };
        let default = || format!("{kind} {}", index + 1);
        let name = entry.name.clone().unwrap_or_else(default);
        let within = |e: Error| e.within(format!("object `{name}`"));
        let shape = shape(entry, folder, inputs).map_err(within)?;
        if let Shape::Mesh(mesh) = &shape {
            let said = mesh
                .warnings()
                .iter()
                .map(|w| format!("object `{name}`: {w}"));
            warnings.extend(said);
        }
        let (names, media) = material(entry, file, folder, inputs).map_err(within)?;
        match &channels {
            Some(known) if *known != names => {
                return Err(within(wrong(format!(
                    "its channels are {}, those of the objects before {}; all need the same",
                    names.join(", "),
                    known.join(", ")
                ))));
            }
            _ => channels = Some(names),
        }
        let texture = entry.texture.as_ref().map(|entry| {
            let found = texture::texture(entry, &shape, &media, folder, inputs);
            found.map_err(|e| within(e.within("`texture`")))
        });
        let texture = texture.transpose()?;
        layers.push(layers_of(entry, &media, folder, inputs).map_err(within)?);
        objects.push(Object {
            name,
            shape,
            material: Material { media, texture },
        });
    }
    let channels = channels.unwrap_or_else(|| file.channels.clone());
    let lamps = file
        .light
        .iter()
        .enumerate()
        .map(|(k, entry)| {
            lamp(entry, channels.len()).map_err(|e| e.within(format!("light {}", k + 1)))
        })
        .collect::<Result<Vec<_>>>()?;
    let scene = Scene {
        channels,
        objects,
        lamps,
        camera,
    }
    .validated()
    .map_err(wrong)?;
    let rings = file.rings.as_ref().map(|entry| rings(entry, &scene));
    let rings = rings.transpose().map_err(|e| e.within("[rings]"))?;
    Ok((scene, rings, layers))
}

/// A value that the kind asks for.
fn needed<T: Copy>(value: Option<T>, key: &str, kind: &str) -> Result<T> {
    value.ok_or_else(|| wrong(format!("`{key}` is missing; a {kind} needs it")))
}

fn finite(point: [f64; 3], key: &str) -> Result<Vec3> {
    let point = Vec3::from_array(point);
    if point.is_finite() {
        Ok(point)
    } else {
        Err(wrong(format!(
            "`{key}`: expected three finite numbers, found {point}"
        )))
    }
}

fn direction(of: [f64; 3], key: &str) -> Result<Vec3> {
    let found = finite(of, key)?;
    let unit = found.try_normalize();
    unit.ok_or_else(|| wrong(format!("`{key}`: expected a direction, found {found}")))
}

pub(super) fn above_zero(value: f64, key: &str) -> Result<f64> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(wrong(format!(
            "`{key}`: expected a number above 0, found {value}"
        )))
    }
}

fn camera(entry: &CameraEntry) -> Result<Camera> {
    let lens = match entry.kind {
        CameraKind::Pinhole => Lens::Pinhole {
            field: needed(entry.field_deg, "field_deg", "pinhole camera")?.to_radians(),
        },
        CameraKind::Orthographic => Lens::Orthographic {
            height: needed(entry.height_mm, "height_mm", "orthographic camera")?,
        },
    };
    let view = View {
        from: finite(entry.from_mm, "from_mm")?,
        to: finite(entry.to_mm, "to_mm")?,
        up: direction(entry.up, "up")?,
        width: entry.width_px,
        height: entry.height_px,
    };
    Camera::new(view, lens).map_err(wrong)
}

fn shape(entry: &ObjectEntry, folder: &Path, inputs: &mut Vec<PathBuf>) -> Result<Shape> {
    Ok(match entry.shape {
        ShapeKind::HalfSpace => Shape::HalfSpace(HalfSpace {
            point: finite(
                needed(entry.point_mm, "point_mm", "half-space")?,
                "point_mm",
            )?,
            normal: direction(needed(entry.normal, "normal", "half-space")?, "normal")?,
        }),
        ShapeKind::Block => {
            let min = finite(needed(entry.min_mm, "min_mm", "block")?, "min_mm")?;
            let max = finite(needed(entry.max_mm, "max_mm", "block")?, "max_mm")?;
            if !min.cmplt(max).all() {
                return Err(wrong(format!(
                    "expected every coordinate of `min_mm` below that of `max_mm`, found {min} and {max}"
                )));
            }
            Shape::Block(Block { min, max })
        }
        ShapeKind::Sphere => {
            let center = entry.center_mm.unwrap_or_default();
            Shape::Sphere(Sphere {
                center: finite(center, "center_mm")?,
                radius: above_zero(needed(entry.radius_mm, "radius_mm", "sphere")?, "radius_mm")?,
            })
        }
        ShapeKind::Mesh => {
            let name = entry.file.as_deref();
            let name = name.ok_or_else(|| wrong("`file` is missing; a mesh needs it"))?;
            let path = folder.join(name);
            let lower = name.to_ascii_lowercase();
            let triangles = if lower.ends_with(".obj") {
                read_obj(&read(&path)?).input(path.display())?
            } else if lower.ends_with(".ply") {
                read_ply(open(&path)?).input(path.display())?
            } else {
                return Err(wrong(format!(
                    "`file`: expected .obj or .ply, found {name}; save the mesh as one of these"
                )));
            };
            inputs.push(path.clone());
            let scale = above_zero(entry.mm_per_unit.unwrap_or(1.0), "mm_per_unit")?;
            let turn = entry.turn_deg.unwrap_or(0.0).to_radians();
            let offset = finite(entry.move_mm.unwrap_or_default(), "move_mm")?;
            let (sin, cos) = turn.sin_cos();
            let turned = |[x, y, z]: [f64; 3]| {
                let (x, y, z) = match entry.up {
                    Some(UpAxis::Y) => (x, -z, y),
                    _ => (x, y, z),
                };
                Vec3::new(cos * x - sin * y, sin * x + cos * y, z)
            };
            let Triangles {
                vertices,
                triangles,
                normals,
                coordinates,
            } = triangles;
            let vertices = vertices.into_iter().map(|v| scale * turned(v) + offset);
            let normals = normals.into_iter().map(turned);
            let mesh = Mesh::new(
                vertices.collect(),
                triangles,
                normals.collect(),
                coordinates,
            );
            let mesh = mesh.input(path.display())?;
            if entry.smooth && mesh.has_normals() {
                return Err(wrong(format!(
                    "`smooth`: {name} has normals, which are taken as they are; leave it out"
                )));
            }
            let mesh = if entry.smooth { mesh.smoothed() } else { mesh };
            Shape::Mesh(Box::new(mesh))
        }
    })
}

fn material(
    entry: &ObjectEntry,
    file: &SceneFile,
    folder: &Path,
    inputs: &mut Vec<PathBuf>,
) -> Result<(Vec<String>, Vec<Medium>)> {
    match (&entry.material, &entry.medium) {
        (Some(name), None) => {
            let rows = rows(name, folder, inputs)?;
            let medium = |row: &Row| {
                let g = entry.g.or(row.g).unwrap_or(0.0);
                let mut medium = row.medium.with_g(g);
                medium.eta = entry.eta.unwrap_or(medium.eta);
                medium.validated().map_err(wrong)
            };
            let media = rows.iter().map(medium).collect::<Result<_>>()?;
            Ok((rows.into_iter().map(|row| row.channel).collect(), media))
        }
        (None, Some(inline)) => {
            let eta = needed(entry.eta, "eta", "medium given inline")?;
            let media = inline_media(inline, entry.g.unwrap_or(0.0), eta, file.channels.len())?;
            Ok((file.channels.clone(), media))
        }
        _ => Err(wrong("expected either `material` or `medium`")),
    }
}

/// The layers of each channel, or none.
fn layers_of(
    entry: &ObjectEntry,
    media: &[Medium],
    folder: &Path,
    inputs: &mut Vec<PathBuf>,
) -> Result<Vec<LayeredMedium>> {
    let names = match &entry.layers {
        None => return Ok(vec![]),
        Some(Names::One(name)) => vec![name.clone(); media.len()],
        Some(Names::Each(names)) if names.len() == media.len() => names.clone(),
        Some(Names::Each(names)) => {
            return Err(wrong(format!(
                "`layers`: expected one name, or {} for the channels, found {}",
                media.len(),
                names.len()
            )));
        }
    };
    let all = names.iter().zip(media).map(|(name, medium)| {
        let layers = layers::read(name, folder, inputs)?;
        let eta = layers.layers.first().map_or(1.0, |layer| layer.eta);
        if (eta - medium.eta).abs() > 1e-9 {
            return Err(wrong(format!(
                "its `eta` is {}, that of the first layer of {name} {eta}; its surface is one: give `eta = {eta}`",
                medium.eta
            )));
        }
        Ok(layers)
    });
    all.collect()
}

/// The channels of a material of the shipped table, or of a file followed by `#` and its name.
fn rows(name: &str, folder: &Path, inputs: &mut Vec<PathBuf>) -> Result<Vec<Row>> {
    let Some((file, wanted)) = name.split_once('#') else {
        return library::material(name).map_err(|e| wrong(format!("`material`: {e}")));
    };
    let path = folder.join(file);
    inputs.push(path.clone());
    let all = if file.ends_with(".json") {
        materials_json::read(open(&path)?).input(path.display())?
    } else {
        materials_csv::read(open(&path)?).input(path.display())?
    };
    let names: Vec<String> = all.iter().map(|row| row.material.clone()).collect();
    let found: Vec<Row> = all
        .into_iter()
        .filter(|row| row.material.eq_ignore_ascii_case(wanted))
        .collect();
    if found.is_empty() {
        let message = format!(
            "no material is called `{wanted}`; there are {}",
            names.join(", ")
        );
        return Err(wrong(message).within(path.display()));
    }
    Ok(found)
}

pub(super) fn each(values: &PerChannel, channels: usize, key: &str) -> Result<Vec<f64>> {
    match values {
        PerChannel::All(value) => Ok(vec![*value; channels]),
        PerChannel::Each(list) if list.len() == channels => Ok(list.clone()),
        PerChannel::Each(list) => Err(wrong(format!(
            "`{key}`: expected one number, or {channels} for the channels, found {}",
            list.len()
        ))),
    }
}

fn inline_media(inline: &InlineMedium, g: f64, eta: f64, channels: usize) -> Result<Vec<Medium>> {
    let sigma_a = each(&inline.sigma_a_per_mm, channels, "sigma_a_per_mm")?;
    let sigma_s = match (&inline.sigma_s_per_mm, &inline.sigma_s_prime_per_mm) {
        (Some(values), None) => each(values, channels, "sigma_s_per_mm")?,
        (None, Some(values)) => each(values, channels, "sigma_s_prime_per_mm")?
            .into_iter()
            .map(|reduced| reduced / (1.0 - g))
            .collect(),
        _ => {
            return Err(wrong(
                "expected either `sigma_s_per_mm` or `sigma_s_prime_per_mm` in `medium`",
            ));
        }
    };
    let both = sigma_a.into_iter().zip(sigma_s);
    both.map(|(sigma_a, sigma_s)| {
        let medium = Medium {
            sigma_a,
            sigma_s,
            g,
            eta,
        };
        medium.validated().map_err(wrong)
    })
    .collect()
}

fn lamp(entry: &LightEntry, channels: usize) -> Result<Lamp> {
    let light = match entry.kind {
        LightKind::Beam => Light::Beam {
            from: finite(needed(entry.from_mm, "from_mm", "beam")?, "from_mm")?,
            direction: direction(needed(entry.direction, "direction", "beam")?, "direction")?,
            spot: match (entry.radius_mm, entry.fwhm_mm) {
                (None, None) => Spot::Disk(0.0),
                (Some(radius), None) => Spot::Disk(above_zero(radius, "radius_mm")?),
                (None, Some(fwhm)) => Spot::gaussian(above_zero(fwhm, "fwhm_mm")?),
                _ => return Err(wrong("expected either `radius_mm` or `fwhm_mm`")),
            },
        },
        LightKind::Distant => {
            let radius = entry.radius_deg.unwrap_or(0.0).to_radians();
            if !(0.0..1.5).contains(&radius) {
                return Err(wrong(
                    "`radius_deg`: expected an angle from 0 to 85 degrees",
                ));
            }
            Light::Distant {
                direction: direction(
                    needed(entry.direction, "direction", "distant light")?,
                    "direction",
                )?,
                radius,
            }
        }
        LightKind::Point => Light::Point {
            at: finite(needed(entry.from_mm, "from_mm", "point light")?, "from_mm")?,
        },
        LightKind::Area => {
            let side = |value, key| finite(needed(value, key, "area light")?, key);
            let (u, v) = (side(entry.u_mm, "u_mm")?, side(entry.v_mm, "v_mm")?);
            if u.cross(v).length_squared() == 0.0 {
                return Err(wrong("expected `u_mm` and `v_mm` to span an area"));
            }
            Light::Area {
                corner: side(entry.corner_mm, "corner_mm")?,
                u,
                v,
            }
        }
        LightKind::Sky => Light::Sky,
    };
    let strength = entry.strength.clone().unwrap_or(PerChannel::All(1.0));
    Ok(Lamp {
        light,
        strength: each(&strength, channels, "strength")?,
    })
}

fn rings(entry: &RingsEntry, scene: &Scene) -> Result<Rings> {
    let object = match &entry.object {
        None => 0,
        Some(name) => {
            let found = scene.objects.iter().position(|o| o.name == *name);
            found.ok_or_else(|| wrong(format!("`object`: none is called `{name}`")))?
        }
    };
    let names = scene.objects[object].shape.face_names();
    let face = names.iter().position(|n| *n == entry.face).ok_or_else(|| {
        let known = names.join(", ");
        wrong(format!(
            "`face`: expected one of {known}, found `{}`",
            entry.face
        ))
    })?;
    let edges = &entry.edges_mm;
    if edges.len() < 2 || edges[0] < 0.0 || !edges.windows(2).all(|e| e[0] < e[1]) {
        return Err(wrong(
            "`edges_mm`: expected at least two radii that increase from 0 or more",
        ));
    }
    Ok(Rings {
        object,
        face,
        center: finite(entry.center_mm, "center_mm")?,
        edges_mm: edges.clone(),
    })
}
