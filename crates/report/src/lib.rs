//! beamspot report.
