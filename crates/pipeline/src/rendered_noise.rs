//! Photographs of a rendering: its noise is in every frame alike, so that no frame can tell of it.

use crate::capture::{Input, Loaded, Merged};
use crate::error::{Blame, Error, Kind, Result};
use crate::files;
use formats::read_radiance;
use std::io::Cursor;

impl Loaded {
    /// Adds the variance of the rendering that the frames show, if the manifest names one, to the
    /// merged picture: as much as both have the same light in all.
    ///
    /// # Errors
    ///
    /// It cannot be read, or has another size, other channels or no light.
    pub(crate) fn add_noise_of_rendering(&self, merged: &mut Merged) -> Result<()> {
        let Some(name) = &self.capture.sample.rendering else {
            return Ok(());
        };
        let path = self.folder.join(name);
        let bytes = files::read(&path)?;
        let rendering = read_radiance(Cursor::new(&bytes)).input(path.display())?;
        let rendering = &*rendering.map;
        let map = &mut merged.map;
        let sizes = [&*map, rendering].map(|m| (m.width, m.height, m.channels.len()));
        if sizes[0] != sizes[1] {
            let [(width, height, channels), found] = sizes;
            let message = format!(
                "{}: a rendering of {} x {} pixels and {} channels; expected the {width} x {height} and {channels} of the frames",
                path.display(),
                found.0,
                found.1,
                found.2
            );
            return Err(Error::new(Kind::Input, message));
        }
        for (channel, rendered) in map.channels.iter_mut().zip(&rendering.channels) {
            let sum = |list: &[f32]| list.iter().map(|v| f64::from(*v)).sum::<f64>();
            let [light, of_rendering] = [sum(&channel.value), sum(&rendered.value)];
            let factor = (light / of_rendering).powi(2);
            if !(factor.is_finite() && factor > 0.0) {
                let message = format!("{}: channel {} has no light", path.display(), rendered.name);
                return Err(Error::new(Kind::Input, message));
            }
            for (variance, more) in channel.variance.iter_mut().zip(&rendered.variance) {
                *variance += (factor * f64::from(*more)) as f32;
            }
        }
        merged.inputs.push(Input::new(&path, name, &bytes));
        Ok(())
    }
}
