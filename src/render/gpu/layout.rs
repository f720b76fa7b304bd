//! What the CPU and the shaders share, as plain data. `shaders/lib/frame.wgsl` has the same structs; a test compares sizes
//! and offsets with those of the compiled shader.

use crate::camera::{Samples, View};
use crate::render::surfaces::SURFACES_MAX;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// Width and height of a tile in pixels.
pub const TILE_PX: usize = 16;

/// Counters of a tile.
pub const COUNTERS: usize = 8;

/// Floats of a vertex in view coordinates.
pub const VIEW_VERTEX_BYTES: u64 = 32;

/// Words of a (tile, item) pair.
pub const PAIR_WORDS: u64 = 2;

/// x and y in view coordinates are kept times this, so that products of four of them neither over- nor underflow f32.
pub const PLANE_SCALE: f64 = (1u64 << 30) as f64;

/// An eye further away than this (in local units: the mesh lies within [-1, 1]) is out of f32's reach: products of sheared
/// coordinates would overflow.
pub const EYE_DISTANCE_MAX: f64 = (1u64 << 20) as f64;

/// Depths are counted from the middle of the mesh if it is further away than this: at the nearest the mesh then begins
/// where an f32 has 22 bits behind the point.
pub const PIVOT_DEPTH_MIN: f64 = 4.0;

/// Depths below or above this count as infinite.
pub const FAR: f32 = 3.0e38;

/// Bits of [`Params::flags`].
pub mod flags {
    /// Rays meet in the eye.
    pub const PERSPECTIVE: u32 = 1;
    /// Rays stop where nothing behind can be seen.
    pub const EARLY_TERMINATION: u32 = 2;
    /// No cell is inactive.
    pub const ALL_ACTIVE: u32 = 4;

    /// Of [`FaceParams::flags`](super::FaceParams): all faces of the active cells are drawn.
    pub const COMPLETE: u32 = 1;
    /// Of [`FaceParams::flags`](super::FaceParams): fragments are put in order whatever it takes.
    pub const EXACT_ORDER: u32 = 2;
}

/// Pixels with more fragments are sorted before they are resolved.
pub const DEEP: u32 = 1024;

/// Faces of a workgroup of the stage that draws them.
pub const FACES_PER_GROUP: u32 = 64;

/// Pixels of a tile.
pub const TILE_PIXELS: usize = TILE_PX * TILE_PX;

/// Words of a face: corners, ascending; the cells in front of it and behind it for a ray that sees them counter-clockwise.
pub const FACE_WORDS: usize = 5;

/// Words of a cell at the eye, for the face renderer: the cell, bits (`shaders/lib/faces.wgsl`), corners, ascending.
pub const EYE_WORDS: usize = 6;

/// Bytes of a fragment: depth as a sum of two, scalar, rank, the cells left and entered.
pub const FRAGMENT_BYTES: u64 = 24;

/// Bytes of a fragment with a joint table: the quantity of vertices, too, and nothing.
pub const JOINT_FRAGMENT_BYTES: u64 = 32;

/// Words of a piece of a large face: its place in the list, a tile.
pub const PIECE_WORDS: u64 = 2;

/// Places in the lists of the face renderer, in words (`shaders/lib/faces.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lists {
    /// Tiles of the image.
    pub tiles: u64,
}

impl Lists {
    /// Words before the first tile's; the first of them is the number of pieces.
    pub const HEAD: u64 = 4;

    /// Fragments of each tile.
    pub fn sums(self) -> u64 {
        Self::HEAD
    }

    /// For each tile how many fragments its deepest pixel has, then where its first fragment is, before the tile's first pixel.
    pub fn bases(self) -> u64 {
        Self::HEAD + self.tiles
    }

    /// For each pixel of each tile how many fragments it has, then where they begin in the tile, then where they end.
    pub fn pixels(self) -> u64 {
        Self::HEAD + 2 * self.tiles
    }

    /// Pieces of large faces.
    pub fn pieces(self) -> u64 {
        self.pixels() + TILE_PIXELS as u64 * self.tiles
    }
}

