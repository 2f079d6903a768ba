//! A photon at a boundary between layers, or between the medium and an outside.

use physics::LayeredMedium;
use physics::fresnel;

/// What becomes of a photon at a boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Meeting {
    /// It stays in its layer and turns back.
    Reflected,
    /// It enters another layer.
    Entered {
        /// The layer.
        layer: usize,
        /// Cosine of its direction there, at least 0.
        cos: f64,
        /// By how much the components along the boundary shrink.
        along: f64,
    },
    /// It leaves the medium.
    Left {
        /// Whether on the lit side.
        side: Side,
        /// Cosine of its direction outside.
        cos: f64,
    },
}

/// A side on which light leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The lit one: reflectance.
    Above,
    /// The far one: transmittance.
    Below,
}

/// Decides by the uniform number `xi`, in [0, 1), what becomes of a photon of `layer` that meets
/// its upper or lower boundary at the cosine `cos` > 0.
pub(crate) fn meet(medium: &LayeredMedium, layer: usize, down: bool, cos: f64, xi: f64) -> Meeting {
    let next = if down {
        (layer + 1 < medium.layers.len()).then_some(layer + 1)
    } else {
        layer.checked_sub(1)
    };
    let (side, outside) = if down {
        (Side::Below, medium.eta_below)
    } else {
        (Side::Above, medium.eta_above)
    };
    let near = medium.layers[layer].eta;
    let far = next.map_or(outside, |next| medium.layers[next].eta);

    let cos = cos.min(1.0);
    let cos = if near == far {
        cos
    } else {
        let eta_ti = far / near;
        let refracted = fresnel::refracted_cos(eta_ti, cos);
        match refracted {
            Some(refracted) if xi >= fresnel::reflectance(eta_ti, cos) => refracted,
            _ => return Meeting::Reflected,
        }
    };
    match next {
        Some(layer) => Meeting::Entered {
            layer,
            cos,
            along: near / far,
        },
        None => Meeting::Left { side, cos },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Medium;

    fn glass() -> LayeredMedium {
        LayeredMedium::half_space(&Medium {
            sigma_a: 1.0,
            sigma_s: 1.0,
            g: 0.0,
            eta: 1.5,
        })
    }

    #[test]
    fn the_share_that_leaves_is_fresnels() {
        // Normal incidence: ((1.5 − 1)/(1.5 + 1))² = 0.04.
        assert_eq!(meet(&glass(), 0, false, 1.0, 0.0399), Meeting::Reflected);
        let left = Meeting::Left {
            side: Side::Above,
            cos: 1.0,
        };
        assert_eq!(meet(&glass(), 0, false, 1.0, 0.0401), left);
    }

    #[test]
    fn beyond_the_critical_angle_nothing_leaves() {
        // sin θ_c = 1/1.5, cos θ_c = 0.745.
        assert_eq!(
            meet(&glass(), 0, false, 0.74, 0.999_999),
            Meeting::Reflected
        );
        let Meeting::Left { cos, .. } = meet(&glass(), 0, false, 0.75, 0.999_999) else {
            panic!("stayed");
        };
        let sine = 1.5 * (1.0_f64 - 0.75 * 0.75).sqrt();
        assert!(
            (cos * cos + sine * sine - 1.0).abs() < 1e-14,
            "Snell: {cos}"
        );
    }

    #[test]
    fn equal_indices_let_everything_pass() {
        let mut medium = glass();
        let mut first = medium.layers[0].clone();
        first.thickness_mm = Some(1.0);
        medium.layers.insert(0, first);
        let entered = Meeting::Entered {
            layer: 1,
            cos: 0.1,
            along: 1.0,
        };
        assert_eq!(meet(&medium, 0, true, 0.1, 0.0), entered);
    }
}
