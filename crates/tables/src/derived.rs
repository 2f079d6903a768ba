//! What follows from a row of a table.

use physics::{DiffuseFresnel, ReducedMedium, dipole};

/// Lengths, albedo and total of a medium, which readers of a table look for beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derived {
    /// Transport mean free path 1/σₜ′, mm.
    pub mean_free_path_mm: f64,
    /// Diffusion length 1/σₜᵣ, mm, over which the glow falls far out; `None` where nothing
    /// absorbs and it has no end.
    pub diffusion_length_mm: Option<f64>,
    /// Reduced albedo α′.
    pub albedo_prime: f64,
    /// Total diffuse reflectance per power that enters, of the dipole.
    pub total_reflectance: f64,
    /// Albedo under diffuse light of a half-space with this α′ and without a surface that reflects
    /// ([`albedo_without_surface`]).
    pub albedo_without_surface: f64,
}

/// The albedo of a half-space that scatters isotropically with single-scattering albedo `albedo`,
/// under diffuse light and without a surface that reflects: what renderers call the colour of
/// subsurface scattering, and turn back into an albedo.
///
/// Van de Hulst's fit to the exact solution (*Multiple Light Scattering*, 1980), in the similarity
/// parameter s = √(1 - albedo); within 0.0021 of it.
pub fn albedo_without_surface(albedo: f64) -> f64 {
    let s = (1.0 - albedo).max(0.0).sqrt();
    (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)
}

/// The derived quantities of `medium`, its total with F_dr by `fresnel`.
///
/// ```
/// use physics::{DiffuseFresnel, ReducedMedium};
///
/// let marble = ReducedMedium { sigma_a: 0.0041, sigma_s_prime: 2.62, eta: 1.5 };
/// let derived = tables::derived(&marble, DiffuseFresnel::Exact);
/// assert!((derived.mean_free_path_mm - 0.381).abs() < 5e-4);
/// ```
pub fn derived(medium: &ReducedMedium, fresnel: DiffuseFresnel) -> Derived {
    let c = medium.coefficients();
    Derived {
        mean_free_path_mm: c.sigma_t_prime().recip(),
        diffusion_length_mm: (c.sigma_tr() > 0.0).then(|| c.sigma_tr().recip()),
        albedo_prime: c.albedo_prime(),
        total_reflectance: dipole::total_reflectance(c.albedo_prime(), fresnel.a(medium.eta)),
        albedo_without_surface: albedo_without_surface(c.albedo_prime()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marble_as_the_field_notes_give_it() {
        let table = [
            (2.19, 0.0021, 0.456, 8.51, 0.830),
            (2.62, 0.0041, 0.381, 5.57, 0.791),
            (3.00, 0.0071, 0.333, 3.95, 0.753),
        ];
        for (sigma_s_prime, sigma_a, free_path, length, total) in table {
            let medium = ReducedMedium {
                sigma_a,
                sigma_s_prime,
                eta: 1.5,
            };
            // Half a unit in the last place of the notes; neither F_dr leaves it.
            for fresnel in [DiffuseFresnel::RationalFit, DiffuseFresnel::Exact] {
                let found = derived(&medium, fresnel);
                assert!(
                    (found.mean_free_path_mm - free_path).abs() <= 5e-4,
                    "{found:?}"
                );
                assert!(
                    (found.diffusion_length_mm.unwrap() - length).abs() <= 5e-3,
                    "{found:?}"
                );
                assert!((found.total_reflectance - total).abs() <= 5e-4, "{found:?}");
                let albedo = sigma_s_prime / (sigma_s_prime + sigma_a);
                assert!((found.albedo_prime - albedo).abs() < 1e-15, "{found:?}");
            }
        }
    }

    #[test]
    fn a_white_that_absorbs_nothing_glows_without_end() {
        let white = ReducedMedium {
            sigma_a: 0.0,
            sigma_s_prime: 11.6,
            eta: 1.3,
        };
        let found = derived(&white, DiffuseFresnel::Exact);
        assert_eq!(
            (found.diffusion_length_mm, found.total_reflectance),
            (None, 1.0)
        );
    }
}