/// What the stages of the face renderer need beyond [`Params`]; written for each slice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FaceParams {
    /// Faces of the list.
    pub drawn_count: u32,
    /// Cells at the eye: their records come behind the list.
    pub eye_count: u32,
    /// First unit of the slice: face, piece or tile.
    pub first: u32,
    /// The one behind its last.
    pub end: u32,
    /// First tile of the band.
    pub first_tile: u32,
    /// The one behind its last.
    pub end_tile: u32,
    /// First pixel of each tile; other than 0 in a band within one tile.
    pub first_pixel: u32,
    /// The one behind the last.
    pub end_pixel: u32,
    /// Faces of a binding.
    pub face_part: u32,
    /// Fragments of the first binding.
    pub fragment_part: u32,
    /// Pieces that there is room for.
    pub piece_capacity: u32,
    /// Fragments that the buffer of a pixel holds back.
    pub k: u32,
    /// Depths closer than that may be in the wrong order.
    pub tie: f32,
    /// Bits of [`flags`].
    pub flags: u32,
    /// Of a round of sorting: the bits in which the places of two fragments that are compared differ.
    pub sort_mask: u32,
    /// Nothing.
    pub unused: u32,
}

/// Parameters of a frame, as all stages see them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Params {
    /// Eye, local units: sum of the two.
    pub eye_hi: [f32; 4],
    /// The rest of the eye.
    pub eye_lo: [f32; 4],
    /// Right, up, forward; each the sum of three parts, the first two of 12 bits.
    pub axes: [[f32; 4]; 9],
    /// Half the distance of two pixels on the image plane times [`PLANE_SCALE`]: x as a sum of two, y as a sum of two.
    pub pitch: [f32; 4],
    /// Depth from which depths are counted: the eye's, or, for parallel rays, that of the local origin: sum of the two.
    pub depth_origin: [f32; 2],
    /// Scalars are seen as (scalar - offset) * scale.
    pub scalar_offset: f32,
    /// See `scalar_offset`.
    pub scalar_scale: f32,
    /// Pixels per row of the plane that is rendered, rows of it.
    pub size_px: [u32; 2],
    /// Tiles per row, rows of tiles.
    pub tiles: [u32; 2],
    /// Pixels per row of the image, rows of it.
    pub image_px: [u32; 2],
    /// Pixels from one of the plane to the next, in both directions.
    pub stride_px: [u32; 2],
    /// Depth of the near distance, counted from the pivot.
    pub near: f32,
    /// Vertices of the mesh.
    pub vertex_count: u32,
    /// Entry faces; they come first among the items.
    pub face_count: u32,
    /// Cells at the eye.
    pub eye_count: u32,
    /// Entry faces and cells at the eye.
    pub item_count: u32,
    /// Pairs of tile and item that there is room for.
    pub pair_capacity: u32,
    /// First tile of the slice.
    pub first_tile: u32,
    /// Bits of [`flags`].
    pub flags: u32,
    /// Intervals of the table of the exact integrator.
    pub interval_count: u32,
    /// Depth from which the depths along rays are counted: that of the local origin if the eye is far, else 0.
    pub pivot: f32,
    /// Nothing.
    pub unused: u32,
    /// Zero, which the compilers of shaders do not know: it keeps them from simplifying sums as if they were exact.
    pub zero: u32,
}

