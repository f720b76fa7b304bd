//! Encoding of one field over time: decode any step, verify.
