//! Tests of `mesh` across modules.
