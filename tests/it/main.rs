//! The one integration binary: tests that cross modules, read sample files or run the command.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on should panic")]

#[cfg(feature = "cli")]
mod accuracy;
#[cfg(feature = "cli")]
mod cli;
mod cloud;
mod cloud_mesh;
mod common;
mod connectivity;
mod cubes;
mod domain;
mod exr;
mod first_look;
mod floors;
#[cfg(feature = "cli")]
mod fuzz;
mod gate;
mod import;
mod lod;
mod lod_errors;
mod mesh;
mod meshes;
mod no_unsafe;
mod peers;
mod pipeline;
mod points;
mod range_map;
mod region_surfaces;
mod render;
mod samples;
mod series;
mod skipping;
mod skipping_cells;
mod store;
mod stress;
mod surfaces;
mod synth;
mod transfer;
