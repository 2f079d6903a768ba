//! Light that scatters exactly once in a stack of layers: the model of Hanrahan and Krueger.

use crate::brdf::Directions;
use crate::fresnel;
use crate::layered::{InvalidLayers, LayeredMedium};
use crate::phase::PhaseFunction;
use gauss_quad::GaussLegendre;
use std::f64::consts::PI;
use std::num::NonZeroUsize;

/// Which reflections inside the stack unscattered light is followed through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reflections {
    /// None: down to the scattering and straight out again. The paper's section 5.1.
    None,
    /// All orders at every surface: exact for light that scatters once.
    All,
}

/// Share of draws of directions that follow the cosine and not a phase function.
const COSINE_SHARE: f64 = 0.25;

/// Unscattered light inside every layer, for light that falls in from above with unit irradiance.
#[derive(Clone, Debug)]
struct Beams {
    layers: Vec<Beam>,
    /// Share reflected without scattering.
    reflectance: f64,
    /// Share transmitted without scattering.
    transmittance: f64,
}

/// Unscattered light in one layer.
#[derive(Clone, Copy, Debug, Default)]
struct Beam {
    /// Cosine inside, between direction and normal; 0 where light of this angle is turned back
    /// above.
    cos: f64,
    /// Irradiance of the light on its way down, just below the layer's top.
    down: f64,
    /// Irradiance of the light on its way up, just above the layer's bottom.
    up: f64,
}

impl Beams {
    /// `cos` is measured above the stack, in (0, 1].
    fn new(medium: &LayeredMedium, cos: f64, reflections: Reflections) -> Self {
        let sine2 = medium.eta_above.powi(2) * (1.0 - cos) * (1.0 + cos);
        let inside = |eta: f64| {
            let sin2 = sine2 / (eta * eta);
            (sin2 < 1.0).then(|| (1.0 - sin2).sqrt())
        };
        let count = medium.layers.len();
        let cosines: Vec<Option<f64>> = medium.layers.iter().map(|l| inside(l.eta)).collect();
        // How many layers light of this angle reaches at all.
        let reached = cosines.iter().take_while(|cos| cos.is_some()).count();
        let eta = |k: usize| medium.layers.get(k).map_or(medium.eta_below, |l| l.eta);
        let endless = medium
            .layers
            .last()
            .is_some_and(|l| l.thickness_mm.is_none());

        // From the last surface up; surface k lies on layer k.
        let mut lower = vec![0.0; count];
        let mut passes = vec![0.0; count + 1];
        // What lies below the surface in hand reflects so much, seen from just below it.
        let mut beyond = 0.0;
        for k in (0..=reached).rev() {
            let (near_eta, near_cos) = match k.checked_sub(1) {
                None => (medium.eta_above, cos),
                Some(above) => (
                    medium.layers[above].eta,
                    cosines[above].expect("`reached` counts those with a cosine"),
                ),
            };
            let surface = if k == count && endless {
                0.0
            } else {
                fresnel::reflectance(eta(k) / near_eta, near_cos)
            };
            let echo = match reflections {
                Reflections::None => 1.0,
                Reflections::All => 1.0 / (1.0 - surface * beyond),
            };
            passes[k] = (1.0 - surface) * echo;
            let sum = surface + (1.0 - surface).powi(2) * beyond * echo;
            let Some(above) = k.checked_sub(1) else {
                beyond = sum;
                break;
            };
            let once = (-medium.layers[above].optical_thickness() / near_cos).exp();
            (lower[above], beyond) = match reflections {
                Reflections::None => (0.0, 0.0),
                Reflections::All => (sum, sum * once * once),
            };
        }
        let mut beams = vec![Beam::default(); count];
        let mut down = 1.0;
        for (k, beam) in beams.iter_mut().enumerate().take(reached) {
            down *= passes[k];
            let cos = cosines[k].expect("`reached` counts those with a cosine");
            let once = (-medium.layers[k].optical_thickness() / cos).exp();
            *beam = Beam {
                cos,
                down,
                up: down * once * lower[k],
            };
            down *= once;
        }
        let through = reached == count && inside(medium.eta_below).is_some();
        Self {
            layers: beams,
            reflectance: beyond,
            transmittance: if through { down * passes[count] } else { 0.0 },
        }
    }
}

