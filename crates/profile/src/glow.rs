//! Where the diffuse glow is centred, which under an oblique beam is not where the beam enters.

use crate::error::ProfileError;
use crate::radial::ProfileOptions;
use crate::survey::Survey;
use physics::ChannelMap;

/// Rounds in which the rings follow the glow.
const ROUNDS: usize = 8;

/// Step, px, below which nothing more is to be gained.
const SETTLED_PX: f64 = 1e-3;

/// The centre of a glow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlowCenter {
    /// Where it is, px.
    pub px: [f64; 2],
    /// Standard uncertainty along each axis of the surface, mm.
    pub u_mm: [f64; 2],
    /// From the point about which the search began, mm along the axes of the surface.
    pub displacement_mm: [f64; 2],
}

/// The point about which the light between the radii `from_mm` and `to_mm` is round.
///
/// A glow displaced by δ differs from its rings' mean by −R′(r) δ·r/r: δ is the least-squares
/// solution over all pixels in between, each with its variance, and the rings move along until
/// nothing is left. The search starts at `options.center_px`, or at the bright spot.
///
/// # Errors
///
/// As [`crate::radial_profile`]; [`ProfileError::NoSpot`] where the rings have no slope to go by.
///
/// # Source
///
/// Under a beam at θ the glow is centred sin θ′/(σₛ′ + 0.35 σₐ) from the point of entry, θ′ the
/// refracted angle: Wang and Jacques, *Use of a laser beam with an oblique angle of incidence to
/// measure the reduced scattering coefficient of a turbid medium*, Appl. Opt. 34 (1995).
pub fn glow_center(
    channel: &ChannelMap,
    width: usize,
    height: usize,
    options: &ProfileOptions,
    (from_mm, to_mm): (f64, f64),
) -> Result<GlowCenter, ProfileError> {
    let view = &options.view;
    let mut now = *options;
    let mut start = None;
    let mut found = None;
    for _ in 0..ROUNDS {
        let survey = Survey::new(channel, width, height, &now)?;
        let center = survey.center;
        let origin = view.at_mm(center);
        let start = *start.get_or_insert(origin);
        let (mut matrix, mut side, mut squares, mut count) = ([[0.0; 2]; 2], [0.0; 2], 0.0, 0.0);
        survey.for_each_pixel(channel, (width, height), |p| {
            let (middle, half) = survey.rings.square(p.ring);
            let radius = (middle + half * p.tau).max(0.0).sqrt();
            let radius_mm = radius * survey.unit_mm;
            let residual = p.value - survey.curve.at(p.ring, p.tau);
            if !((from_mm..to_mm).contains(&radius_mm)
                && p.variance > 0.0
                && survey.limits[p.ring].allows(residual, p.variance))
            {
                return;
            }
            let [x, y] = view.at_mm([(p.index % width) as f64, (p.index / width) as f64]);
            // dτ/dr = 2r/half, in units of a pixel at the centre.
            let slope = survey.curve.slope(p.ring, p.tau) * 2.0 * radius / half / survey.unit_mm;
            let gradient = [x - origin[0], y - origin[1]].map(|d| -slope * d / radius_mm);
            let weight = 1.0 / p.variance;
            count += 1.0;
            squares += weight * residual * residual;
            for (i, a) in gradient.iter().enumerate() {
                side[i] += weight * a * residual;
                for (j, b) in gradient.iter().enumerate() {
                    matrix[i][j] += weight * a * b;
                }
            }
        });
        let [[a, b], [_, d]] = matrix;
        let determinant = a * d - b * b;
        if count < 100.0 || determinant <= 1e-6 * a * d {
            let ([x, y], peak, u) = (center, 0.0, 0.0);
            return Err(ProfileError::NoSpot { x, y, peak, u });
        }
        let step = [
            (d * side[0] - b * side[1]) / determinant,
            (a * side[1] - b * side[0]) / determinant,
        ];
        let here = [origin[0] + step[0], origin[1] + step[1]];
        let px = view.at_px(here);
        // What is not round scatters more than its noise.
        let scatter = (squares / count).max(1.0).sqrt();
        found = Some(GlowCenter {
            px,
            u_mm: [d, a].map(|other| scatter * (other / determinant).sqrt()),
            displacement_mm: [here[0] - start[0], here[1] - start[1]],
        });
        now.center_px = Some(px);
        if (px[0] - center[0]).hypot(px[1] - center[1]) < SETTLED_PX {
            break;
        }
    }
    found.ok_or(ProfileError::Empty(width * height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::View;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    /// A glow about `glow` with a bright spot about `entry`, px, and photon noise.
    fn picture(entry: [f64; 2], glow: [f64; 2], view: &View, seed: u64) -> ChannelMap {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (entry, glow) = (view.at_mm(entry), view.at_mm(glow));
        let mut variance = vec![];
        let value = (0..200 * 200)
            .map(|i| {
                let [x, y] = view.at_mm([(i % 200) as f64, (i / 200) as f64]);
                let spot = (x - entry[0]).hypot(y - entry[1]) / 0.25;
                let r = (x - glow[0]).hypot(y - glow[1]);
                let light = 5.0 * (-0.5 * spot * spot).exp() + (1.0 + r * r).powf(-1.5);
                let u = (1e-6 + 1e-5 * light).sqrt();
                variance.push((u * u) as f32);
                let noise: f64 = rng.sample(StandardNormal);
                (light + u * noise) as f32
            })
            .collect();
        ChannelMap {
            name: "Y".to_owned(),
            value,
            variance,
        }
    }

    #[test]
    fn the_glow_is_found_beside_the_entry_and_u_is_true() {
        let (entry, glow) = ([97.3, 101.2], [102.4, 98.9]);
        let tilted = {
            let px = [[0.0, 0.0], [199.0, 0.0], [199.0, 199.0], [0.0, 199.0]];
            let mm = [[-5.4, -6.0], [5.4, -6.0], [4.6, 5.0], [-4.6, 5.0]];
            View::corners(&px, &mm).unwrap()
        };
        for view in [View::square(0.05), tilted] {
            let pictures = 12;
            let mut square = 0.0;
            let truth = view.at_mm(glow);
            for seed in 0..pictures {
                let map = picture(entry, glow, &view, seed);
                let options = ProfileOptions {
                    view,
                    ..ProfileOptions::default()
                };
                let found = glow_center(&map, 200, 200, &options, (1.3, 4.0)).unwrap();
                let at = view.at_mm(found.px);
                let off = [at[0] - truth[0], at[1] - truth[1]];
                assert!(off[0].hypot(off[1]) < 0.02, "{found:?}: off by {off:?} mm");
                square += (off[0] / found.u_mm[0]).powi(2) + (off[1] / found.u_mm[1]).powi(2);
                // The glow, a fifth as bright as the spot, draws the bright part its way a little.
                let [x, y] = crate::find_center(&map, 200, 200).unwrap();
                assert!((x - entry[0]).hypot(y - entry[1]) < 1.0, "{x}, {y}");
            }
            let reduced = square / (2 * pictures) as f64;
            println!("{reduced:.2}");
            // Four standard deviations of χ² over 24.
            assert!(
                (reduced - 1.0).abs() < 4.0 * (1.0_f64 / pictures as f64).sqrt(),
                "{reduced}"
            );
        }
    }
}
