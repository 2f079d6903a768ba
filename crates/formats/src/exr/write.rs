//! Writing, by the letter of the format.
//!
//! The `exr` crate keeps attributes in a hash map, whose order changes from run to run; equal
//! maps must give equal bytes. Uncompressed scan lines are a header and the numbers themselves.

use super::{
    CHANNELS, COUNTS_PER_SECOND, ExrError, MM_PER_PIXEL, MOSAIC, PER_SQUARE_MILLIMETRE, PROVENANCE,
    RadianceFile, U_OFFSET, U_SCALE, UNIT, VARIANCE, VIEW,
};
use std::collections::BTreeMap;
use std::io::Write;

/// Names may have 31 bytes, or 255 in a file that says so in its version.
const LONG_NAMES: u32 = 0x400;
const LONGEST_NAME: usize = 255;

/// Writes the picture, its variance and its header.
///
/// # Errors
///
/// [`ExrError::Unwritable`] for a map that contradicts itself, or what the writer reports.
pub fn write_radiance(file: &RadianceFile<'_>, mut out: impl Write) -> Result<(), ExrError> {
    check(file)?;
    let (width, height) = (file.map.width, file.map.height);
    // The format wants layers in the order of their names.
    let mut layers: BTreeMap<String, &[f32]> = BTreeMap::new();
    for channel in &file.map.channels {
        layers.insert(channel.name.clone(), &channel.value);
        layers.insert(format!("{}{VARIANCE}", channel.name), &channel.variance);
    }
    let header = header(file, &layers)?;
    out.write_all(&header)?;

    // Each line: its number, the bytes that follow, and a row of every layer.
    let line_bytes = layers.len() * width * 4;
    let first_line = header.len() + 8 * height;
    for row in 0..height {
        out.write_all(&((first_line + row * (8 + line_bytes)) as u64).to_le_bytes())?;
    }
    let mut line = Vec::with_capacity(8 + line_bytes);
    for row in 0..height {
        line.clear();
        line.extend((row as i32).to_le_bytes());
        line.extend((line_bytes as i32).to_le_bytes());
        for layer in layers.values() {
            let row = &layer[row * width..(row + 1) * width];
            line.extend(row.iter().flat_map(|value| value.to_le_bytes()));
        }
        out.write_all(&line)?;
    }
    out.flush()?;
    Ok(())
}

fn check(file: &RadianceFile<'_>) -> Result<(), ExrError> {
    let fail = |channel: &str, reason| {
        Err(ExrError::Unwritable {
            channel: channel.to_owned(),
            reason,
        })
    };
    let map = &file.map;
    // Line numbers and line lengths are 32-bit in the format.
    let line_bytes = map
        .width
        .saturating_mul(8)
        .saturating_mul(map.channels.len());
    if map.channels.is_empty() {
        return fail("", "there is no channel at all");
    }
    for (index, channel) in map.channels.iter().enumerate() {
        let name = channel.name.as_str();
        let pixels = map.width.checked_mul(map.height);
        if pixels != Some(channel.value.len()) || pixels != Some(channel.variance.len()) {
            return fail(
                name,
                "its values and variances are not width x height in number",
            );
        }
        if pixels == Some(0) || line_bytes > i32::MAX as usize || map.height > i32::MAX as usize {
            return fail(name, "its size is 0, or too large for EXR");
        }
        if map.channels[..index].iter().any(|c| c.name == name) {
            return fail(name, "its name occurs twice");
        }
        if name.ends_with(VARIANCE) {
            return fail(name, "its name ends in .variance, as variance layers do");
        }
    }
    if map.mosaic.is_some() && map.channels.len() != 1 {
        return fail("", "a mosaic has one plane for all its colours");
    }
    let of_channels = file
        .scale
        .iter()
        .map(|s| s.channel.as_str())
        .eq(map.names());
    if !file.scale.is_empty() && !of_channels {
        return fail(
            &map.channels[0].name,
            "the scale has not one entry for each channel, in order",
        );
    }
    Ok(())
}

