//! The hot loop over all lanes, on the instructions chosen at run time.

use crate::kernel::{Chunk, Flight, Limits, Scattering, advance};
use physics::simd::{LaneLoop, SimdPath};

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
    type Output = ();

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