impl Params {
    /// The parameters that the view decides; `None` if the eye is further away than [`EYE_DISTANCE_MAX`], the view so wide that
    /// single precision does not hold its coordinates, or rays are cast for listed pixels. `view` is in local coordinates.
    pub fn of_view(view: &View) -> Option<Self> {
        if view.eye.abs().max_element() > EYE_DISTANCE_MAX {
            return None;
        }
        let axis = |v: DVec3| {
            let parts = v.to_array().map(three_parts);
            [0, 1, 2].map(|part| [parts[0][part], parts[1][part], parts[2][part], 0.0])
        };
        let [right, up, forward] = [view.right, view.up, view.forward].map(axis);
        let axes = [right, up, forward].concat().try_into().unwrap_or_default();
        let eye = view.eye.to_array().map(two_parts);
        let origin = if view.perspective { [0.0; 2] } else { two_parts(-view.forward.dot(view.eye)) };
        let pitch = |half: f64, pixels: usize| two_parts(half / pixels as f64 * PLANE_SCALE);
        let (x, y) = (pitch(view.half_width, view.width_px), pitch(view.half_height, view.height_px));
        // Squares of coordinates of the whole image are computed.
        let reach = f64::from(x[0].max(y[0])) * view.width_px.max(view.height_px) as f64;
        if reach.is_nan() || reach >= 1e18 {
            return None;
        }
        let Samples::Lattice(lattice) = view.samples else { return None };
        let (columns, rows) = view.plane_px();
        let middle = -view.forward.dot(view.eye);
        let pivot = if view.perspective && middle > PIVOT_DEPTH_MIN { middle as f32 } else { 0.0 };
        let (near, perspective) = if view.perspective {
            ((view.near - f64::from(pivot)).clamp(-f64::from(FAR), f64::from(FAR)) as f32, flags::PERSPECTIVE)
        } else {
            (-FAR, 0)
        };
        Some(Self {
            eye_hi: [eye[0][0], eye[1][0], eye[2][0], 0.0],
            eye_lo: [eye[0][1], eye[1][1], eye[2][1], 0.0],
            axes,
            pitch: [x[0], x[1], y[0], y[1]],
            depth_origin: origin,
            size_px: [columns as u32, rows as u32],
            tiles: [columns.div_ceil(TILE_PX) as u32, rows.div_ceil(TILE_PX) as u32],
            image_px: [view.width_px as u32, view.height_px as u32],
            // One beyond the image is as good as its size, and products of places with it stay small.
            stride_px: [lattice.stride_px().min(view.width_px.max(view.height_px)) as u32; 2],
            near,
            pivot,
            flags: perspective,
            ..Self::default()
        })
    }

    /// Number of tiles.
    pub fn tile_count(&self) -> usize {
        self.tiles[0] as usize * self.tiles[1] as usize
    }
}

/// Where the parts of a joint table are in the buffer of the table, in vectors of four (`shaders/lib/optics_joint.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct JointParams {
    /// Intervals of the scalar.
    pub scalar_intervals: u32,
    /// How many they are.
    pub scalar_count: u32,
    /// Intervals of the rows.
    pub row_intervals: u32,
    /// How many they are.
    pub row_count: u32,
    /// Values, the first layer first.
    pub values: u32,
    /// Values of a row.
    pub columns: u32,
    /// Values of a layer.
    pub layer_values: u32,
    /// Layers of the cells, two cells a vector.
    pub cells: u32,
    /// Cells that have one.
    pub cell_count: u32,
}

/// A sheet of [`SurfaceParams`] (`shaders/lib/surfaces.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SheetParams {
    /// Red, green and blue of the side towards lower scalars; the scalar from which on a place is above, as seen through the map.
    pub front: [f32; 4],
    /// Those of the other side; opacity.
    pub back: [f32; 4],
}

/// The isosurfaces of a frame (`shaders/lib/surfaces.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfaceParams {
    /// Towards the light, view coordinates, of length 1.
    pub light: [f32; 3],
    /// Sheets.
    pub count: u32,
    /// Where normals come from: 0 nowhere, 1 the cell, 2 its vertices.
    pub normals: u32,
    /// 1 if light comes from the eye instead.
    pub is_headlight: u32,
    /// Where the gradients of vertices begin among the numbers behind the view vertices.
    pub gradients: u32,
    /// 1 if anything is to be seen of the volume.
    pub has_volume: u32,
    /// By scalar.
    pub sheets: [SheetParams; SURFACES_MAX],
}

/// Parameters of the decoder of codec `vq`: places in the block, in words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct VqStep {
    /// Vertices of the mesh.
    pub vertex_count: u32,
    /// Row of the step in the first codebook.
    pub row_8: u32,
    /// Row of the step in the second codebook.
    pub row_64: u32,
    /// Mean of each vertex.
    pub means: u32,
    /// Exponent of each vertex, four a word; `u32::MAX` if all are zero.
    pub exponents: u32,
    /// Entry of each vertex in the first codebook.
    pub first: u32,
    /// Entry of each vertex in the second codebook.
    pub second: u32,
    /// Indices of a word: 2 to this.
    pub per_word_log2: u32,
}

/// Places in the buffers that depth layers are drawn with, in words (`shaders/lib/layer_lists.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerLists {
    /// Tiles of the image.
    pub tiles: u64,
    /// Layers of a pixel.
    pub layers: u64,
}