/// Share of light of one angle that a stack reflects and transmits without scattering it, all
/// orders of reflection between its surfaces, incoherent; `cos` outside, in (0, 1].
///
/// ```
/// use physics::{Layer, LayeredMedium, Phase, first_order::unscattered};
///
/// // A clear pane: R = 2F/(1 + F), T = 1 − R.
/// let glass = Layer {
///     sigma_a: 0.0, sigma_s: 0.0, phase: Phase::ISOTROPIC, eta: 1.5, thickness_mm: Some(1.0),
/// };
/// let pane = LayeredMedium { layers: vec![glass], eta_above: 1.0, eta_below: 1.0 };
/// let (reflected, transmitted) = unscattered(&pane, 1.0);
/// assert!((reflected - 0.08 / 1.04).abs() < 1e-15);
/// assert!((transmitted + reflected - 1.0).abs() < 1e-15);
/// ```
pub fn unscattered(medium: &LayeredMedium, cos: f64) -> (f64, f64) {
    let beams = Beams::new(medium, cos, Reflections::All);
    (beams.reflectance, beams.transmittance)
}

/// Subsurface BRDF and BTDF of light that scatters once, of a stack of plane layers with smooth
/// surfaces. Per unit of irradiance that falls on the surface; the Fresnel factors, refraction,
/// the n² of radiance, attenuation in the layers above and the chosen reflections are in it.
///
/// # Source
///
/// Hanrahan and Krueger (1993), section 5.1, with the factor that the change of solid angle asks
/// for (1/η² for one layer in air) and with the phase function taken at the refracted angles.
/// Light that surfaces reflect on its way follows from the same integral: before the scattering it
/// is a beam down and a beam up, and by reciprocity the same after it.
#[derive(Clone, Debug)]
pub struct FirstOrder {
    medium: LayeredMedium,
    /// The same stack upside down, where it has a lower side.
    flipped: Option<LayeredMedium>,
    reflections: Reflections,
}

impl FirstOrder {
    /// The stack `medium`.
    ///
    /// # Errors
    ///
    /// [`InvalidLayers`] names what is wrong with the layers.
    pub fn new(medium: LayeredMedium, reflections: Reflections) -> Result<Self, InvalidLayers> {
        let medium = medium.validated()?;
        let endless = medium
            .layers
            .last()
            .is_some_and(|l| l.thickness_mm.is_none());
        let flipped = (!endless).then(|| LayeredMedium {
            layers: medium.layers.iter().rev().cloned().collect(),
            eta_above: medium.eta_below,
            eta_below: medium.eta_above,
        });
        Ok(Self {
            medium,
            flipped,
            reflections,
        })
    }

    /// Subsurface BRDF f_r,v⁽¹⁾, sr⁻¹.
    pub fn brdf(&self, directions: &Directions) -> f64 {
        let light = Beams::new(&self.medium, directions.cos_in, self.reflections);
        let view = Beams::new(&self.medium, directions.cos_out, self.reflections);
        let view = view.layers.iter().map(|beam| (*beam, beam.down, beam.up));
        self.once(&light.layers, view, directions) * self.medium.eta_above.powi(2)
    }

    /// Subsurface BTDF f_t,v⁽¹⁾, sr⁻¹: `cos_out` is measured behind the stack, and `cos_azimuth`
    /// is 1 for light that keeps its way along the surface. 0 for a stack without a lower side.
    pub fn btdf(&self, directions: &Directions) -> f64 {
        let Some(flipped) = &self.flipped else {
            return 0.0;
        };
        let light = Beams::new(&self.medium, directions.cos_in, self.reflections);
        let view = Beams::new(flipped, directions.cos_out, self.reflections);
        // Seen from above, what went down in the flipped stack goes up.
        let view = view.layers.iter().rev();
        let view = view.map(|beam| (*beam, beam.up, beam.down));
        self.once(&light.layers, view, directions) * self.medium.eta_below.powi(2)
    }

    /// Share of unscattered light that is reflected and transmitted, as a specular peak.
    pub fn unscattered(&self, cos_in: f64) -> (f64, f64) {
        let beams = Beams::new(&self.medium, cos_in, self.reflections);
        (beams.reflectance, beams.transmittance)
    }

    /// Share of light that falls in with `cos_in` and leaves on the lit side after scattering once,
    /// and the same for the far side, by Gauss's rule over the hemisphere.
    pub fn albedo(&self, cos_in: f64) -> (f64, f64) {
        let rule = GaussLegendre::new(NonZeroUsize::new(64).expect("64 is not zero"));
        let hemisphere = |f: &dyn Fn(&Directions) -> f64| {
            rule.integrate(0.0, 1.0, |cos_out| {
                let ring = rule.integrate(0.0, PI, |azimuth: f64| {
                    f(&Directions {
                        cos_in,
                        cos_out,
                        cos_azimuth: azimuth.cos(),
                    })
                });
                2.0 * cos_out * ring
            })
        };
        (hemisphere(&|d| self.brdf(d)), hemisphere(&|d| self.btdf(d)))
    }

