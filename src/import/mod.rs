//! Readers of foreign files, one per format.