impl LayerLists {
    /// Words before the first piece of a large face.
    pub const HEAD: u64 = 4;
    /// Pieces that there should be room for.
    pub const PIECE_COUNT: usize = 0;
    /// The first piece of the slice.
    pub const PIECES_FROM: usize = 1;
    /// The piece behind the last one of the slice.
    pub const PIECES_TO: usize = 2;

    /// Words of the depths: two for the range of each tile, then the layers of each pixel of each tile.
    pub fn depths(self) -> u64 {
        (2 + self.layers * TILE_PIXELS as u64) * self.tiles
    }
}

/// What stages need beyond [`Params`] that bring an image to another size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct UpsampleParams {
    /// Pixels per row of the small image, rows of it.
    pub small_px: [u32; 2],
    /// Samples from one pixel to the next, a power of two.
    pub samples_per_pixel: f32,
    /// Omega reaches so many pixels to each side.
    pub half_px: i32,
    /// The logarithm (base 2) of f is minus this times the square of a distance in pixels.
    pub domain_per_square: f32,
    /// The same of g, of a distance in the reference.
    pub reference_per_square: f32,
    /// Nothing.
    pub unused: [u32; 2],
}

/// Places in the buffer of the rays that contrast asks for, in words (`shaders/lib/ray_list.wgsl`, `ray_bits.wgsl`): a head, bits of what
/// is listed and of what has met a cell, states of the blocks between rays, the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayLists {
    /// Width and height of the image.
    pub size_px: (usize, usize),
}

impl RayLists {
    /// Words of the head.
    pub const HEAD: usize = 34;
    /// Rays in the list.
    pub const LISTED: usize = 0;
    /// From here on the head begins anew with each contrast.
    pub const STEP: usize = 3;
    /// 1 if the walk has been given all rays.
    pub const IS_DONE: usize = 4;
    /// Pairs of tile and item that there should be room for.
    pub const PAIRS: usize = 6;
    /// Workgroups of the walk that a slice may start.
    pub const GROUPS_LEFT: usize = 7;
    /// Those that it has started.
    pub const GROUPS_DONE: usize = 8;
    /// Rays by level.
    pub const RAYS_BY_LEVEL: usize = 9;
    /// Blocks that are split by their reasons, and those that are filled.
    pub const BLOCKS: usize = 13;
    /// Sums of the counters, each of two words.
    pub const SUMS: usize = 18;
    /// Workgroups of the walk have so many rays.
    pub const GROUP_RAYS: usize = 256;
    /// Steps from the first rays to the last.
    pub const STEPS: usize = 4;

    /// Words of a bit for each pixel.
    fn bits(self) -> u64 {
        (self.size_px.0 * self.size_px.1).div_ceil(32) as u64
    }

    /// Columns and rows of the blocks of a stride.
    pub fn blocks(self, stride: usize) -> (usize, usize) {
        let count = |pixels: usize| pixels.saturating_sub(1).div_ceil(stride).max(1);
        (count(self.size_px.0), count(self.size_px.1))
    }

    /// Bits of what is in the list.
    pub fn listed(self) -> u64 {
        Self::HEAD as u64
    }

    /// Bits of what has met a cell.
    pub fn met(self) -> u64 {
        self.listed() + self.bits()
    }

    /// States of the blocks of the strides 8, 4 and 2, and what comes behind them.
    pub fn states(self) -> [u64; 4] {
        let mut at = self.met() + self.bits();
        [8, 4, 2, 1].map(|stride| {
            let begin = at;
            let (columns, rows) = self.blocks(stride);
            at += (columns * rows) as u64;
            begin
        })
    }

    /// The list: as many rays as there are pixels at most.
    pub fn list(self) -> u64 {
        self.states()[3]
    }

    /// All words.
    pub fn end(self) -> u64 {
        self.list() + (self.size_px.0 * self.size_px.1) as u64
    }
}

/// What the stages of rays that contrast asks for need beyond [`Params`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RayParams {
    /// The contrast that splits blocks.
    pub contrast: f32,
    /// [`RayLists::listed`].
    pub listed_at: u32,
    /// [`RayLists::met`].
    pub met_at: u32,
    /// [`RayLists::list`].
    pub list_at: u32,
    /// [`RayLists::states`].
    pub states_at: [u32; 4],
}

