//! Shapes that are drawn at once, without faces.

pub mod ellipsoid;
