//! Coefficients that vary over a surface.

use physics::Medium;

/// A picture of coefficients over a surface: repeated in both directions, and on a line between the
/// middles of its texels.
///
/// It says nothing of the inside: models of the surface can show it, volume transport cannot.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Texels of a row.
    pub width: usize,
    /// Rows, the first at the top.
    pub height: usize,
    /// How much of the texture coordinates the picture covers once: mm on flat shapes, 1 on balls
    /// and meshes ([`crate::Shape::texture_coordinates`]).
    pub size: [f64; 2],
    /// σₐ and σₛ of every texel, mm⁻¹, row by row; a list for each channel.
    pub texels: Vec<Vec<[f32; 2]>>,
}

impl Texture {
    /// `base` with the coefficients of a channel at texture coordinates.
    pub(crate) fn medium(&self, base: Medium, channel: usize, coordinates: [f64; 2]) -> Medium {
        let texels = &self.texels[channel];
        let [u, v] = [0, 1].map(|axis| coordinates[axis] / self.size[axis]);
        let place = |share: f64, count: usize| {
            let at = share.rem_euclid(1.0) * count as f64 - 0.5;
            let before = at.floor();
            let first = (before as isize).rem_euclid(count as isize) as usize;
            (first, (first + 1) % count, at - before)
        };
        let (left, right, x) = place(u, self.width);
        // Coordinates go up, rows go down.
        let (above, below, y) = place(1.0 - v, self.height);
        let of = |row: usize, column: usize| texels[row * self.width + column].map(f64::from);
        let line =
            |a: [f64; 2], b: [f64; 2], part: f64| [0, 1].map(|k| a[k] + part * (b[k] - a[k]));
        let row = |row: usize| line(of(row, left), of(row, right), x);
        let [sigma_a, sigma_s] = line(row(above), row(below), y);
        Medium {
            sigma_a,
            sigma_s,
            ..base
        }
    }

    /// The media of a channel's texels that are farthest apart: with the least and the greatest σₜ′
    /// and σₜᵣ and α′, each once.
    pub(crate) fn extremes(&self, base: Medium, channel: usize) -> Vec<Medium> {
        let measures: [fn(&Medium) -> f64; 3] = [
            |m| m.reduced().coefficients().sigma_t_prime(),
            |m| m.reduced().coefficients().sigma_tr(),
            |m| m.reduced().coefficients().albedo_prime(),
        ];
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        let mut found = [[None; 2]; 3];
        for texel in &self.texels[channel] {
            let [sigma_a, sigma_s] = texel.map(f64::from);
            let medium = Medium {
                sigma_a,
                sigma_s,
                ..base
            };
            for ((measure, ends), found) in measures.iter().zip(&mut ends).zip(&mut found) {
                let value = measure(&medium);
                if value < ends[0] {
                    (ends[0], found[0]) = (value, Some(medium));
                }
                if value > ends[1] {
                    (ends[1], found[1]) = (value, Some(medium));
                }
            }
        }
        let mut media: Vec<Medium> = vec![];
        for medium in found.into_iter().flatten().flatten() {
            if !media.contains(&medium) {
                media.push(medium);
            }
        }
        media
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: Medium = Medium {
        sigma_a: 9.0,
        sigma_s: 9.0,
        g: 0.5,
        eta: 1.4,
    };

    fn texture() -> Texture {
        Texture {
            width: 2,
            height: 2,
            size: [4.0, 2.0],
            texels: vec![vec![[1.0, 10.0], [2.0, 10.0], [3.0, 10.0], [4.0, 30.0]]],
        }
    }

    /// By hand: middles of texels are the texels, the rest is between them, also across the edge.
    #[test]
    fn a_texture_is_a_line_between_texels_and_repeats() {
        let texture = texture();
        for (u, v, sigma_a, sigma_s) in [
            // Middles: the first row is the upper one.
            (1.0, 1.5, 1.0, 10.0),
            (3.0, 1.5, 2.0, 10.0),
            (1.0, 0.5, 3.0, 10.0),
            (3.0, 0.5, 4.0, 30.0),
            // Between two, and between four.
            (1.5, 1.5, 1.25, 10.0),
            (2.0, 1.0, 2.5, 15.0),
            // Over the edge the picture begins again.
            (0.0, 1.5, 1.5, 10.0),
            (1.0, 0.0, 2.0, 10.0),
            (5.0, -0.5, 1.0, 10.0),
            (-1.0, 2.5, 4.0, 30.0),
        ] {
            let found = texture.medium(BASE, 0, [u, v]);
            let expected = Medium {
                sigma_a,
                sigma_s,
                ..BASE
            };
            assert_eq!(found, expected, "{u}, {v}");
        }
    }

    #[test]
    fn the_ends_of_a_texture_are_among_its_texels() {
        let ends = texture().extremes(BASE, 0);
        let sigma_a: Vec<f64> = ends.iter().map(|m| m.sigma_a).collect();
        // σₜ′ is 6, 7, 8, 19; σₜᵣ grows; α′ is 5/6, 5/7, 5/8, 15/19.
        assert_eq!(sigma_a, [1.0, 4.0, 3.0]);
    }
}
