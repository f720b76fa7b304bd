//! Frames and series written to files.
