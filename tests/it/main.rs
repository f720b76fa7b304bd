//! The one integration binary: tests that cross modules, read sample files or run the command.

mod common;
mod import;
mod mesh;
mod render;
mod store;
mod synth;
mod transfer;
