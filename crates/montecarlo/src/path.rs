//! Which instructions the lanes run on, chosen at run time.

use crate::kernel::{Chunk, Flight, Limits, Scattering, advance};
use pulp::NullaryFnOnce;

/// An instruction path of the lane walk.
///
/// Results on one path repeat to the byte, on any machine that has it; across paths they agree
/// statistically (fused multiply-adds round once where the portable path rounds twice).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SimdPath {
    /// What every processor of the target architecture has.
    Portable,
    /// AVX2 with FMA: 8 lanes a register.
    Avx2,
    /// AVX-512: 16 lanes a register.
    Avx512,
}

impl SimdPath {
    /// Every path, slowest first.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::try_new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The fastest path that this processor has.
    pub fn best() -> Self {
        let available = Self::ALL.into_iter().rev().find(|path| path.is_available());
        available.unwrap_or(Self::Portable)
    }

    /// Its name, as users type it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The path of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|path| path.name() == name)
    }

    /// Runs a loop over lanes on this path, or on the portable one where the processor lacks it.
    pub(crate) fn run(self, lanes: impl LaneLoop) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if let Some(simd) = pulp::x86::V4::try_new() => {
                simd.vectorize(Compiled::<_, true>(lanes));
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if let Some(simd) = pulp::x86::V3::try_new() => {
                simd.vectorize(Compiled::<_, true>(lanes));
            }
            _ => Compiled::<_, false>(lanes).call(),
        }
    }
}

/// A loop over lanes, to be compiled for each path.
pub(crate) trait LaneLoop {
    /// The loop, with fused multiply-adds if the path has them. Always inlined.
    fn run<const FMA: bool>(self);
}

/// The form that `pulp` compiles for an instruction set.
struct Compiled<L, const FMA: bool>(L);

impl<L: LaneLoop, const FMA: bool> NullaryFnOnce for Compiled<L, FMA> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.0.run::<FMA>();
    }
}

/// One step and one scattering of every photon, on the given path.
#[derive(Clone, Copy)]
pub(crate) struct Stepper {
    path: SimdPath,
    scattering: Scattering,
    /// Whether flights are recorded.
    flights: bool,
    limits: Limits,
}

/// The hot loop over all chunks.
struct Pass<'a> {
    stepper: &'a Stepper,
    chunks: &'a mut [Chunk],
    flights: &'a mut [Flight],
}

impl Pass<'_> {
    #[inline(always)]
    fn advance<const FMA: bool, const SCATTERING: u8>(self) {
        let limits = self.stepper.limits;
        if self.stepper.flights {
            for (chunk, flight) in self.chunks.iter_mut().zip(self.flights) {
                advance::<FMA, SCATTERING, true>(chunk, limits, flight);
            }
        } else {
            let mut unused = Flight::NONE;
            for chunk in self.chunks {
                advance::<FMA, SCATTERING, false>(chunk, limits, &mut unused);
            }
        }
    }
}

impl LaneLoop for Pass<'_> {
    #[inline(always)]
    fn run<const FMA: bool>(self) {
        const ISOTROPIC: u8 = Scattering::Isotropic as u8;
        const HENYEY_GREENSTEIN: u8 = Scattering::HenyeyGreenstein as u8;
        const GIVEN: u8 = Scattering::Given as u8;
        match self.stepper.scattering {
            Scattering::Isotropic => self.advance::<FMA, ISOTROPIC>(),
            Scattering::HenyeyGreenstein => self.advance::<FMA, HENYEY_GREENSTEIN>(),
            Scattering::Given => self.advance::<FMA, GIVEN>(),
        }
    }
}

impl Stepper {
    pub(crate) fn new(
        path: SimdPath,
        scattering: Scattering,
        flights: bool,
        limits: Limits,
    ) -> Self {
        Self {
            path,
            scattering,
            flights,
            limits,
        }
    }

    pub(crate) fn scattering(&self) -> Scattering {
        self.scattering
    }

    pub(crate) fn records_flights(&self) -> bool {
        self.flights
    }

    /// Moves the photons of all `chunks`. `flights` has as many, or none if none are recorded.
    pub(crate) fn advance(&self, chunks: &mut [Chunk], flights: &mut [Flight]) {
        self.path.run(Pass {
            stepper: self,
            chunks,
            flights,
        });
    }
}
