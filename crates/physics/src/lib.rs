//! Light in translucent matter: the nouns that travel through beamspot, and the closed forms.
//!
//! This is the ground floor. It knows no files, no threads and no command line; every other crate
//! stands on it and none of its formulas is written twice.
//!
//! Every length is in mm and every coefficient in mm⁻¹.
//!
//! | module | holds |
//! |---|---|
//! | [`medium`] | what a photon meets ([`Medium`]) and what diffusion sees of it ([`ReducedMedium`]) |
//! | [`layered`] | [`LayeredMedium`]: plane layers, each with its index and phase function |
//! | [`fresnel`] | a smooth boundary: reflectance, its averages, the factors of entry and exit |
//! | [`phase`] | phase functions |
//! | [`dipole`] | the diffusion dipole of Jensen et al. (2001), its gradient, total and inverse |
//! | [`kienle_patterson`] | the dipole with flux and fluence, each with its weight |
//! | [`better_dipole`] | the same with Grosjean's diffusion coefficient |
//! | [`photon_beam_diffusion`] | sources along the whole beam, and single scattering as such |
//! | [`multipole`] | slabs: reflectance and transmittance |
//! | [`directional`] | a ray source, for oblique beams |
//! | [`brdf`] | the BSSRDF folded into a BRDF under uniform light |
//! | [`first_order`] | light that scatters once in a stack of layers (Hanrahan and Krueger 1993) |
//! | [`model`] | [`ForwardModel`]: what a fit asks of any model |
//! | [`exit`] | [`ExitFactor`]: what a camera sees of the light that leaves |
//! | [`footprint`] | what one datum of a profile averages over: ring, beam and pixel |
//! | [`spread`] | [`RadialSpread`]: a round spread of light as it was measured |
//! | [`frame`] | [`Frame`] and [`Sensor`]: one exposure, and the sensor behind it |
//! | [`mosaic`] | [`Mosaic`]: which colour each photosite of a sensor sees |
//! | [`radiance`] | [`RadianceMap`]: a picture with a variance |
//! | [`profile`] | [`RadialProfile`] and [`TotalReflectance`] |
//! | [`material`] | [`Material`]: one row of a table |
//! | [`random`] | random streams named by what they are used for |
//! | [`lanes`] | a random walk in lanes of single precision |
//! | [`simd`] | loops over lanes on the instructions of the processor at hand |

pub mod bessel;
pub mod better_dipole;
pub mod brdf;
pub mod dipole;
pub mod directional;
pub mod exit;
pub mod first_order;
pub mod footprint;
pub mod frame;
pub mod fresnel;
mod image_sources;
pub mod kienle_patterson;
pub mod lanes;
pub mod layered;
pub mod material;
pub mod medium;
pub mod model;
pub mod mosaic;
pub mod multipole;
pub mod phase;
pub mod photon_beam_diffusion;
pub mod profile;
pub mod radiance;
pub mod random;
pub mod simd;
pub mod spread;

pub use better_dipole::BetterDipoleModel;
pub use dipole::{Dipole, DipoleModel};
pub use directional::{DirectionalModel, ObliqueBeam};
pub use exit::ExitFactor;
pub use first_order::{FirstOrder, Reflections};
pub use footprint::{Blur, Footprints, Rows};
pub use frame::{Counts, Frame, Samples, Sensor};
pub use fresnel::{DiffuseFresnel, Exitance};
pub use kienle_patterson::KienlePattersonModel;
pub use layered::{Constituent, Layer, LayeredMedium};
pub use material::Material;
pub use medium::{Coefficients, InvalidMedium, Medium, ReducedMedium};
pub use model::{ForwardModel, Gradient, Trust};
pub use mosaic::Mosaic;
pub use multipole::{MultipoleModel, Slab};
pub use phase::{HenyeyGreenstein, Phase, PhaseFunction, PhaseMixture, TabulatedPhase};
pub use photon_beam_diffusion::PhotonBeamDiffusionModel;
pub use profile::{ProfilePoint, RadialProfile, TotalReflectance};
pub use radiance::{ChannelMap, RadianceMap};
pub use spread::RadialSpread;
