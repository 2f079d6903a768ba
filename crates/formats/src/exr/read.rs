//! Reading, by the `exr` crate: other programs may have compressed or tiled the file since.

use super::{
    CHANNELS, COUNTS_PER_SECOND, ChannelScale, ExrError, MM_PER_PIXEL, MOSAIC,
    PER_SQUARE_MILLIMETRE, PROVENANCE, RadianceFile, U_OFFSET, U_SCALE, UNIT, VARIANCE, VIEW,
};
use exr::compression::Compression;
use exr::image::FlatSamples;
use exr::image::read::image::ReadLayers;
use exr::image::read::layers::ReadChannels;
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use physics::{ChannelMap, Mosaic, RadianceMap};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::{BufRead, Seek, SeekFrom};

/// No codec of the format packs more tightly than Deflate, 1032 bytes into one, and the
/// lossy ones are worth nothing to us.
const LARGEST_RATIO: usize = 1100;

/// The radiance map that `file` holds, as [`write_radiance`](super::write_radiance) wrote it,
/// whatever lossless compression it went through since.
///
/// # Errors
///
/// [`ExrError`] names the attribute, the layer or the pixel.
pub fn read_radiance(mut file: impl BufRead + Seek) -> Result<RadianceFile<'static>, ExrError> {
    let length = file.seek(SeekFrom::End(0))?;
    file.rewind()?;
    let meta = MetaData::read_from_buffered(&mut file, false)?;
    check_header(&meta, usize::try_from(length).unwrap_or(usize::MAX))?;
    file.rewind()?;
    let mut image = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(file)?;
    let layer = &mut image.layer_data;
    let attributes = Attributes(&layer.attributes.other);
    let size = layer.size;
    let names: Vec<String> = layer
        .channel_data
        .list
        .iter()
        .map(|l| text(&l.name))
        .collect::<Option<_>>()
        .unwrap_or_default();
    let mut layers: BTreeMap<String, FlatSamples> = BTreeMap::new();
    for (name, layer) in names.iter().zip(layer.channel_data.list.drain(..)) {
        layers.insert(name.clone(), layer.sample_data);
    }
    let mut take = |name: String| match layers.remove(&name) {
        Some(FlatSamples::F32(samples)) => Ok((name, samples)),
        _ => Err(ExrError::Layer {
            name,
            found: names.clone(),
        }),
    };

    let order = attributes.texts(CHANNELS, "the names of the channels")?;
    let mut channels = Vec::with_capacity(order.len());
    for name in order {
        let (name, value) = take(name)?;
        let (variance_name, variance) = take(format!("{name}{VARIANCE}"))?;
        check_pixels(&name, size, &value, f32::is_finite, "a finite number")?;
        let expected = "a number of at least 0, or infinity";
        check_pixels(&variance_name, size, &variance, |v| v >= 0.0, expected)?;
        channels.push(ChannelMap {
            name,
            value,
            variance,
        });
    }
    if channels.is_empty() {
        return Err(attribute(CHANNELS, "the name of at least one channel"));
    }
    let mosaic = attributes.mosaic()?;
    if mosaic.is_some() && channels.len() != 1 {
        return Err(attribute(CHANNELS, "one plane for all colours of a mosaic"));
    }
    let map = RadianceMap {
        width: size.width(),
        height: size.height(),
        channels,
        mosaic,
    };
    let scale = match attributes.text(UNIT, "`DN/s` or `mm^-2`")?.as_str() {
        COUNTS_PER_SECOND => Vec::new(),
        PER_SQUARE_MILLIMETRE => map
            .names()
            .into_iter()
            .map(|channel| {
                let name = format!("{U_SCALE}{channel}");
                let expected = "the relative uncertainty of the scale, at least 0";
                let u_scale_relative = attributes
                    .number(&name, expected)?
                    .filter(|u| *u >= 0.0)
                    .ok_or_else(|| attribute(&name, expected))?;
                // Files from before there was one lack nothing.
                let name = format!("{U_OFFSET}{channel}");
                let expected = "an uncertainty in mm^-2, at least 0";
                let u_offset_per_mm2 = attributes.number(&name, expected)?.unwrap_or(0.0);
                if u_offset_per_mm2 < 0.0 {
                    return Err(attribute(&name, expected));
                }
                Ok(ChannelScale {
                    channel: channel.to_owned(),
                    u_scale_relative,
                    u_offset_per_mm2,
                })
            })
            .collect::<Result<_, ExrError>>()?,
        _ => return Err(attribute(UNIT, "`DN/s` or `mm^-2`")),
    };
    let expected = "a length above 0 mm";
    let mm_per_pixel = match attributes.number(MM_PER_PIXEL, expected)? {
        Some(length) if length <= 0.0 => return Err(attribute(MM_PER_PIXEL, expected)),
        length => length,
    };
    let view_mm = attributes.view()?;
    Ok(RadianceFile {
        map: Cow::Owned(map),
        mm_per_pixel,
        view_mm,
        scale,
        provenance: attributes.provenance()?,
    })
}

