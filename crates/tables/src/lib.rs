//! beamspot tables.
