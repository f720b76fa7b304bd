//! Renderers on the GPU.
//!
//! The stages are those of the CPU path, in WGSL (`shaders/`, one file a stage), over the same buffers. [`layout`], [`resources`]
//! and [`shaders`] are plain data and text: they are compiled, and tested against each other, without a GPU and without wgpu.
//!
//! `context` holds adapter, device and queue, collects the errors that wgpu reports asynchronously, and tells when the device is lost.
//! `raycast`, `havs` and `points` are the twins of the modules of these names in [`crate::render::cpu`]; `lists` is what the latter two
//! share. [`shaders`] composes the shaders from `shaders/lib/` and lists what each stage binds, by name: WGSL declarations, bind group layout
//! and bind group all come from that list, and no file contains a binding number. Modules that all renderers use (vertex and scalar buffers,
//! decoder, table, planes, read-back, slices) lie beside them.
//!
//! | stage | file | a thread is |
//! |---|---|---|
//! | decode (codec `vq`) | `decode_vq.wgsl` | a vertex, or a cell that has a scalar |
//! | view transform | `view_transform.wgsl` | a vertex, or eight cells that have scalars |
//! | entries | `entries_count.wgsl`, `entries_scan.wgsl`, `entries_store.wgsl` | an entry face; a part of the tiles; an entry face |
//! | flow | `flow_project.wgsl`; `flow_count.wgsl`, `entries_scan.wgsl`, `flow_store.wgsl`; `flow_sort.wgsl` | a splat; a splat, a part of the tiles, a splat; a splat of a tile, a workgroup is a tile |
//! | walk and composite | `walk.wgsl` with `lib/optics_intervals.wgsl` and `lib/optics_exact.wgsl` or `lib/optics_partial.wgsl`, or with `lib/optics_table3d.wgsl` or `lib/optics_joint.wgsl`; and `lib/surfaces.wgsl`, or `lib/cell_scalars.wgsl` or `lib/cell_joint.wgsl`; and `lib/ahead.wgsl` with `lib/fragments_ahead.wgsl` or `lib/flow_ahead.wgsl`, among other layers | a pixel, a workgroup is a tile |
//! | count, store (`havs`, `points`) | `fragments_find.wgsl`, `fragments_pieces.wgsl` with `lib/face_hits.wgsl`, `lib/tet_hits.wgsl` or `lib/slab_hits.wgsl` (of `lib/slab_of_cell.wgsl` or `lib/slab_of_ball.wgsl`), and `lib/fragments_count.wgsl` or `lib/fragments_store.wgsl`; `face_starts.wgsl` | a face or a cell; half a row of a tile; a pixel |
//! | scan (`havs`, `points`) | `fragments_scan.wgsl` | a pixel, a workgroup is a tile |
//! | sort (of pixels of more than 1,024 fragments) | `fragments_sort.wgsl` | a pair of fragments, a workgroup is a tile |
//! | resolve (`havs`, `points`) | `fragments_resolve.wgsl` with `lib/face_paths.wgsl` or `lib/point_light.wgsl`, optics, surfaces and other layers of the walk | a pixel, a workgroup is a tile |
//!
//! - **f32**, which is what every WGSL device has; f64 for the geometry of thin, visible cells where the device has it (`gpu::precision`).
//!   View coordinates are sums of two f32 (x and y) or three (depth), products of 12-bit parts are exact, and edge functions that cancel
//!   are computed again with the rounding errors of their products. Compilers of shaders simplify such sums as if they were exact, so they
//!   go through `opaque`, which the compiler cannot see through.
//! - **Within WebGPU's default limits**: eight storage buffers, bindings of 128 MiB. The records of the cells (32 bytes each) are split
//!   over up to three bindings; a mesh that does not fit even so is refused with `BeyondGpu`, as is an image larger than the device's
//!   textures.
//! - **Far eyes, and eyes next to an edge.** Depths are counted from the middle of the mesh if the eye is far, and along a path from its
//!   start. In which cell a ray starts is decided in the sheared plane of the walk, by a sign on which both cells at a face agree; only
//!   the eye's side of an open face is decided exactly.
//! - **Compressed steps.** A block of codec `vq` stays in the GPU's memory while its 64 steps are played, for rays and for faces; a step is
//!   64 bytes of parameters. Moments between two steps are decoded and mixed there if the device has f64, with the bits of the CPU; a
//!   second block stays once both were needed. The CPU decodes and mixes too: holes, ranges and a fall-back need the values, and it takes a
//!   third of a millisecond for 176k vertices.
//! - **Lists of entries, and of splats of flow, have any length.** Counts per tile are summed and the lists stored one after the other; if the
//!   buffer was too small, the frame is begun again with a larger one (`entry_retries`). A pixel with more than four starts searches again for the next four.
//! - **Steady frames allocate nothing.** Buffers grow and stay; parameters are written to the same uniform buffer; bind groups are made anew
//!   only with a buffer. Scalars, table and active cells are sent when they have changed. Images come back through a ring of buffers, so
//!   that the GPU has the next slice while the last one is read.
//! - **Slices.** `advance(budget)` submits as many tiles (elements, when their fragments are counted or stored) as took that long before.
//! - **Which GPU.** `pipeline::Backend`: `auto` takes a hardware adapter if there is one, software only by name, and the CPU for a job that
//!   is beyond the GPU. After a loss the device is opened and the frame begun again, twice at most; then `gpu` returns the error, and
//!   `auto` the frame from the CPU.
//!
//! Tests compare every stage with the definition in f64, every image with the CPU's, and Rust structs and lists of bindings with those of
//! the compiled shaders (naga, no GPU needed).

pub mod flow_layout;
pub mod layout;
pub mod point_params;
pub mod resources;
mod shader_parts;
pub mod shaders;
mod stage_parts;
pub mod variants;

#[cfg(test)]
mod layout_tests;
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
mod flow_textures;
#[cfg(feature = "gpu")]
mod frame_texture;
#[cfg(feature = "gpu")]
mod full_size;
#[cfg(feature = "gpu")]
pub mod havs;
#[cfg(feature = "gpu")]
mod joint;
#[cfg(feature = "gpu")]
mod layer_fragments;
#[cfg(feature = "gpu")]
mod layers;
#[cfg(feature = "gpu")]
mod lists;
#[cfg(feature = "gpu")]
mod pipelines;
#[cfg(feature = "gpu")]
pub mod points;
#[cfg(feature = "gpu")]
mod precision;
#[cfg(feature = "gpu")]
mod presenter;
#[cfg(feature = "gpu")]
pub mod raycast;
#[cfg(feature = "gpu")]
mod readback;
#[cfg(feature = "gpu")]
mod shared_scene;
#[cfg(feature = "gpu")]
mod slices;
#[cfg(feature = "gpu")]
pub(in crate::render) mod splat_lists;
#[cfg(feature = "gpu")]
mod surfaces;
#[cfg(feature = "gpu")]
mod table;
#[cfg(feature = "gpu")]
mod target;
#[cfg(feature = "gpu")]
mod texels;
#[cfg(feature = "gpu")]
pub use frame_texture::FrameTexture;

/// Test skips that are printed past the harness's capture, shared with the integration tests.
#[cfg(test)]
#[path = "../../../tests/it/common.rs"]
pub(crate) mod test_common;