/// Refuses what the decoder would allocate for, or panic at, before it is asked.
fn check_header(meta: &MetaData, length: usize) -> Result<(), ExrError> {
    let [header] = meta.headers.as_slice() else {
        return Err(ExrError::Layout("made of several parts"));
    };
    if header.deep {
        return Err(ExrError::Layout("deep"));
    }
    if header
        .channels
        .list
        .iter()
        .any(|channel| channel.sampling != Vec2(1, 1))
    {
        return Err(ExrError::Layout("subsampled"));
    }
    let Vec2(width, height) = header.layer_size;
    let ratio = match header.compression {
        Compression::Uncompressed => 1,
        _ => LARGEST_RATIO,
    };
    let fits = width
        .checked_mul(height)
        .and_then(|pixels| pixels.checked_mul(header.channels.bytes_per_pixel))
        .is_some_and(|size| size <= length.saturating_mul(ratio));
    if fits {
        Ok(())
    } else {
        Err(ExrError::Oversized {
            width,
            height,
            bytes: length,
        })
    }
}

fn check_pixels(
    layer: &str,
    Vec2(width, _): Vec2<usize>,
    samples: &[f32],
    good: fn(f32) -> bool,
    expected: &'static str,
) -> Result<(), ExrError> {
    match samples.iter().position(|sample| !good(*sample)) {
        None => Ok(()),
        Some(at) => Err(ExrError::Pixel {
            layer: layer.to_owned(),
            column: at % width,
            row: at / width,
            found: samples[at],
            expected,
        }),
    }
}

fn attribute(name: &str, expected: &'static str) -> ExrError {
    ExrError::Attribute {
        name: name.to_owned(),
        expected,
    }
}

/// The bytes as UTF-8, as we write them; the crate's own conversion takes them for Latin-1.
fn text(bytes: &Text) -> Option<String> {
    String::from_utf8(bytes.as_slice().to_vec()).ok()
}

struct Attributes<'a>(&'a HashMap<Text, AttributeValue>);

