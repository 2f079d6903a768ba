//! beamspot fit.