    /// Σ over layers and over the two ways of light before and after the scattering, without the
    /// n² of the outside. Each beam of `view` comes with what it has at the layer's top and at
    /// its bottom; it travels against the light that is seen.
    fn once(
        &self,
        light: &[Beam],
        view: impl Iterator<Item = (Beam, f64, f64)>,
        directions: &Directions,
    ) -> f64 {
        let layers = self.medium.layers.iter().zip(light).zip(view);
        layers
            .filter(|((layer, light), (view, _, _))| {
                layer.sigma_s > 0.0 && light.cos > 0.0 && view.cos > 0.0
            })
            .map(|((layer, light), (view, at_top, at_bottom))| {
                let tau = layer.optical_thickness();
                let (x, y) = (tau / light.cos, tau / view.cos);
                let along = light.cos * view.cos;
                let sines2 = (1.0 - light.cos.powi(2)) * (1.0 - view.cos.powi(2));
                let across = sines2.max(0.0).sqrt() * directions.cos_azimuth;
                // Beams that fade the same way belong to light that the scattering turns back.
                let turned =
                    layer.phase.density(across - along) * together(light.cos, view.cos, x + y);
                let kept = layer.phase.density(across + along) * against(along, tau, x, y);
                let (down, up) = (light.down, light.up);
                let ways = turned * (down * at_top + up * at_bottom)
                    + kept * (down * at_bottom + up * at_top);
                layer.albedo() * ways / layer.eta.powi(2)
            })
            .sum()
    }

    /// Draws a direction of reflected light for light that falls in with `cos_in`, from three
    /// numbers in [0, 1): by the phase functions of the layers, and a quarter of the time by the
    /// cosine alone, so that every direction is reached.
    ///
    /// `None` where the light of the draw goes down, or is turned back by a surface: such draws
    /// count as draws of nothing, and [`Self::reflection_density`] integrates to less than 1 by
    /// their share.
    pub fn sample_reflection(&self, cos_in: f64, xi: [f64; 3]) -> Option<Directions> {
        self.sample(cos_in, xi, -1.0, self.medium.eta_above)
    }

    /// The same for transmitted light.
    pub fn sample_transmission(&self, cos_in: f64, xi: [f64; 3]) -> Option<Directions> {
        self.flipped.as_ref()?;
        self.sample(cos_in, xi, 1.0, self.medium.eta_below)
    }

    /// Density of [`Self::sample_reflection`], sr⁻¹.
    pub fn reflection_density(&self, directions: &Directions) -> f64 {
        self.density(directions, -1.0, self.medium.eta_above)
    }

    /// Density of [`Self::sample_transmission`], sr⁻¹; 0 for a stack without a lower side.
    pub fn transmission_density(&self, directions: &Directions) -> f64 {
        match self.flipped {
            Some(_) => self.density(directions, 1.0, self.medium.eta_below),
            None => 0.0,
        }
    }

    /// Share of the draws, and cosine inside, of each layer: as much as light on its way down
    /// scatters there. The last entry is the share of the cosine lobe.
    fn lobes(&self, cos_in: f64) -> (Vec<(f64, f64)>, f64) {
        let beams = Beams::new(&self.medium, cos_in, Reflections::None);
        let mut lobes: Vec<(f64, f64)> = self
            .medium
            .layers
            .iter()
            .zip(&beams.layers)
            .map(|(layer, beam)| {
                if beam.cos == 0.0 {
                    return (0.0, 1.0);
                }
                let met = -(-layer.optical_thickness() / beam.cos).exp_m1();
                (layer.albedo() * beam.down * met, beam.cos)
            })
            .collect();
        let sum: f64 = lobes.iter().map(|lobe| lobe.0).sum();
        if sum == 0.0 {
            return (lobes, 1.0);
        }
        for lobe in &mut lobes {
            lobe.0 *= (1.0 - COSINE_SHARE) / sum;
        }
        (lobes, COSINE_SHARE)
    }

