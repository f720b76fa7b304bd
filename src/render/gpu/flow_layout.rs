//! Structs, constants and layouts of splats of flow that the CPU and the shaders share; as in [`super::layout`], a test compares them.

use bytemuck::{Pod, Zeroable};

/// Layout of splats of flow as texels (`shaders/lib/flow_layout.wgsl`), and of their numbers by tiles, in words (`shaders/lib/flow_bins.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlowLists {
    /// Tiles of the image.
    pub tiles: u64,
    /// Splats.
    pub splats: u64,
}

impl FlowLists {
    /// Texels before those of the tiles.
    pub const HEAD_TEXELS: u64 = 1;
    /// Texels of a splat.
    pub const SPLAT_TEXELS: u64 = 5;
    /// Texels of a splat's place in the list of a tile.
    pub const PLACE_TEXELS: u64 = 2;
    /// Words between the ends of the tiles' lists and the first number: the total, and the length of the longest list.
    pub const BINS_HEAD: u64 = 2;
    /// Bytes of a splat on the screen (`shaders/lib/flow_records.wgsl`).
    pub const RECORD_BYTES: u64 = 96;
    /// Splats of a tile beyond which a frame is refused.
    pub const LONGEST: u32 = 1 << 16;

    /// The first texel of the places.
    pub fn places(self) -> u64 {
        (Self::HEAD_TEXELS + self.tiles + Self::SPLAT_TEXELS * self.splats).next_multiple_of(Self::PLACE_TEXELS)
    }

    /// The first word of the numbers.
    pub fn numbers(self) -> u64 {
        self.tiles + Self::BINS_HEAD
    }
}

/// What all splats of flow have in common (`shaders/lib/flow_params.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FlowParams {
    /// The head of the texels: what kernels are, whether splats are cut at the cells, whether there are fragments of other layers.
    pub head: [f32; 4],
    /// Periods of the pattern per local unit, as a sum of two.
    pub periods: [f32; 2],
    /// Widths of a splat's kernel per width of its site's shape.
    pub size: f32,
    /// Opacity of an icon where it is 1.
    pub opacity: f32,
    /// 1 if patterns fade where the vector is nearly along the ray.
    pub fades: u32,
    /// Number of splats.
    pub splat_count: u32,
    /// Words of each splat.
    pub splat_words: u32,
    /// Capacity in places.
    pub place_capacity: u32,
}