impl Attributes<'_> {
    fn get(&self, name: &str) -> Option<&AttributeValue> {
        self.0.get(name.as_bytes())
    }

    fn text(&self, name: &str, expected: &'static str) -> Result<String, ExrError> {
        match self.get(name) {
            Some(AttributeValue::Text(value)) => text(value),
            _ => None,
        }
        .ok_or_else(|| attribute(name, expected))
    }

    fn texts(&self, name: &str, expected: &'static str) -> Result<Vec<String>, ExrError> {
        match self.get(name) {
            Some(AttributeValue::TextVector(values)) => values.iter().map(text).collect(),
            _ => None,
        }
        .ok_or_else(|| attribute(name, expected))
    }

    fn mosaic(&self) -> Result<Option<Mosaic>, ExrError> {
        if self.get(MOSAIC).is_none() {
            return Ok(None);
        }
        let expected = "a pattern of R, G and B, as RGGB";
        let pattern = self.text(MOSAIC, expected)?.parse();
        pattern.map(Some).map_err(|_| attribute(MOSAIC, expected))
    }

    fn number(&self, name: &str, expected: &'static str) -> Result<Option<f64>, ExrError> {
        match self.get(name) {
            None => Ok(None),
            Some(AttributeValue::F64(value)) if value.is_finite() => Ok(Some(*value)),
            Some(_) => Err(attribute(name, expected)),
        }
    }

    /// The nine numbers of [`VIEW`].
    fn view(&self) -> Result<Option<[f64; 9]>, ExrError> {
        const EXPECTED: &str = "nine numbers, row by row, that map pixels to mm";
        if self.get(VIEW).is_none() {
            return Ok(None);
        }
        let numbers: Option<Vec<f64>> = self
            .text(VIEW, EXPECTED)?
            .split_whitespace()
            .map(|word| word.parse().ok().filter(|v: &f64| v.is_finite()))
            .collect();
        match numbers.and_then(|n| <[f64; 9]>::try_from(n).ok()) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(attribute(VIEW, EXPECTED)),
        }
    }

    fn provenance(&self) -> Result<BTreeMap<String, String>, ExrError> {
        let notes = self.0.iter().filter_map(|(name, value)| {
            let name = text(name)?;
            Some((name.strip_prefix(PROVENANCE)?.to_owned(), value))
        });
        notes
            .map(|(key, value)| {
                match value {
                    AttributeValue::Text(value) => text(value).map(|value| (key.clone(), value)),
                    _ => None,
                }
                .ok_or_else(|| attribute(&format!("{PROVENANCE}{key}"), "a text in UTF-8"))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{bytes, read, sample};
    use super::*;
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, Image, Layer, LayerAttributes, WritableImage,
    };
    use std::io::Cursor;

    /// The same layers written by the `exr` crate, with any attributes.
    fn foreign(encoding: Encoding, attributes: LayerAttributes) -> Vec<u8> {
        let list = sample()
            .map
            .into_owned()
            .channels
            .into_iter()
            .flat_map(|channel| {
                let variance = format!("{}.variance", channel.name);
                [
                    AnyChannel::new(channel.name.as_str(), FlatSamples::F32(channel.value)),
                    AnyChannel::new(variance.as_str(), FlatSamples::F32(channel.variance)),
                ]
            });
        let channels = AnyChannels::sort(list.collect());
        let image = Image::from_layer(Layer::new((3, 2), attributes, encoding, channels));
        let mut out = Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut out).unwrap();
        out.into_inner()
    }

    #[test]
    fn a_file_recompressed_elsewhere_still_reads() {
        let ours = bytes(&sample());
        let meta = MetaData::read_from_buffered(Cursor::new(&ours), true).unwrap();
        let attributes = meta.headers[0].own_attributes.clone();
        let compressed = foreign(Encoding::SMALL_LOSSLESS, attributes);
        assert_eq!(read(&compressed).unwrap(), sample());
    }

    #[test]
    fn what_is_missing_is_named() {
        let mut attributes = LayerAttributes::default();
        let mut message = |name: &str, value: AttributeValue| {
            let found = read(&foreign(Encoding::UNCOMPRESSED, attributes.clone()))
                .unwrap_err()
                .to_string();
            attributes.other.insert(Text::from(name), value);
            found
        };
        let names = |names: &[&str]| {
            AttributeValue::TextVector(names.iter().map(|name| Text::from(*name)).collect())
        };
        let found = message(CHANNELS, names(&["G", "Z"]));
        assert!(
            found.starts_with("attribute `beamspot.channels`: expected"),
            "{found}"
        );
        let found = message(CHANNELS, names(&["G"]));
        assert!(
            found.contains("no 32-bit float layer `Z`; found B, B.variance, G"),
            "{found}"
        );
        let found = message(UNIT, AttributeValue::Text(Text::from("mm^-2")));
        assert!(
            found.starts_with("attribute `beamspot.unit`: expected"),
            "{found}"
        );
        let found = message(&format!("{U_SCALE}G"), AttributeValue::F64(0.01));
        assert!(
            found.starts_with("attribute `beamspot.u_scale_relative.G`"),
            "{found}"
        );
        let found = read(&foreign(Encoding::UNCOMPRESSED, attributes)).unwrap();
        assert_eq!(found.map.channels, sample().map.channels[1..2]);
    }

    #[test]
    fn a_pixel_that_no_merge_makes_is_named() {
        let mut file = sample();
        file.map.to_mut().channels[1].value[4] = f32::NAN;
        let found = read(&bytes(&file)).unwrap_err().to_string();
        assert_eq!(
            found,
            "layer `G`, pixel 1, 1: found NaN, expected a finite number"
        );
        let mut file = sample();
        file.map.to_mut().channels[0].variance[0] = -1.0;
        let found = read(&bytes(&file)).unwrap_err().to_string();
        assert!(
            found.starts_with("layer `R.variance`, pixel 0, 0: found -1"),
            "{found}"
        );
    }

    #[test]
    fn a_size_that_the_bytes_cannot_hold_allocates_nothing() {
        let mut file = bytes(&sample());
        for name in [b"dataWindow\0box2i\0", b"displayWin\0box2i\0"] {
            if let Some(at) = file.windows(name.len()).position(|w| w == name) {
                let corner = at + name.len() + 4 + 8;
                file[corner..corner + 8].copy_from_slice(&[0, 0, 0, 0x10, 0, 0, 0, 0x10]);
            }
        }
        let found = read(&file).unwrap_err().to_string();
        assert!(
            found.contains("promises 268435457 x 268435457 pixels"),
            "{found}"
        );
    }
}
