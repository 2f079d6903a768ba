//! beamspot formats.
