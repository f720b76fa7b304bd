//! Tests of `store` across modules.
