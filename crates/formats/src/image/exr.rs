//! OpenEXR as a frame: Y, or R, G and B, linear by definition.

use super::{Decoded, Depth, ImageError, LARGEST_RATIO, Oddity, check_finite, sample_count};
use ::exr::compression::Compression;
use ::exr::image::FlatSamples;
use ::exr::image::read::image::ReadLayers;
use ::exr::image::read::layers::ReadChannels;
use ::exr::math::Vec2;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::SampleType;
use physics::{Frame, Samples};
use std::io::Cursor;

pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, ImageError> {
    let Header {
        size: [width, height, channels],
        depth,
        loss,
        pixel_aspect,
        origin,
    } = check_header(bytes)?;
    let channels = channels as usize;
    let image = ::exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))?;
    let list = image.layer_data.channel_data.list;
    // The list is in alphabetical order: B, G, R.
    let planes: Vec<Vec<f32>> = list
        .into_iter()
        .rev()
        .map(|channel| match channel.sample_data {
            FlatSamples::F32(samples) => samples,
            FlatSamples::F16(samples) => samples.into_iter().map(|s| s.to_f32()).collect(),
            FlatSamples::U32(samples) => samples.into_iter().map(|s| s as f32).collect(),
        })
        .collect();
    let pixels = width as usize * height as usize;
    if planes.len() != channels || planes.iter().any(|plane| plane.len() != pixels) {
        return Err(ImageError::Odd(Oddity::ExrLayout));
    }
    let samples = match planes.as_slice() {
        [red, green, blue] => (0..pixels)
            .flat_map(|i| [red[i], green[i], blue[i]])
            .collect(),
        _ => planes.concat(),
    };
    let frame = Frame {
        width: width as usize,
        height: height as usize,
        channels,
        samples: Samples::F32(samples),
    };
    check_finite(&frame)?;
    Ok(Decoded {
        loss,
        pixel_aspect,
        origin,
        ..Decoded::plain(frame, depth)
    })
}

/// What a header says of the picture.
struct Header {
    /// Width, height and channels.
    size: [u32; 3],
    depth: Depth,
    /// The name of a compression that loses something.
    loss: Option<&'static str>,
    pixel_aspect: f64,
    /// Column and row of the first pixel in the display window.
    origin: [i32; 2],
}

/// What the header says. Refuses what the decoder would allocate for, or leave out, before
/// it is asked.
fn check_header(bytes: &[u8]) -> Result<Header, ImageError> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false)?;
    let odd = |oddity| Err(ImageError::Odd(oddity));
    let [header] = meta.headers.as_slice() else {
        return odd(Oddity::ExrLayout);
    };
    let list = &header.channels.list;
    if header.deep || list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return odd(Oddity::ExrLayout);
    }
    let attributes = &header.own_attributes.other;
    if attributes
        .keys()
        .any(|name| name.as_slice().starts_with(b"beamspot."))
    {
        return odd(Oddity::Merged);
    }
    let names: Vec<String> = list
        .iter()
        .map(|channel| channel.name.to_string())
        .collect();
    if names != ["Y"] && names != ["B", "G", "R"] {
        return Err(ImageError::ExrChannels(names.join(", ")));
    }
    let all = |kind| list.iter().all(|channel| channel.sample_type == kind);
    let depth = if all(SampleType::U32) {
        Depth::Bits(32)
    } else if list
        .iter()
        .any(|channel| channel.sample_type == SampleType::F16)
    {
        Depth::Half
    } else {
        Depth::Float
    };
    let loss = match header.compression {
        Compression::B44 | Compression::B44A => Some("B44"),
        Compression::DWAA(_) | Compression::DWAB(_) => Some("DWA"),
        // It keeps 24 bits of 32, and halves as they are.
        Compression::PXR24 if !all(SampleType::F16) => Some("PXR24"),
        _ => None,
    };
    let ratio = match header.compression {
        Compression::Uncompressed => 1,
        _ => LARGEST_RATIO,
    };
    let Vec2(width, height) = header.layer_size;
    let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
        return odd(Oddity::ExrLayout);
    };
    let size = [width, height, names.len() as u32];
    // Half floats, the shortest, are the most that the bytes can hold.
    sample_count(size, bytes.len() as u64, ratio, 16)?;
    let (first, whole) = (
        header.own_attributes.layer_position,
        header.shared_attributes.display_window.position,
    );
    let origin = [
        first.0.saturating_sub(whole.0),
        first.1.saturating_sub(whole.1),
    ];
    Ok(Header {
        size,
        depth,
        loss,
        pixel_aspect: header.shared_attributes.pixel_aspect.into(),
        origin,
    })
}

