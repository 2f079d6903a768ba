//! Triangle meshes: OBJ and PLY, text and binary.

use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use std::io::{BufReader, Read};
use thiserror::Error;

/// Triangles as a file has them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// Corners, in the file's unit.
    pub vertices: Vec<[f64; 3]>,
    /// Indices of vertices, from 0; faces of more corners are cut into fans.
    pub triangles: Vec<[u32; 3]>,
    /// One normal a vertex, or none at all.
    pub normals: Vec<[f64; 3]>,
    /// One pair of texture coordinates a vertex, or none at all.
    pub coordinates: Vec<[f64; 2]>,
}

/// A mesh cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeshFileError {
    /// Not an OBJ file, or a damaged one.
    #[error("OBJ: {0}; the file is damaged: export the mesh anew")]
    Obj(tobj::LoadError),
    /// A coordinate is not a number, or infinite.
    #[error(
        "OBJ: line {line}: `{text}` has a number that is not finite; put it right, or export the mesh anew"
    )]
    NotFinite {
        /// The line, from 1.
        line: usize,
        /// What it says.
        text: String,
    },
    /// Not a PLY file, or a damaged one.
    #[error("PLY: {0}; the file is cut short or damaged: copy it, or export the mesh anew")]
    Ply(String),
    /// An element or a property that must be there is not.
    #[error("PLY: no {0}; expected vertices with x, y, z and faces with vertex_indices")]
    Missing(&'static str),
    /// A face with an index that no vertex can have.
    #[error("PLY: face {0} has an index that is negative or too large; export the mesh anew")]
    Index(usize),
}

/// Reads an OBJ file; materials and groups are passed over, all its objects are one solid.
///
/// # Errors
///
/// [`MeshFileError::Obj`], [`MeshFileError::NotFinite`].
pub fn read_obj(bytes: &[u8]) -> Result<Triangles, MeshFileError> {
    // The reader joins vertices and numbers them anew: afterwards nobody can tell which it was.
    for (index, line) in bytes.split(|b| *b == b'\n').enumerate() {
        if !line.trim_ascii_start().starts_with(b"v") {
            continue;
        }
        let text = String::from_utf8_lossy(line);
        let no_number = |word: &str| word.parse::<f64>().is_ok_and(|x| !x.is_finite());
        if text.split_ascii_whitespace().skip(1).any(no_number) {
            return Err(MeshFileError::NotFinite {
                line: index + 1,
                text: text.trim().chars().take(60).collect(),
            });
        }
    }
    let options = tobj::LoadOptions {
        triangulate: true,
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let mut reader = BufReader::new(bytes);
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, |_| Ok(Default::default()))
        .map_err(MeshFileError::Obj)?;
    let mut all = Triangles::default();
    for tobj::Model { mesh, .. } in models {
        let first = all.vertices.len() as u32;
        let (points, _) = mesh.positions.as_chunks();
        // Lists that only a part of the objects has are of no use.
        let before = all.vertices.len();
        all.vertices.extend(points);
        if all.normals.len() == before {
            all.normals.extend(mesh.normals.as_chunks().0);
        }
        if all.coordinates.len() == before {
            all.coordinates.extend(mesh.texcoords.as_chunks().0);
        }
        let (triangles, _) = mesh.indices.as_chunks::<3>();
        all.triangles
            .extend(triangles.iter().map(|t| t.map(|i| i + first)));
    }
    let vertices = all.vertices.len();
    if all.normals.len() != vertices {
        all.normals.clear();
    }
    if all.coordinates.len() != vertices {
        all.coordinates.clear();
    }
    Ok(all)
}

