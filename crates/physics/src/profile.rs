//! Radial profiles: measured, simulated and rendered ones are this one type.

/// Reflectance at one radius, or averaged over one ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfilePoint {
    /// Inner and outer edge of the ring, mm; `None` for a value at `radius_mm` alone.
    pub ring_mm: Option<(f64, f64)>,
    /// Area-weighted mean radius of the ring, mm.
    pub radius_mm: f64,
    /// Exitance per incident power, the specular part left out, mean over the ring, mm⁻².
    pub reflectance_per_mm2: f64,
    /// Standard uncertainty of the value, mm⁻²: the part independent of every other point.
    pub u_reflectance_per_mm2: f64,
    /// How many pixels were averaged; `None` where there are none.
    pub pixels: Option<u64>,
}

impl ProfilePoint {
    /// Area of the ring, mm²; 0 for a value at one radius.
    pub fn area_mm2(&self) -> f64 {
        self.ring_mm.map_or(0.0, |(inner, outer)| {
            std::f64::consts::PI * (outer - inner) * (outer + inner)
        })
    }
}

/// Area-weighted mean radius of the ring from `inner` to `outer`, mm.
pub fn mean_radius(inner: f64, outer: f64) -> f64 {
    2.0 / 3.0 * (inner * inner + inner * outer + outer * outer) / (inner + outer)
}

/// Exitance per incident power against distance from the beam, one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct RadialProfile {
    /// Name of the channel: `R`, `G`, `B`, `Y` or a wavelength.
    pub channel: String,
    /// The points, by increasing radius.
    pub points: Vec<ProfilePoint>,
}

/// Total diffuse reflectance of one channel inside a circle about the beam.
#[derive(Clone, Debug, PartialEq)]
pub struct TotalReflectance {
    /// Name of the channel, as in its profile.
    pub channel: String,
    /// Exitance per incident power inside the circle, the specular part left out.
    pub total_reflectance: f64,
    /// Standard uncertainty that the total has for itself, the shared scale left out.
    pub u_total_reflectance: f64,
    /// Radius of the circle, mm; `None` for the whole plane.
    pub radius_max_mm: Option<f64>,
    /// Relative standard uncertainty of the scale that the total and every point of the profile
    /// share: the white reference.
    pub u_scale_relative: f64,
    /// Standard uncertainty of an even light that every point of the profile has or lacks, mm⁻²,
    /// and the total with them: stray light, and what darks leave. 0 where there are no pixels.
    pub u_offset_per_mm2: f64,
}
