//! beamspot synth.
