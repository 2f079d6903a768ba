//! What can keep a picture from having a profile.

use thiserror::Error;

/// A picture, or an option, of which no profile can be made.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ProfileError {
    /// A channel does not hold the pixels that the picture's size says.
    #[error(
        "channel holds {values} values and {variances} variances, the picture has {pixels} pixels"
    )]
    Size {
        /// Values in the channel.
        values: usize,
        /// Variances in the channel.
        variances: usize,
        /// Width times height.
        pixels: usize,
    },
    /// A pixel is not a number with a variance.
    #[error(
        "pixel ({x}, {y}) holds {value} with variance {variance}, expected a finite value and a \
         variance of at least 0 (infinite where nothing was measured)"
    )]
    Pixel {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// Its value.
        value: f32,
        /// Its variance.
        variance: f32,
    },
    /// The scale of the picture is not positive and finite.
    #[error("mm_per_pixel must be above 0 mm and finite, got {0} mm")]
    MmPerPixel(f64),
    /// Four points that are no quadrilateral.
    #[error(
        "corners_{0} are not the corners of a convex quadrilateral, in order around it: expected \
         four [x, y], no three in line, and both lists in the same order"
    )]
    Corners(&'static str),
    /// Nine numbers that map no picture to a surface.
    #[error("the map from pixels to the surface is none: its nine numbers have no inverse")]
    View,
    /// The surface ends in the picture.
    #[error(
        "the corners put the horizon of the surface into the picture: expected that all of it \
         shows the surface; check corners_px and corners_mm"
    )]
    Horizon,
    /// An option is out of its range.
    #[error("{name} must be {expected}, got {found}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it was.
        found: f64,
    },
    /// The rings of a white reference show no beam.
    #[error(
        "the profile of the white reference shows no beam: expected rings from the centre outward \
         that fall to half of their peak well inside the picture"
    )]
    NoBeam,
    /// Nothing in the picture stands out of the noise.
    #[error(
        "no beam spot: the brightest place, at ({x:.1}, {y:.1}) px, holds {peak} with a standard \
         uncertainty of {u}"
    )]
    NoSpot {
        /// Column of the brightest place, px.
        x: f64,
        /// Row of the brightest place, px.
        y: f64,
        /// Its value over a few pixels, in the unit of the picture.
        peak: f64,
        /// The standard uncertainty of that.
        u: f64,
    },
    /// No pixel was measured at all.
    #[error("empty picture: not one of its {0} pixels was measured")]
    Empty(usize),
    /// The spot is off the picture or too near to its edge.
    #[error(
        "the beam spot at ({x:.1}, {y:.1}) px is off the picture of {width} x {height} px or too \
         near to its edge: {needed} px must be free around its centre"
    )]
    SpotAtEdge {
        /// Column of the spot, px.
        x: f64,
        /// Row of the spot, px.
        y: f64,
        /// Width of the picture, px.
        width: usize,
        /// Height of the picture, px.
        height: usize,
        /// What must be free around the centre, px.
        needed: f64,
    },
    /// A ring holds no pixel that was measured.
    #[error(
        "no pixel between {inner_mm:.4} and {outer_mm:.4} mm from the spot was measured: \
         the shortest exposure saturates there, so that the total is unknown; add a shorter one"
    )]
    UnmeasuredRing {
        /// Inner edge of the ring, mm.
        inner_mm: f64,
        /// Outer edge of the ring, mm.
        outer_mm: f64,
    },
    /// More light leaves the sample than the reference says came in.
    #[error(
        "the reference is darker than the sample: the sample sums to {sample_sum:.6e}, and by \
         this reference a surface that reflects all light sums to {white_sum:.6e}; are sample \
         and reference swapped, or their beams or exposures different?"
    )]
    ReferenceDarker {
        /// Sum of the sample inside the largest circle, in the unit of its picture.
        sample_sum: f64,
        /// Sum that total reflection of the incident light would have, in the same unit.
        white_sum: f64,
    },
    /// The reference's own light sums to nothing.
    #[error("the reference sums to {0:e}, expected more than nothing: is its beam blocked?")]
    DarkReference(f64),
}