fn header(file: &RadianceFile<'_>, layers: &BTreeMap<String, &[f32]>) -> Result<Vec<u8>, ExrError> {
    let map = &file.map;
    let mut header = Header {
        bytes: Vec::new(),
        long_names: false,
    };
    let mut list = Vec::new();
    for name in layers.keys() {
        header.check_name(name)?;
        list.extend(name.as_bytes());
        // End of the name; 32-bit float; not for perception; every pixel in x and y.
        list.extend([0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    }
    list.push(0);
    let window: Vec<u8> = [0, 0, map.width as i32 - 1, map.height as i32 - 1]
        .iter()
        .flat_map(|edge| edge.to_le_bytes())
        .collect();
    let one = 1.0_f32.to_le_bytes();
    header.attribute("channels", "chlist", &list)?;
    header.attribute("compression", "compression", &[0])?;
    header.attribute("dataWindow", "box2i", &window)?;
    header.attribute("displayWindow", "box2i", &window)?;
    header.attribute("lineOrder", "lineOrder", &[0])?;
    header.attribute("pixelAspectRatio", "float", &one)?;
    header.attribute("screenWindowCenter", "v2f", &[0; 8])?;
    header.attribute("screenWindowWidth", "float", &one)?;

    let unit = if file.scale.is_empty() {
        COUNTS_PER_SECOND
    } else {
        PER_SQUARE_MILLIMETRE
    };
    header.attribute(UNIT, "string", unit.as_bytes())?;
    let mut names = Vec::new();
    for channel in &map.channels {
        names.extend((channel.name.len() as i32).to_le_bytes());
        names.extend(channel.name.as_bytes());
    }
    header.attribute(CHANNELS, "stringvector", &names)?;
    if let Some(mosaic) = map.mosaic {
        header.attribute(MOSAIC, "string", mosaic.to_string().as_bytes())?;
    }
    if let Some(length) = file.mm_per_pixel {
        header.attribute(MM_PER_PIXEL, "double", &length.to_le_bytes())?;
    }
    if let Some(view) = file.view_mm {
        let numbers = view.map(|v| format!("{v:?}")).join(" ");
        header.attribute(VIEW, "string", numbers.as_bytes())?;
    }
    for scale in &file.scale {
        let name = format!("{U_SCALE}{}", scale.channel);
        header.attribute(&name, "double", &scale.u_scale_relative.to_le_bytes())?;
        let name = format!("{U_OFFSET}{}", scale.channel);
        header.attribute(&name, "double", &scale.u_offset_per_mm2.to_le_bytes())?;
    }
    for (key, note) in &file.provenance {
        header.attribute(&format!("{PROVENANCE}{key}"), "string", note.as_bytes())?;
    }
    let version = 2 | if header.long_names { LONG_NAMES } else { 0 };
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01];
    bytes.extend(version.to_le_bytes());
    bytes.extend(header.bytes);
    bytes.push(0);
    Ok(bytes)
}

struct Header {
    bytes: Vec<u8>,
    long_names: bool,
}

impl Header {
    fn check_name(&mut self, name: &str) -> Result<(), ExrError> {
        if name.is_empty() || name.len() > LONGEST_NAME || name.contains('\0') {
            let reason = "a name must have 1 to 255 bytes and no zero among them";
            return Err(ExrError::Unwritable {
                channel: name.to_owned(),
                reason,
            });
        }
        self.long_names |= name.len() > 31;
        Ok(())
    }

    fn attribute(&mut self, name: &str, kind: &str, value: &[u8]) -> Result<(), ExrError> {
        self.check_name(name)?;
        let size = i32::try_from(value.len()).map_err(|_| ExrError::Unwritable {
            channel: name.to_owned(),
            reason: "a note is longer than 2 GiB",
        })?;
        for part in [
            name.as_bytes(),
            &[0],
            kind.as_bytes(),
            &[0],
            &size.to_le_bytes(),
            value,
        ] {
            self.bytes.extend(part);
        }
        Ok(())
    }
}