    /// `down` is 1 for light that leaves through the bottom, −1 through the top.
    fn sample(&self, cos_in: f64, xi: [f64; 3], down: f64, eta_out: f64) -> Option<Directions> {
        let (lobes, cosine) = self.lobes(cos_in);
        let [mut choice, first, second] = xi;
        let turn = 2.0 * PI * second;
        if choice < cosine {
            return Some(Directions {
                cos_in,
                cos_out: (1.0 - first).sqrt(),
                cos_azimuth: turn.cos(),
            });
        }
        choice -= cosine;
        for (layer, (share, mu)) in self.medium.layers.iter().zip(lobes) {
            if choice >= share {
                choice -= share;
                continue;
            }
            let v = layer.phase.one_minus_cos(first);
            let (cos, sin) = (1.0 - v, (v * (2.0 - v)).max(0.0).sqrt());
            let sin_in = (1.0 - mu * mu).sqrt();
            // The light that falls in travels along (sin_in, 0, mu), z downward.
            let x = cos * sin_in + sin * turn.cos() * mu;
            let y = sin * turn.sin();
            let z = (cos * mu - sin * turn.cos() * sin_in) * down;
            let along = x.hypot(y);
            let sin_out = along * layer.eta / eta_out;
            if z <= 0.0 || sin_out >= 1.0 {
                return None;
            }
            return Some(Directions {
                cos_in,
                cos_out: (1.0 - sin_out * sin_out).sqrt(),
                cos_azimuth: if along > 0.0 { x / along } else { 1.0 },
            });
        }
        None
    }

    fn density(&self, directions: &Directions, down: f64, eta_out: f64) -> f64 {
        let Directions {
            cos_in,
            cos_out,
            cos_azimuth,
        } = *directions;
        let (lobes, cosine) = self.lobes(cos_in);
        let sin2_out = (1.0 - cos_out) * (1.0 + cos_out);
        let layers = self.medium.layers.iter().zip(lobes);
        let by_phase: f64 = layers
            .map(|(layer, (share, mu))| {
                let ratio = (eta_out / layer.eta).powi(2);
                let sin2 = sin2_out * ratio;
                if share == 0.0 || sin2 >= 1.0 {
                    return 0.0;
                }
                let inside = (1.0 - sin2).sqrt();
                let across = ((1.0 - mu * mu) * sin2).sqrt() * cos_azimuth;
                let density = layer.phase.density(across + down * mu * inside);
                // n² cos θ dω is what refraction keeps.
                share * density * ratio * cos_out / inside
            })
            .sum();
        by_phase + cosine * cos_out / PI
    }

    /// The layers.
    pub fn medium(&self) -> &LayeredMedium {
        &self.medium
    }
}

/// ∫ e^(−τ/μ) e^(−τ/μ′) dτ/(μμ′) over a layer of which both ways together see `sum`.
fn together(cos: f64, other: f64, sum: f64) -> f64 {
    -(-sum).exp_m1() / (cos + other)
}