impl RayParams {
    /// The places of an image, which a buffer holds, and a contrast.
    pub fn new(lists: RayLists, contrast: f32) -> Self {
        let [listed_at, met_at, list_at] = [lists.listed(), lists.met(), lists.list()].map(|at| at as u32);
        Self { contrast, listed_at, met_at, list_at, states_at: lists.states().map(|at| at as u32) }
    }
}

/// The depth that a sum of two means.
pub fn depth_of(parts: [f32; 2]) -> f64 {
    f64::from(parts[0]) + f64::from(parts[1])
}

/// `x` as a sum of two f32, right to 2^-48 of itself.
pub fn two_parts(x: f64) -> [f32; 2] {
    let first = x as f32;
    [first, (x - f64::from(first)) as f32]
}

/// The leading 12 bits of the mantissa.
fn leading(x: f64) -> f32 {
    f32::from_bits((x as f32).to_bits() & 0xffff_f000)
}

/// `x` as a sum of three f32, the first two of 12 bits.
fn three_parts(x: f64) -> [f32; 3] {
    let first = leading(x);
    let rest = x - f64::from(first);
    let second = leading(rest);
    [first, second, (rest - f64::from(second)) as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};

    #[test]
    fn parts_add_up_to_the_number() {
        for x in [1.0 / 3.0, -0.7, 1e-9, 123.456, -1.0, 0.0] {
            let sum: f64 = three_parts(x).iter().map(|&p| f64::from(p)).sum();
            // What a part is cut from loses all but 2^-11 to it, twice; the rest is rounded by 2^-24 of itself.
            assert!((sum - x).abs() <= x.abs() * 2f64.powi(-46), "{x}");
            // Twice rounded, by 2^-24 each.
            assert!((depth_of(two_parts(x)) - x).abs() <= x.abs() * 2f64.powi(-48), "{x}");
            for part in &three_parts(x)[..2] {
                assert_eq!(part.to_bits() & 0xfff, 0);
            }
        }
        // Without the last part the sum would be off by more.
        let (x, [a, b, _], [high, _]) = (1.0 / 3.0, three_parts(1.0 / 3.0), two_parts(1.0 / 3.0));
        assert!((f64::from(a) + f64::from(b) - x).abs() > x * 2f64.powi(-46));
        assert!((f64::from(high) - x).abs() > x * 2f64.powi(-48));
    }

    fn view(distance: f64, projection: Projection) -> View {
        let camera = Camera {
            position: DVec3::new(distance, 0.0, 0.0),
            focal_point: DVec3::new(distance - 1.0, 0.0, 0.0),
            view_up: DVec3::Z,
            projection,
            near: 0.0,
        };
        camera.view(40, 30).unwrap()
    }

    #[test]
    fn depths_are_counted_from_the_eye_or_from_the_middle_of_the_mesh() {
        let perspective = Projection::Perspective { view_angle: 30.0 };
        let params = Params::of_view(&view(1000.0, perspective)).unwrap();
        assert_eq!((params.depth_origin, params.near, params.flags), ([0.0; 2], -1000.0, flags::PERSPECTIVE));
        assert_eq!((params.pivot, Params::of_view(&view(3.0, perspective)).unwrap().pivot), (1000.0, 0.0));
        let params = Params::of_view(&view(-7.0, Projection::Parallel { scale: 1.0 })).unwrap();
        assert_eq!((params.depth_origin, params.near, params.flags), ([-7.0, 0.0], -FAR, 0));
        assert_eq!((params.size_px, params.tiles, params.tile_count()), ([40, 30], [3, 2], 6));
    }

    #[test]
    fn an_eye_beyond_the_reach_of_f32_is_refused() {
        let perspective = Projection::Perspective { view_angle: 30.0 };
        assert!(Params::of_view(&view(1e6, perspective)).is_some());
        assert!(Params::of_view(&view(1.1e6, perspective)).is_none());
        assert!(Params::of_view(&view(3.0, Projection::Parallel { scale: 1e6 })).is_some());
        assert!(Params::of_view(&view(3.0, Projection::Parallel { scale: 1e30 })).is_none());
    }
}
