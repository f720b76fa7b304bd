//! The walk, compiled a second time for AVX2.
//!
//! The same source: the compiler uses the wider instruction set, and three-operand instructions, where the processor has
//! them. It contracts no multiplication and addition to one, so the image is the same to the last bit; a test compares.
#![allow(unsafe_code, reason = "calling code for a processor feature is unsafe; the feature is asked for first")]

use super::super::tiles::TilePixel;
use super::entries::TileBins;
use super::walk::{Scene, TileScratch, render_tile_inlined};
use crate::optics::Integrator;
use crate::stats::FrameStats;

/// Whether this processor runs the AVX2 version.
pub(super) fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// As `render_tile` of the walk; `avx2` as [`has_avx2`] says, or false for the version that runs everywhere.
pub(super) fn render_tile<I: Integrator>(
    avx2: bool,
    scene: &Scene<'_, I>,
    bins: &TileBins,
    tile: usize,
    scratch: &mut TileScratch,
    pixels: &mut [TilePixel],
) -> FrameStats {
    #[cfg(target_arch = "x86_64")]
    if avx2 && has_avx2() {
        // SAFETY: the processor has AVX2, as just asked; the function has no other precondition.
        return unsafe { render_tile_avx2(scene, bins, tile, scratch, pixels) };
    }
    let _ = avx2;
    render_tile_inlined(scene, bins, tile, scratch, pixels)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn render_tile_avx2<I: Integrator>(
    scene: &Scene<'_, I>,
    bins: &TileBins,
    tile: usize,
    scratch: &mut TileScratch,
    pixels: &mut [TilePixel],
) -> FrameStats {
    render_tile_inlined(scene, bins, tile, scratch, pixels)
}
