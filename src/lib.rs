//! tetreel plays time-varying scalar fields on tetrahedral meshes.
//!
//! A series is imported once into a store, then every displayed frame is *decode -> order -> render*, checked against a float64 reference.
//! Modules are layered in floors: each imports only from floors below its own (`tests/it/floors.rs` checks this table against every
//! import).
//!
//! | floor | modules |
//! |---|---|
//! | 0a | [`error`], [`random`], [`short`], [`slowdown`], [`words`] |
//! | 0b | [`files`], [`task`] |
//! | 1a | [`mesh`], [`moments`], [`camera`], [`image`], [`stats`], [`node_table`], [`timeline`] |
//! | 1b | [`field`] |
//! | 1c | [`histograms`] |
//! | 2 | [`transfer`], [`optics`] |
//! | 3 | [`codec`], [`visibility`] |
//! | 3b | [`functions`], [`lod`] |
//! | 4 | [`store`], [`import`], [`synth`], [`calculator`] |
//! | 5 | [`fit`], [`ingest`], [`render`] |
//! | 6 | [`pipeline`] |
//! | 7a | [`look`], [`playback`] |
//! | 7b | [`project`] |
//! | 7c | [`scene`] |
//! | 8 | [`export`] |
//! | 9 | [`mod@bench`], [`ui`] |
//! | 10 | [`cli`] |
//!
//! `docs/architecture.md` follows a frame through them; `examples/render_one.rs` is the shortest complete use.

pub mod bench;
pub mod calculator;
pub mod camera;
#[cfg(feature = "cli")]
pub mod cli;
pub mod codec;
pub mod error;
pub mod export;
pub mod field;
pub mod files;
pub mod fit;
pub mod functions;
pub mod histograms;
pub mod image;
pub mod import;
pub mod ingest;
pub mod lod;
pub mod look;
pub mod mesh;
pub mod moments;
pub mod node_table;
pub mod optics;
pub mod pipeline;
pub mod playback;
pub mod project;
pub mod random;
pub mod render;
pub mod scene;
mod short;
mod slowdown;
pub mod stats;
pub mod store;
pub mod synth;
pub mod task;
pub mod timeline;
pub mod transfer;
pub mod ui;
pub mod visibility;
mod words;
