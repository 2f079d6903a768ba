//! Textures of a scene: from pictures to coefficients.

use super::scene::{above_zero, each, wrong};
use super::srgb;
use crate::error::{Blame, Error, Result};
use crate::files::read;
use formats::image::Oddity;
use formats::scene_toml::{PictureEntry, TextureEntry};
use formats::{Decoded, Depth, ImageError, decode_frame};
use physics::{Coefficients, DiffuseFresnel, Dipole, Medium, ReducedMedium};
use render::{Shape, Texture};
use std::path::{Path, PathBuf};

/// Most pixels of a picture, 5792 x 5792: three channels then take 0.8 GB.
const MOST: usize = 1 << 25;

/// What a picture is of.
#[derive(Clone, Copy, PartialEq)]
enum Of {
    /// A share of light, stored as one sees it.
    Albedo,
    /// A coefficient, stored as it is.
    Coefficient,
}

/// A picture, channel by channel of the scene.
struct Values {
    path: PathBuf,
    size: [usize; 2],
    /// Row by row; one list for all channels, or one each.
    planes: Vec<Vec<f32>>,
    scale: Vec<f64>,
}

impl Values {
    fn at(&self, channel: usize, texel: usize) -> f64 {
        let plane = &self.planes[channel.min(self.planes.len() - 1)];
        self.scale[channel] * f64::from(plane[texel])
    }

    /// The first value outside of what it may be.
    fn checked(self, of: Of, channels: usize) -> Result<Self> {
        let (most, expected) = match of {
            Of::Albedo => (1.0, "a share from 0 to 1"),
            Of::Coefficient => (f64::from(f32::MAX), "a coefficient of at least 0 mm^-1"),
        };
        let [width, height] = self.size;
        for channel in 0..channels {
            for texel in 0..width * height {
                let value = self.at(channel, texel);
                if !(0.0..=most).contains(&value) {
                    let (x, y) = (texel % width, texel / width);
                    let message = format!("pixel {x}, {y}: expected {expected}, found {value}");
                    return Err(wrong(message).within(self.path.display()));
                }
            }
        }
        Ok(self)
    }
}

fn values(
    entry: &PictureEntry,
    of: Of,
    channels: usize,
    folder: &Path,
    inputs: &mut Vec<PathBuf>,
) -> Result<Values> {
    let (file, scale) = match entry {
        PictureEntry::File(file) => (file, vec![1.0; channels]),
        PictureEntry::Scaled { file, scale } => (file, each(scale, channels, "scale")?),
    };
    for scale in &scale {
        above_zero(*scale, "scale")?;
    }
    let path = folder.join(file);
    let bytes = read(&path)?;
    inputs.push(path.clone());
    let Decoded {
        frame,
        depth,
        mosaic,
        curve,
        ..
    } = match decode_frame(&bytes) {
        // What a frame of a measurement would have to do does not help here.
        Err(ImageError::Odd(Oddity::Merged)) => {
            let message = "the picture is a radiance map of `render` or `hdr`, with variances; \
                           expected Y, or R, G and B alone";
            return Err(wrong(message).within(path.display()));
        }
        decoded => decoded.input(path.display())?,
    };
    let of_file = |message: String| Err(wrong(message).within(path.display()));
    let size = [frame.width, frame.height];
    if mosaic.is_some() || (frame.channels != 1 && frame.channels != channels) {
        return of_file(format!(
            "expected a gray picture, or one with the channels of the scene ({channels}), found {} channels",
            frame.channels
        ));
    }
    if size[0].saturating_mul(size[1]) > MOST {
        return of_file(format!(
            "expected at most {MOST} pixels, found {} x {}; make it smaller",
            size[0], size[1]
        ));
    }
    if of == Of::Coefficient && curve {
        return of_file(
            "the picture declares a transfer curve (sRGB, a gamma, or an ICC profile that bends), \
             but a coefficient is read as it is stored; save it linear, without the declaration, \
             or as EXR"
                .to_owned(),
        );
    }
    let (white, by_curve) = match depth {
        Depth::Bits(bits) => (f64::from(1_u32 << bits.min(16)) - 1.0, of == Of::Albedo),
        Depth::Half | Depth::Float => (1.0, false),
    };
    let samples = frame.samples.to_f32();
    let value = |sample: &f32| {
        let x = f64::from(*sample) / white;
        (if by_curve { srgb::linear(x) } else { x }) as f32
    };
    let plane = |k: usize| {
        let samples = samples.iter().skip(k).step_by(frame.channels);
        samples.map(value).collect()
    };
    let found = Values {
        size,
        planes: (0..frame.channels).map(plane).collect(),
        scale,
        path,
    };
    found.checked(of, channels)
}

/// α′ of an albedo, which is the dipole's total at it, for one index.
///
/// # Source
///
/// Jensen et al. (2001), section 2.4, the closed form of the total, which falls with √(1 − α′):
/// inverted between the lines of a table.
struct AlbedoInversion {
    /// Totals at even steps of √(1 − α′) from 1 to 0: they increase.
    totals: Vec<f64>,
}

impl AlbedoInversion {
    fn new(eta: f64) -> Self {
        const STEPS: u32 = 4096;
        let total = |k: u32| {
            let root = 1.0 - f64::from(k) / f64::from(STEPS);
            let medium = ReducedMedium {
                sigma_a: root * root,
                sigma_s_prime: 1.0 - root * root,
                eta,
            };
            Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance()
        };
        Self {
            totals: (0..=STEPS).map(total).collect(),
        }
    }

