//! A picture whose every pixel has a variance.

/// One channel of a [`RadianceMap`].
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelMap {
    /// Name of the channel: `R`, `G`, `B`, `Y` or a wavelength.
    pub name: String,
    /// Value of each pixel, row by row; may be negative where noise outweighs light.
    pub value: Vec<f32>,
    /// Variance of each value, in the square of its unit; infinite where no frame measured the
    /// pixel, whose value is then 0.
    pub variance: Vec<f32>,
}

/// A merged picture: channels of one size.
///
/// In DN/s as merged; in mm⁻², the unit of R_d, once a reference has set its scale.
#[derive(Clone, Debug, PartialEq)]
pub struct RadianceMap {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The channels, in the order of the camera.
    pub channels: Vec<ChannelMap>,
}

impl ChannelMap {
    /// The same picture with every value times `factor`, and the variances to match.
    pub fn scaled(&self, factor: f64) -> Self {
        let square = (factor * factor) as f32;
        Self {
            name: self.name.clone(),
            value: self
                .value
                .iter()
                .map(|v| (f64::from(*v) * factor) as f32)
                .collect(),
            variance: self.variance.iter().map(|v| v * square).collect(),
        }
    }
}

impl RadianceMap {
    /// The channel called `name`.
    pub fn channel(&self, name: &str) -> Option<&ChannelMap> {
        self.channels.iter().find(|c| c.name == name)
    }
}
