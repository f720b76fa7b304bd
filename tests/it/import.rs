//! Tests of `import` across modules.