    fn albedo_prime(&self, total: f64) -> f64 {
        let last = self.totals.len() - 1;
        let next = self.totals.partition_point(|t| *t <= total).clamp(1, last);
        let (low, high) = (self.totals[next - 1], self.totals[next]);
        let part = ((total - low) / (high - low)).clamp(0.0, 1.0);
        let root = 1.0 - (next as f64 - 1.0 + part) / last as f64;
        1.0 - root * root
    }
}

/// What one picture covers of the texture coordinates of a shape.
fn covered(shape: &Shape, size_mm: Option<[f64; 2]>) -> Result<[f64; 2]> {
    let flat = matches!(shape, Shape::HalfSpace(_) | Shape::Block(_));
    match (shape, size_mm) {
        (_, Some([width, height])) if flat => Ok([
            above_zero(width, "size_mm")?,
            above_zero(height, "size_mm")?,
        ]),
        (_, None) if flat => Err(wrong(
            "`size_mm` is missing; a half-space or block needs it: width and height of the picture",
        )),
        (_, Some(_)) => Err(wrong(
            "`size_mm` is for half-spaces and blocks; a mesh has texture coordinates of its own, \
             a sphere longitude and latitude",
        )),
        (Shape::Mesh(mesh), None) if !mesh.has_texture_coordinates() => Err(wrong(
            "its mesh has no texture coordinates for every vertex (`vt` of an OBJ file; `u` and \
             `v`, or `s` and `t`, of a PLY file); save it with them",
        )),
        _ => Ok([1.0; 2]),
    }
}

/// The texture of an object of this shape, whose material has these media.
///
/// # Errors
///
/// The error names the key, the picture and the pixel.
pub(super) fn texture(
    entry: &TextureEntry,
    shape: &Shape,
    media: &[Medium],
    folder: &Path,
    inputs: &mut Vec<PathBuf>,
) -> Result<Texture> {
    let size = covered(shape, entry.size_mm)?;
    let (for_a, for_s, for_reduced) = (
        &entry.sigma_a_per_mm,
        &entry.sigma_s_per_mm,
        &entry.sigma_s_prime_per_mm,
    );
    let coefficients = for_a.is_some() || for_s.is_some() || for_reduced.is_some();
    if entry.albedo.is_some() == coefficients {
        return Err(wrong(
            "expected either `albedo`, or coefficients: `sigma_a_per_mm`, `sigma_s_per_mm` or \
             `sigma_s_prime_per_mm`",
        ));
    }
    if for_s.is_some() && for_reduced.is_some() {
        return Err(wrong(
            "expected either `sigma_s_per_mm` or `sigma_s_prime_per_mm`",
        ));
    }
    let mut first: Option<(PathBuf, [usize; 2])> = None;
    let mut picture = |entry: &Option<PictureEntry>, of, key: &str| -> Result<Option<Values>> {
        let Some(entry) = entry else {
            return Ok(None);
        };
        let within = |e: Error| e.within(format!("`{key}`"));
        let found = values(entry, of, media.len(), folder, inputs).map_err(within)?;
        let (path, size) = first.get_or_insert_with(|| (found.path.clone(), found.size));
        if *size != found.size {
            let message = format!(
                "expected {} x {} pixels as {} has, found {} x {}; the pictures of a texture need one size",
                size[0],
                size[1],
                path.display(),
                found.size[0],
                found.size[1]
            );
            return Err(within(wrong(message).within(found.path.display())));
        }
        Ok(Some(found))
    };
    let albedo = picture(&entry.albedo, Of::Albedo, "albedo")?;
    let sigma_a = picture(for_a, Of::Coefficient, "sigma_a_per_mm")?;
    let sigma_s = picture(for_s, Of::Coefficient, "sigma_s_per_mm")?;
    let reduced = picture(for_reduced, Of::Coefficient, "sigma_s_prime_per_mm")?;
    let [width, height] = first.map_or([0; 2], |(_, size)| size);
    let of_channel = |(channel, medium): (usize, &Medium)| {
        let Coefficients {
            sigma_a: own_a,
            sigma_s_prime: own_s,
        } = medium.reduced().coefficients();
        let by_albedo = albedo
            .as_ref()
            .map(|albedo| (albedo, AlbedoInversion::new(medium.eta)));
        let texel = |k: usize| {
            let (a, s) = match &by_albedo {
                Some((albedo, inversion)) => {
                    let share = inversion.albedo_prime(albedo.at(channel, k));
                    ((1.0 - share) * (own_a + own_s), share * (own_a + own_s))
                }
                None => (
                    sigma_a.as_ref().map_or(own_a, |v| v.at(channel, k)),
                    match (&sigma_s, &reduced) {
                        (Some(v), _) => v.at(channel, k) * (1.0 - medium.g),
                        (_, Some(v)) => v.at(channel, k),
                        _ => own_s,
                    },
                ),
            };
            [a as f32, (s / (1.0 - medium.g)) as f32]
        };
        (0..width * height).map(texel).collect()
    };
    Ok(Texture {
        width,
        height,
        size,
        texels: media.iter().enumerate().map(of_channel).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the closed form itself, in the paper's symbols.
    #[test]
    fn the_albedo_is_the_total_that_comes_out() {
        for eta in [1.0, 1.3, 1.5] {
            let inversion = AlbedoInversion::new(eta);
            let a = DiffuseFresnel::Exact.a(eta);
            for total in [0.0, 0.01, 0.2, 0.5, 0.9, 0.99, 1.0] {
                let albedo = inversion.albedo_prime(total);
                let s = (3.0 * (1.0 - albedo)).sqrt();
                let found = 0.5 * albedo * (1.0 + (-4.0 / 3.0 * a * s).exp()) * (-s).exp();
                assert!((found - total).abs() < 1e-6, "{eta}, {total}: {found}");
            }
        }
    }
}
