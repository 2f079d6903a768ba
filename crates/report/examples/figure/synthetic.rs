//! Measurements that never happened: profiles of the dipole with the noise of a camera, fitted.

use fit::{Fit, FitOptions};
use physics::{
    Coefficients, DiffuseFresnel, Dipole, DipoleModel, ForwardModel, ProfilePoint, RadialProfile,
    ReducedMedium, TotalReflectance, profile::mean_radius,
};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use report::{ChannelReport, CurvePoint};
use std::f64::consts::PI;

/// A fitted channel with what a report needs of it.
pub(crate) struct Synthetic {
    pub(crate) truth: Coefficients,
    pub(crate) profile: RadialProfile,
    pub(crate) fit: Fit,
    pub(crate) model_curve: Vec<CurvePoint>,
    pub(crate) total_reflectance: f64,
}

impl Synthetic {
    pub(crate) fn report(&self) -> ChannelReport<'_> {
        ChannelReport {
            fit: &self.fit,
            profile: &self.profile,
            wavelength_nm: None,
            model_curve: self.model_curve.clone(),
            u_model_per_mm2: vec![],
            transport: vec![],
            total_reflectance: self.total_reflectance,
            monte_carlo: vec![],
            truth: Some(self.truth),
        }
    }
}

/// A picture of 20 mm about the beam, in rings as wide as a pixel or 4 %, of a medium with these
/// coefficients; its white reference is 0.4 % off.
pub(crate) fn channel(
    name: &str,
    truth: Coefficients,
    eta: f64,
    seed: u64,
) -> Result<Synthetic, fit::FitError> {
    const RADIUS: f64 = 20.0;
    let medium = ReducedMedium {
        sigma_a: truth.sigma_a,
        sigma_s_prime: truth.sigma_s_prime,
        eta,
    };
    let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
    let mut rng = Pcg64::seed_from_u64(seed);
    let (mut points, mut total, mut variance, mut inner) = (vec![], 0.0, 0.0, 0.0_f64);
    while inner < RADIUS {
        let outer = (inner + (0.04 * inner).max(0.04)).min(RADIUS);
        let area = PI * (outer - inner) * (outer + inner);
        let exact = 1.004 * (dipole.beyond(inner) - dipole.beyond(outer)) / area;
        // Photon noise and read noise of the pixels in the ring.
        let pixels = (area / 0.04_f64.powi(2)).max(1.0);
        let u = ((1e-4 * exact + 1e-8) / pixels).sqrt();
        let noise: f64 = StandardNormal.sample(&mut rng);
        let value = exact + u * noise;
        total += area * value;
        variance += area * area * u * u;
        points.push(ProfilePoint {
            ring_mm: Some((inner, outer)),
            radius_mm: mean_radius(inner, outer),
            reflectance_per_mm2: value,
            u_reflectance_per_mm2: u,
            pixels: Some(pixels as u64),
        });
        inner = outer;
    }
    let profile = RadialProfile {
        channel: name.to_owned(),
        points,
    };
    let total = TotalReflectance {
        channel: name.to_owned(),
        total_reflectance: total,
        u_total_reflectance: variance.sqrt(),
        radius_max_mm: Some(RADIUS),
        u_scale_relative: 0.005,
        u_offset_per_mm2: 0.0,
    };
    let model = DipoleModel::new(eta, DiffuseFresnel::Exact);
    let options = FitOptions {
        u_scale_relative: 0.005,
        ..FitOptions::default()
    };
    let fit = fit::fit(&profile, Some(&total), &model, &options)?;

    let radii: Vec<f64> = (0..=200)
        .map(|i| 0.02 * 1000f64.powf(f64::from(i) / 200.0))
        .collect();
    let mut values = vec![0.0; radii.len()];
    model.diffuse_reflectance(fit.coefficients(), &radii, &mut values);
    let model_curve = radii
        .iter()
        .zip(&values)
        .map(|(&radius_mm, value)| CurvePoint {
            radius_mm,
            reflectance_per_mm2: fit.scale * value,
        })
        .collect();
    let total_reflectance = model.within(fit.coefficients(), f64::INFINITY).value;
    Ok(Synthetic {
        truth,
        profile,
        fit,
        model_curve,
        total_reflectance,
    })
}
