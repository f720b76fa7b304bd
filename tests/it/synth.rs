//! Tests of `synth` across modules.
