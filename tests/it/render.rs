//! Tests of `render` across modules.
