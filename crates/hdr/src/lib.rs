//! beamspot hdr.