/// ∫ e^(−τ/μ) e^(−(T−τ)/μ′) dτ/(μμ′), T the layer's `tau`, x = T/μ, y = T/μ′. The equal-angle limit
/// of the paper's BTDF is x = y.
fn against(product: f64, tau: f64, x: f64, y: f64) -> f64 {
    if tau.is_infinite() {
        return 0.0;
    }
    let (nearer, apart) = (x.min(y), (x - y).abs());
    let mean = if apart > 0.0 {
        -(-apart).exp_m1() / apart
    } else {
        1.0
    };
    tau * (-nearer).exp() * mean / product
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::tests::{argument, reference};
    use crate::layered::Layer;
    use crate::phase::Phase;

    fn slab(albedo: f64, tau: f64, g: f64, eta: f64) -> Layer {
        Layer {
            sigma_a: 1.0 - albedo,
            sigma_s: albedo,
            phase: Phase::HenyeyGreenstein { g },
            eta,
            thickness_mm: tau.is_finite().then_some(tau),
        }
    }

    fn stack(layers: Vec<Layer>, eta_below: f64) -> LayeredMedium {
        LayeredMedium {
            layers,
            eta_above: 1.0,
            eta_below,
        }
    }

    fn three() -> LayeredMedium {
        let glass = Layer {
            sigma_a: 0.01,
            sigma_s: 0.0,
            ..slab(0.5, 1.0, 0.0, 1.5)
        };
        let layers = vec![glass, slab(0.9, 0.5, 0.6, 1.33), slab(0.6, 2.0, -0.3, 1.4)];
        stack(layers, 1.1)
    }

    const DIRECTIONS: Directions = Directions {
        cos_in: 0.3,
        cos_out: 0.8,
        cos_azimuth: -0.2,
    };

    #[test]
    fn one_layer_agrees_with_forty_digits() {
        let rows = reference("hk_first_order_brdf");
        assert_eq!(rows.len(), 18);
        for (arguments, expected) in rows {
            let [albedo, tau, g, eta, cos_in, cos_out, cos_azimuth] =
                ["albedo", "tau", "g", "eta", "cos_i", "cos_o", "cos_dphi"]
                    .map(|name| argument(&arguments, name));
            let medium = stack(vec![slab(albedo, tau, g, eta)], 1.0);
            let model = FirstOrder::new(medium, Reflections::None).unwrap();
            let got = model.brdf(&Directions {
                cos_in,
                cos_out,
                cos_azimuth,
            });
            assert!(
                (got / expected - 1.0).abs() < 1e-12,
                "{arguments}: {got} for {expected}"
            );
        }
    }

    /// Without Fresnel and depth: α p μᵢ/(μᵢ + μᵣ) of the incident radiance, per irradiance
    /// α p/(μᵢ + μᵣ).
    #[test]
    fn seeligers_law_is_the_limit() {
        let medium = stack(vec![slab(0.7, f64::INFINITY, 0.0, 1.0)], 1.0);
        for reflections in [Reflections::None, Reflections::All] {
            let model = FirstOrder::new(medium.clone(), reflections).unwrap();
            let (got, expected) = (
                model.brdf(&DIRECTIONS),
                0.7 / (4.0 * PI) / (DIRECTIONS.cos_in + DIRECTIONS.cos_out),
            );
            assert!((got / expected - 1.0).abs() < 1e-12, "{got} for {expected}");
            assert_eq!(model.btdf(&DIRECTIONS), 0.0);
        }
    }

    #[test]
    fn is_reciprocal_with_the_squares_of_the_indices() {
        let back = Directions {
            cos_in: DIRECTIONS.cos_out,
            cos_out: DIRECTIONS.cos_in,
            ..DIRECTIONS
        };
        let medium = three();
        for reflections in [Reflections::None, Reflections::All] {
            let model = FirstOrder::new(medium.clone(), reflections).unwrap();
            let ratio = model.brdf(&DIRECTIONS) / model.brdf(&back);
            assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
            let flipped = LayeredMedium {
                layers: medium.layers.iter().rev().cloned().collect(),
                eta_above: medium.eta_below,
                eta_below: medium.eta_above,
            };
            let from_below = FirstOrder::new(flipped, reflections).unwrap();
            let there = model.btdf(&DIRECTIONS) / medium.eta_below.powi(2);
            let back = from_below.btdf(&back) / medium.eta_above.powi(2);
            assert!((there / back - 1.0).abs() < 1e-12, "{there} and {back}");
        }
    }

    /// Cut in two, a layer scatters as it did: what crosses the cut is in the beams.
    #[test]
    fn a_cut_changes_nothing() {
        let whole = stack(vec![slab(0.9, 1.5, 0.6, 1.4)], 1.2);
        let halves = vec![slab(0.9, 0.4, 0.6, 1.4), slab(0.9, 1.1, 0.6, 1.4)];
        for reflections in [Reflections::None, Reflections::All] {
            let [one, two] = [whole.clone(), stack(halves.clone(), 1.2)]
                .map(|medium| FirstOrder::new(medium, reflections).unwrap());
            for (one, two) in [
                (one.brdf(&DIRECTIONS), two.brdf(&DIRECTIONS)),
                (one.btdf(&DIRECTIONS), two.btdf(&DIRECTIONS)),
                (one.unscattered(0.4).0, two.unscattered(0.4).0),
                (one.unscattered(0.4).1, two.unscattered(0.4).1),
            ] {
                assert!((one / two - 1.0).abs() < 1e-12, "{one} and {two}");
            }
        }
    }

    /// L'Hospital's limit of the paper, and values close to it.
    #[test]
    fn equal_angles_are_a_limit() {
        let medium = stack(vec![slab(0.8, 0.7, 0.3, 1.0)], 1.0);
        let model = FirstOrder::new(medium, Reflections::None).unwrap();
        let at = |cos_out| {
            model.btdf(&Directions {
                cos_in: 0.6,
                cos_out,
                cos_azimuth: 0.5,
            })
        };
        let phase = Phase::HenyeyGreenstein { g: 0.3 }.density(0.64 * 0.5 + 0.36);
        let expected = 0.8 * phase * 0.7 / (0.6 * 0.6) * (-0.7_f64 / 0.6).exp();
        assert!((at(0.6) / expected - 1.0).abs() < 1e-13);
        for step in [1e-12, 1e-9, 1e-6] {
            let (near, h) = (at(0.6 + step), step);
            assert!(
                (near / at(0.6) - 1.0).abs() < 10.0 * h + 1e-12,
                "{step}: {near}"
            );
        }
    }

    /// Errata, Jensen no. 6: 0.00879 of normal light leaves after one event.
    #[test]
    fn the_energy_balance_closes() {
        let medium = stack(vec![slab(0.8, 1.0, 0.6, 1.33)], 1.33);
        let model = FirstOrder::new(medium, Reflections::None).unwrap();
        let (reflected, _) = model.albedo(1.0);
        assert!((reflected - 0.00879).abs() < 5e-6, "{reflected}");
    }

    /// Σ f cos θ/density over the draws is ∫ f cos θ dω: for the model itself, with less scatter
    /// than by the cosine alone, and for a constant, which every direction must be reached for.
    #[test]
    fn samples_follow_their_density() {
        let forward = stack(vec![slab(0.9, 2.0, 0.9, 1.0)], 1.0);
        for (medium, cos_in) in [(three(), 0.4), (forward, 0.1)] {
            let model = FirstOrder::new(medium, Reflections::All).unwrap();
            let (reflected, transmitted) = model.albedo(cos_in);
            let n = 200_000;
            // A low-discrepancy sequence: multiples of powers of the plastic number's kin.
            let at = |i: u32, step: f64| (0.5 + f64::from(i) * step).fract();
            let [mut sums, mut flat] = [[0.0; 2]; 2];
            let [mut squares, mut by_cosine] = [0.0; 2];
            for i in 1..=n {
                let xi = [
                    at(i, 0.819_172_513),
                    at(i, 0.671_043_606),
                    at(i, 0.549_700_477),
                ];
                let draws = [
                    model
                        .sample_reflection(cos_in, xi)
                        .map(|d| (model.brdf(&d), model.reflection_density(&d), d)),
                    model
                        .sample_transmission(cos_in, xi)
                        .map(|d| (model.btdf(&d), model.transmission_density(&d), d)),
                ];
                for (k, draw) in draws.into_iter().enumerate() {
                    let Some((f, density, d)) = draw else {
                        continue;
                    };
                    let weight = d.cos_out / density / f64::from(n);
                    sums[k] += f * weight;
                    if k == 0 {
                        // The same sum for draws by the cosine is ∫ f² cos θ π dω.
                        squares += f64::from(n) * (f * weight).powi(2);
                        by_cosine += PI * f * f * weight;
                    }
                    flat[k] += weight / PI;
                }
            }
            for (k, expected) in [reflected, transmitted].into_iter().enumerate() {
                let off = sums[k] / expected - 1.0;
                assert!(off.abs() < 5e-3, "{k}: {} for {expected}", sums[k]);
                assert!((flat[k] - 1.0).abs() < 5e-3, "{k}: {}", flat[k]);
            }
            if cos_in == 0.1 {
                let [ours, cosine] = [squares, by_cosine].map(|s| s / sums[0].powi(2) - 1.0);
                assert!(ours < 0.5 * cosine, "{ours} and {cosine}");
            }
        }
    }

    /// Beyond the critical angle of a lower layer light is turned back whole.
    #[test]
    fn total_reflection_inside_is_not_nan() {
        let medium = LayeredMedium {
            layers: vec![slab(0.9, 1.0, 0.2, 1.5), slab(0.9, 1.0, 0.2, 1.0)],
            eta_above: 1.5,
            eta_below: 1.0,
        };
        for reflections in [Reflections::None, Reflections::All] {
            let model = FirstOrder::new(medium.clone(), reflections).unwrap();
            for cos_in in [1e-6, 0.5, 0.745_355_992_499_929_9, 0.75, 1.0] {
                for cos_out in [1e-6, 0.3, 0.745_355_992_499_929_9, 1.0] {
                    let directions = Directions {
                        cos_in,
                        cos_out,
                        cos_azimuth: 1.0,
                    };
                    let (r, t) = (model.brdf(&directions), model.btdf(&directions));
                    assert!(r.is_finite() && r > 0.0 && t.is_finite() && t >= 0.0);
                }
            }
        }
    }
}