/// Reads a PLY file, text or binary of either order.
///
/// # Errors
///
/// [`MeshFileError`] says what is missing.
pub fn read_ply(mut bytes: impl Read) -> Result<Triangles, MeshFileError> {
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut bytes)
        .map_err(|e| MeshFileError::Ply(first_line(&e.to_string())))?;
    let vertices = ply
        .payload
        .get("vertex")
        .ok_or(MeshFileError::Missing("vertices"))?;
    let faces = ply
        .payload
        .get("face")
        .ok_or(MeshFileError::Missing("faces"))?;
    let list = |names: [&str; 3]| -> Vec<[f64; 3]> {
        let all = vertices.iter().map(|v| {
            let [x, y, z] = names.map(|n| v.get(n).and_then(number));
            Some([x?, y?, z?])
        });
        all.collect::<Option<_>>().unwrap_or_default()
    };
    let mut out = Triangles {
        vertices: list(["x", "y", "z"]),
        normals: list(["nx", "ny", "nz"]),
        ..Triangles::default()
    };
    if out.vertices.len() != vertices.len() {
        return Err(MeshFileError::Missing("x, y, z"));
    }
    for names in [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]] {
        let all = vertices.iter().map(|vertex| {
            let [u, v] = names.map(|n| vertex.get(n).and_then(number));
            Some([u?, v?])
        });
        if let Some(found) = all.collect::<Option<Vec<_>>>() {
            out.coordinates = found;
            break;
        }
    }
    for (k, face) in faces.iter().enumerate() {
        let corners = ["vertex_indices", "vertex_index"]
            .iter()
            .find_map(|name| face.get(*name))
            .ok_or(MeshFileError::Missing("vertex_indices"))?;
        let corners = indices(corners).ok_or(MeshFileError::Index(k + 1))?;
        for pair in corners.get(1..).unwrap_or_default().windows(2) {
            out.triangles.push([corners[0], pair[0], pair[1]]);
        }
    }
    Ok(out)
}

/// The reader's own causes stand on lines of their own, and say nothing new.
fn first_line(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    line.trim_end_matches('.').to_owned()
}

fn number(property: &Property) -> Option<f64> {
    Some(match *property {
        Property::Char(x) => x.into(),
        Property::UChar(x) => x.into(),
        Property::Short(x) => x.into(),
        Property::UShort(x) => x.into(),
        Property::Int(x) => x.into(),
        Property::UInt(x) => x.into(),
        Property::Float(x) => x.into(),
        Property::Double(x) => x,
        _ => return None,
    })
}

fn indices(property: &Property) -> Option<Vec<u32>> {
    fn all<T: Copy + TryInto<u32>>(list: &[T]) -> Option<Vec<u32>> {
        list.iter().map(|x| (*x).try_into().ok()).collect()
    }
    match property {
        Property::ListChar(list) => all(list),
        Property::ListUChar(list) => all(list),
        Property::ListShort(list) => all(list),
        Property::ListUShort(list) => all(list),
        Property::ListInt(list) => all(list),
        Property::ListUInt(list) => all(list),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                       f 1/1 2/2 3/3 4/4\n";

    #[test]
    fn a_square_is_two_triangles() {
        let mesh = read_obj(OBJ.as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.vertices[3], [0.0, 1.0, 0.5]);
        assert_eq!(mesh.coordinates[2], [1.0, 1.0]);
        assert!(mesh.normals.is_empty());
    }

    #[test]
    fn ply_in_text_and_in_bytes() {
        let header = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                 property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
                 end_header\n"
            )
        };
        let text = header("ascii") + "0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n4 0 1 2 3\n";
        let read = read_ply(text.as_bytes()).unwrap();
        let mut bytes = header("binary_little_endian").into_bytes();
        for x in [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.5_f32] {
            bytes.extend(x.to_le_bytes());
        }
        bytes.push(4);
        for i in 0..4_i32 {
            bytes.extend(i.to_le_bytes());
        }
        assert_eq!(read_ply(&bytes[..]).unwrap(), read);
        assert_eq!(read.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(read.vertices[3], [0.0, 1.0, 0.5]);
        // Cut short, or of a size that no memory has.
        assert!(read_ply(&bytes[..bytes.len() - 3]).is_err());
        let huge = text.replace("vertex 4", "vertex 4000000000000");
        assert!(read_ply(huge.as_bytes()).is_err());
    }

    #[test]
    fn what_is_no_mesh_is_refused() {
        assert!(read_obj(b"v 1 nothing 2\nf 1 2 3\n").is_err());
        for bad in ["v 0 nan 1", "  v 0 1 -inf", "vn 0 0 NaN", "vt 1e999 0"] {
            let found = read_obj(OBJ.replace("v 0 1 0.5", bad).as_bytes());
            let at = matches!(&found, Err(MeshFileError::NotFinite { line: 4, text }) if text == bad.trim());
            assert!(at, "{bad}: {found:?}");
        }
        assert!(read_obj(b"v 1 2 3\nf 1 2 9\n").is_err());
        assert!(read_ply(&b"nothing"[..]).is_err());
        let lines = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n";
        assert!(matches!(
            read_ply(lines.as_bytes()),
            Err(MeshFileError::Missing(_))
        ));
    }
}
