//! beamspot profile.
