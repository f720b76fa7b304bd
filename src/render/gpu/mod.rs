//! Renderers on the GPU.
//!
//! The stages are those of the CPU path, in WGSL (`shaders/`, one file a stage), over the same buffers. [`layout`], [`resources`]
//! and [`shaders`] are plain data and text: they are compiled, and tested against each other, without a GPU and without wgpu.

pub mod layout;
pub mod resources;
mod shader_parts;
pub mod shaders;

#[cfg(test)]
mod shader_tests;

#[cfg(feature = "gpu")]
mod buffers;
#[cfg(feature = "gpu")]
pub mod context;
#[cfg(feature = "gpu")]
mod decode;
#[cfg(feature = "gpu")]
mod eye;
#[cfg(feature = "gpu")]
mod frame_texture;
#[cfg(feature = "gpu")]
mod full_size;
#[cfg(feature = "gpu")]
pub mod havs;
#[cfg(feature = "gpu")]
mod joint;
#[cfg(feature = "gpu")]
mod layers;
#[cfg(feature = "gpu")]
mod pipelines;
#[cfg(feature = "gpu")]
mod precision;
#[cfg(feature = "gpu")]
mod presenter;
#[cfg(feature = "gpu")]
pub mod raycast;
#[cfg(feature = "gpu")]
mod readback;
#[cfg(feature = "gpu")]
mod slices;
#[cfg(feature = "gpu")]
mod surfaces;
#[cfg(feature = "gpu")]
mod table;
#[cfg(feature = "gpu")]
mod target;
#[cfg(feature = "gpu")]
pub use frame_texture::FrameTexture;

/// Skips that cannot be overlooked, as the integration tests have them.
#[cfg(test)]
#[path = "../../../tests/it/common.rs"]
pub(crate) mod test_common;
