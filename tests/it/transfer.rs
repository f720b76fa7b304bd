//! Tests of `transfer` across modules.