#[cfg(test)]
mod tests {
    use super::super::decode_frame;
    use super::*;
    use ::exr::prelude::{
        AnyChannel, AnyChannels, Encoding, Image, Layer, LayerAttributes, WritableImage,
    };

    fn file(channels: &[(&str, FlatSamples)]) -> Vec<u8> {
        packed(channels, Encoding::SMALL_LOSSLESS)
    }

    fn packed(channels: &[(&str, FlatSamples)], encoding: Encoding) -> Vec<u8> {
        let list = channels
            .iter()
            .map(|(name, samples)| AnyChannel::new(*name, samples.clone()));
        let channels = AnyChannels::sort(list.collect());
        let attributes = LayerAttributes::default();
        let layer = Layer::new((2, 1), attributes, encoding, channels);
        let mut out = Cursor::new(Vec::new());
        let image = Image::from_layer(layer);
        image.write().non_parallel().to_buffered(&mut out).unwrap();
        out.into_inner()
    }

    #[test]
    fn colours_come_in_the_order_of_the_camera() {
        let plane = |a: f32| FlatSamples::F32(vec![a, a + 0.5]);
        let bytes = file(&[("R", plane(1.0)), ("G", plane(2.0)), ("B", plane(-3.0))]);
        let frame = decode_frame(&bytes).unwrap().frame;
        assert_eq!((frame.width, frame.height, frame.channels), (2, 1, 3));
        let expected = Samples::F32(vec![1.0, 2.0, -3.0, 1.5, 2.5, -2.5]);
        assert_eq!(frame.samples, expected);
    }

    #[test]
    fn other_channels_and_other_numbers_are_refused() {
        let plane = FlatSamples::F32(vec![0.0; 2]);
        let found = decode_frame(&file(&[("Y", plane.clone()), ("A", plane)]));
        let found = found.unwrap_err().to_string();
        assert!(found.contains("found the channels A, Y"), "{found}");
        let bad = file(&[("Y", FlatSamples::F32(vec![0.0, f32::INFINITY]))]);
        let found = decode_frame(&bad).unwrap_err().to_string();
        assert!(found.contains("pixel 1, 0: found inf"), "{found}");
    }

    #[test]
    fn what_was_packed_with_loss_is_refused_and_depths_are_told_apart() {
        let float = FlatSamples::F32(vec![1.0; 2]);
        let half = FlatSamples::F16(vec![::exr::prelude::f16::ONE; 2]);
        let whole = FlatSamples::U32(vec![1; 2]);
        let lossy = Encoding {
            compression: Compression::PXR24,
            ..Encoding::UNCOMPRESSED
        };
        let found = decode_frame(&packed(&[("Y", float.clone())], lossy)).unwrap();
        let found = found.linear(true).unwrap_err().to_string();
        assert!(found.contains("with loss (PXR24)"), "{found}");
        let same = decode_frame(&packed(&[("Y", half.clone())], lossy)).unwrap();
        assert_eq!(
            same.linear(false).unwrap().samples,
            Samples::F32(vec![1.0; 2])
        );
        for (plane, depth) in [
            (float, Depth::Float),
            (half, Depth::Half),
            (whole, Depth::Bits(32)),
        ] {
            assert_eq!(decode_frame(&file(&[("Y", plane)])).unwrap().depth, depth);
        }
    }

    #[test]
    fn where_a_data_window_begins_and_how_wide_its_pixels_are_is_told() {
        let channels = [AnyChannel::new("Y", FlatSamples::F32(vec![1.0, 2.0]))];
        let channels = AnyChannels::sort(channels.into_iter().collect());
        let layer = Layer::new(
            (2, 1),
            LayerAttributes::default().with_position(Vec2(8, -3)),
            Encoding::UNCOMPRESSED,
            channels,
        );
        let mut image = Image::from_layer(layer);
        image.attributes.display_window.position = Vec2(3, -4);
        image.attributes.pixel_aspect = 1.5;
        let mut out = Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut out).unwrap();
        let found = decode_frame(out.get_ref()).unwrap();
        assert_eq!((found.origin, found.pixel_aspect), ([5, 1], 1.5));
        let plain = decode_frame(&file(&[("Y", FlatSamples::F32(vec![0.0; 2]))])).unwrap();
        assert_eq!((plain.origin, plain.pixel_aspect), ([0, 0], 1.0));
    }
}
