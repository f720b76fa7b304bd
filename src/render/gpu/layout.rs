//! Structs, constants and buffer layouts shared by the CPU and the shaders. `shaders/` has the same structs; a test compares sizes
//! and offsets with those of the compiled shaders.

use crate::camera::{Samples, View};
use crate::render::surfaces::SURFACES_MAX;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// Width and height of a tile in pixels.
pub const TILE_PX: usize = 16;

/// Counters per tile.
pub const COUNTERS: usize = 9;

/// Bytes of a vertex in view coordinates.
pub const VIEW_VERTEX_BYTES: u64 = 32;

/// Words of a (tile, item) pair.
pub const PAIR_WORDS: u64 = 2;

/// Factor of x and y in view coordinates, so that products of four of them neither over- nor underflow f32.
pub const PLANE_SCALE: f64 = (1u64 << 30) as f64;

/// Largest coordinate of the eye, local units (the mesh lies within [-1, 1]): beyond, products of sheared coordinates would overflow f32.
pub const EYE_DISTANCE_MAX: f64 = (1u64 << 20) as f64;

/// Distance of the middle of the mesh, local units, beyond which depths are counted from there: at the nearest the mesh then begins
/// where an f32 has 22 bits behind the point.
pub const PIVOT_DEPTH_MIN: f64 = 4.0;

/// Depths below or above this count as infinite.
pub const FAR: f32 = 3.0e38;

/// Bits of [`Params::flags`].
pub mod flags {
    /// The projection is perspective.
    pub const PERSPECTIVE: u32 = 1;
    /// Rays stop once they are opaque.
    pub const EARLY_TERMINATION: u32 = 2;
    /// All cells are active.
    pub const ALL_ACTIVE: u32 = 4;

    /// In [`ListParams::flags`](super::ListParams): all faces of the active cells are drawn.
    pub const COMPLETE: u32 = 1;
    /// In [`ListParams::flags`](super::ListParams): fragments are sorted completely by depth.
    pub const EXACT_ORDER: u32 = 2;
}

/// Number of fragments above which those of a pixel are sorted before the resolve stage.
pub const DEEP: u32 = 1024;

/// Elements (faces, or cells as points) per workgroup of the stage that finds fragments.
pub const ELEMENTS_PER_GROUP: u32 = 64;

/// Pixels of a tile.
pub const TILE_PIXELS: usize = TILE_PX * TILE_PX;

/// Words of a face: corners, ascending; the cells in front of it and behind it for a ray that sees them counter-clockwise.
pub const FACE_WORDS: usize = 5;

/// Words of a cell at the eye, for the face renderer: the cell, bits (`shaders/lib/list_params.wgsl`), corners, ascending.
pub const EYE_WORDS: usize = 6;
/// Words of a cell at the eye that is a point: the cell, and the eye's sides of its faces.
pub const POINT_EYE_WORDS: usize = 2;

/// Bytes of a fragment: depth as a sum of two, scalar, rank; of a face the cells left and entered, of a point the scalar at its exit and its
/// thickness.
pub const FRAGMENT_BYTES: u64 = 24;

/// Bytes of a fragment with a joint table: as above, then the value at vertices; of a point, at entry and exit.
pub const JOINT_FRAGMENT_BYTES: u64 = 32;

/// Words of a piece of an element with a large box: the element's place in the list, a tile.
pub const PIECE_WORDS: u64 = 2;

/// Initial capacity for pieces of large elements, per tile: a few elements in all tiles.
pub const FIRST_PIECES_PER_TILE: u64 = 8;

/// Offsets into the lists of fragments, in words (`shaders/lib/fragment_lists.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lists {
    /// Tiles of the image.
    pub tiles: u64,
}

impl Lists {
    /// Words of the head: the number of pieces, of points without a pixel, and of points that were widened.
    pub const HEAD: u64 = 4;

    /// Offset of the fragment counts, one per tile.
    pub fn sums(self) -> u64 {
        Self::HEAD
    }

    /// Offset of one word per tile: after the scan the fragments of its deepest pixel, then the slot where those of its first pixel begin.
    pub fn bases(self) -> u64 {
        Self::HEAD + self.tiles
    }

    /// Offset of one word per pixel, tile by tile: its fragment count, after the scan where they begin in the tile, after storing where they
    /// end.
    pub fn pixels(self) -> u64 {
        Self::HEAD + 2 * self.tiles
    }

    /// Offset of the pieces of large elements.
    pub fn pieces(self) -> u64 {
        self.pixels() + TILE_PIXELS as u64 * self.tiles
    }
}

/// Parameters of the stages with lists of fragments beyond [`Params`]; written for each slice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ListParams {
    /// Number of elements in the list.
    pub drawn_count: u32,
    /// Number of cells at the eye; their records come behind the list.
    pub eye_count: u32,
    /// First unit of the slice: element, piece or tile.
    pub first: u32,
    /// Unit behind the last one of the slice.
    pub end: u32,
    /// First tile of the band.
    pub first_tile: u32,
    /// Tile behind the last one of the band.
    pub end_tile: u32,
    /// First pixel of each tile; other than 0 in a band within one tile.
    pub first_pixel: u32,
    /// Pixel behind the last one of each tile.
    pub end_pixel: u32,
    /// Faces per binding.
    pub face_part: u32,
    /// Capacity of the first binding in fragments.
    pub fragment_part: u32,
    /// Capacity in pieces.
    pub piece_capacity: u32,
    /// Fragments in a pixel's k-buffer; for depth layers their number.
    pub k: u32,
    /// Depth difference, local units, below which fragments may be in the wrong order.
    pub tie: f32,
    /// Bits of [`flags`].
    pub flags: u32,
    /// The bits in which the places of two compared fragments differ, in a round of sorting.
    pub sort_mask: u32,
    /// Padding.
    pub unused: u32,
}

/// Parameters of a frame, as all stages see them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Params {
    /// Eye, local units: high parts of its components.
    pub eye_hi: [f32; 4],
    /// Low parts of the eye's components.
    pub eye_lo: [f32; 4],
    /// Right, up, forward; each the sum of three parts, the first two of 12 bits.
    pub axes: [[f32; 4]; 9],
    /// Half the pixel pitch on the image plane times [`PLANE_SCALE`]: x as a sum of two, y as a sum of two.
    pub pitch: [f32; 4],
    /// Depth from which depths are counted: the eye's, or, for parallel rays, that of the local origin: sum of the two.
    pub depth_origin: [f32; 2],
    /// Offset of the scalar map: shaders see (scalar - offset) * scale.
    pub scalar_offset: f32,
    /// Scale of the scalar map.
    pub scalar_scale: f32,
    /// Pixels per row of the plane that is rendered, rows of it.
    pub size_px: [u32; 2],
    /// Tiles per row, rows of tiles.
    pub tiles: [u32; 2],
    /// Pixels per row of the image, rows of it.
    pub image_px: [u32; 2],
    /// Stride of the rendered plane in image pixels, in both directions.
    pub stride_px: [u32; 2],
    /// Depth of the near distance, counted from the pivot.
    pub near: f32,
    /// Vertices of the mesh.
    pub vertex_count: u32,
    /// Number of entry faces; they come first among the items.
    pub face_count: u32,
    /// Number of cells at the eye.
    pub eye_count: u32,
    /// Number of items: entry faces and cells at the eye.
    pub item_count: u32,
    /// Capacity in pairs of tile and item.
    pub pair_capacity: u32,
    /// First tile of the slice.
    pub first_tile: u32,
    /// Bits of [`flags`].
    pub flags: u32,
    /// Intervals of the table of the exact integrator.
    pub interval_count: u32,
    /// Depth from which the depths along rays are counted: that of the local origin if the eye is far, else 0.
    pub pivot: f32,
    /// Cells that have the scalars, which lie behind the view vertices; 0 if vertices have them.
    pub cell_count: u32,
    /// Zero, unknown to shader compilers: it keeps them from simplifying sums as if they were exact.
    pub zero: u32,
}

impl Params {
    /// The parameters of a view in local coordinates; `None` if the eye is further away than [`EYE_DISTANCE_MAX`], the view too wide
    /// for single precision, or rays are cast for listed pixels.
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
            // Clamped to the image's size, so that products with it stay small.
            stride_px: [lattice.stride_px().min(view.width_px.max(view.height_px)) as u32; 2],
            near,
            pivot,
            flags: perspective,
            ..Self::default()
        })
    }

    /// Depth from which the depths along rays are counted, from the eye, or, for parallel rays, from the camera's position; local units.
    pub fn depth_behind_eye(&self) -> f64 {
        depth_of(self.depth_origin) + f64::from(self.pivot)
    }

    /// Number of tiles.
    pub fn tile_count(&self) -> usize {
        self.tiles[0] as usize * self.tiles[1] as usize
    }
}

/// Offsets of a joint table's parts in the table's buffer, in vectors of four (`shaders/lib/optics_joint.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct JointParams {
    /// First of the scalar intervals.
    pub scalar_intervals: u32,
    /// Number of scalar intervals.
    pub scalar_count: u32,
    /// First of the row intervals.
    pub row_intervals: u32,
    /// Number of row intervals.
    pub row_count: u32,
    /// First of the values, table layer by table layer.
    pub values: u32,
    /// Values per row.
    pub columns: u32,
    /// Values per table layer.
    pub layer_values: u32,
    /// First of the cells' table layers, two cells a vector.
    pub cells: u32,
    /// Number of cells with a table layer.
    pub cell_count: u32,
}

/// A sheet of [`SurfaceParams`] (`shaders/lib/surfaces.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SheetParams {
    /// RGB of the side towards lower scalars; the mapped isovalue: scalars from it on are above.
    pub front: [f32; 4],
    /// RGB of the other side; opacity.
    pub back: [f32; 4],
}

/// The isosurfaces of a frame (`shaders/lib/surfaces.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfaceParams {
    /// Towards the light, view coordinates, of length 1.
    pub light: [f32; 3],
    /// Number of sheets.
    pub count: u32,
    /// Source of normals: 0 none, 1 the cell's gradient, 2 those of its vertices.
    pub normals: u32,
    /// 1 if light comes from the eye instead.
    pub is_headlight: u32,
    /// Index of the first gradient component among the numbers behind the view vertices.
    pub gradients: u32,
    /// 1 if the volume is visible.
    pub has_volume: u32,
    /// Sheets by ascending isovalue.
    pub sheets: [SheetParams; SURFACES_MAX],
}

/// Parameters of the decoder of codec `vq`: a step's offsets into the block, in words, and its share of a mixture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct VqStep {
    /// Vertices or cells of the mesh, whichever have the scalars.
    pub count: u32,
    /// The step's row of the first codebook.
    pub row_8: u32,
    /// The step's row of the second codebook.
    pub row_64: u32,
    /// Means of the values.
    pub means: u32,
    /// Exponents of the values, four a word; `u32::MAX` if all are zero.
    pub exponents: u32,
    /// Indices of the values into the first codebook.
    pub first: u32,
    /// Indices of the values into the second codebook.
    pub second: u32,
    /// Base-2 logarithm of the indices per word.
    pub per_word_log2: u32,
    /// Weight of the step in a mixture: three numbers, whose sum it is exactly.
    pub weight: [f32; 3],
    /// Zero, unknown to shader compilers, as in [`Params`].
    pub zero: u32,
    /// Weight in a mixture of the step that has been decoded before it.
    pub weight_before: [f32; 3],
    /// Padding.
    pub unused: u32,
}

/// Layout of the buffers of depth layers, in words (`shaders/lib/layer_lists.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerLists {
    /// Tiles of the image.
    pub tiles: u64,
    /// Depth layers per pixel.
    pub layers: u64,
}

impl LayerLists {
    /// Words before the first piece of a large face.
    pub const HEAD: u64 = 4;
    /// Word of the number of pieces found, stored or not.
    pub const PIECE_COUNT: usize = 0;
    /// Word of the first piece of the slice.
    pub const PIECES_FROM: usize = 1;
    /// Word of the piece behind the last one of the slice.
    pub const PIECES_TO: usize = 2;

    /// Words of the depths: two for the range of each tile, then the depth layers of each pixel of each tile.
    pub fn depths(self) -> u64 {
        (2 + self.layers * TILE_PIXELS as u64) * self.tiles
    }
}

/// Parameters of the upsampling stages beyond [`Params`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct UpsampleParams {
    /// Pixels per row of the small image, rows of it.
    pub small_px: [u32; 2],
    /// Pixel pitch in samples, a power of two.
    pub samples_per_pixel: f32,
    /// Radius of the kernel Omega in pixels.
    pub half_px: i32,
    /// The domain weight f at a distance d in pixels is 2^(-this * d^2).
    pub domain_per_square: f32,
    /// The range weight g at a distance d in the reference is 2^(-this * d^2).
    pub reference_per_square: f32,
    /// Padding.
    pub unused: [u32; 2],
}

/// Layout of the ray buffer of contrast-adaptive sampling, in words (`shaders/lib/ray_list.wgsl`, `ray_bits.wgsl`): a head, bits of pixels
/// that are listed and of pixels that met a cell, states of the blocks between rays, the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayLists {
    /// Width and height of the image.
    pub size_px: (usize, usize),
}

impl RayLists {
    /// Words of the head.
    pub const HEAD: usize = 36;
    /// Word of the number of rays in the list.
    pub const LISTED: usize = 0;
    /// First word of the head that is reset for each contrast: the step.
    pub const STEP: usize = 3;
    /// Word that is 1 once the walk has been given all rays.
    pub const IS_DONE: usize = 4;
    /// Word of the number of pairs of tile and item found, stored or not.
    pub const PAIRS: usize = 6;
    /// Word of the workgroups of the walk that the slice may still start.
    pub const GROUPS_LEFT: usize = 7;
    /// Word of the workgroups that the slice has started.
    pub const GROUPS_DONE: usize = 8;
    /// First of four words: rays by level.
    pub const RAYS_BY_LEVEL: usize = 9;
    /// First of five words: blocks split, by reason, and blocks filled.
    pub const BLOCKS: usize = 13;
    /// First word of the sums of the counters, two words each.
    pub const SUMS: usize = 18;
    /// Rays per workgroup of the walk.
    pub const GROUP_RAYS: usize = 256;
    /// Number of steps, at strides 16, 8, 4 and 2.
    pub const STEPS: usize = 4;

    /// Words that hold one bit per pixel.
    fn bits(self) -> u64 {
        (self.size_px.0 * self.size_px.1).div_ceil(32) as u64
    }

    /// Number of columns and rows of blocks at a stride.
    pub fn blocks(self, stride: usize) -> (usize, usize) {
        let count = |pixels: usize| pixels.saturating_sub(1).div_ceil(stride).max(1);
        (count(self.size_px.0), count(self.size_px.1))
    }

    /// Offset of the bits of listed pixels.
    pub fn listed(self) -> u64 {
        Self::HEAD as u64
    }

    /// Offset of the bits of pixels whose rays met an active cell.
    pub fn met(self) -> u64 {
        self.listed() + self.bits()
    }

    /// Offsets of the block states at strides 8, 4 and 2, and the offset behind them.
    pub fn states(self) -> [u64; 4] {
        let mut at = self.met() + self.bits();
        [8, 4, 2, 1].map(|stride| {
            let begin = at;
            let (columns, rows) = self.blocks(stride);
            at += (columns * rows) as u64;
            begin
        })
    }

    /// Offset of the list, with room for one ray per pixel.
    pub fn list(self) -> u64 {
        self.states()[3]
    }

    /// Number of words of the buffer.
    pub fn end(self) -> u64 {
        self.list() + (self.size_px.0 * self.size_px.1) as u64
    }
}

/// Parameters of contrast-adaptive sampling beyond [`Params`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RayParams {
    /// Contrast above which a block is split.
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
    /// The offsets for an image (a buffer holds it, so that they fit in u32), and a contrast.
    pub fn new(lists: RayLists, contrast: f32) -> Self {
        let [listed_at, met_at, list_at] = [lists.listed(), lists.met(), lists.list()].map(|at| at as u32);
        Self { contrast, listed_at, met_at, list_at, states_at: lists.states().map(|at| at as u32) }
    }
}

/// The depth stored as a sum of two.
pub fn depth_of(parts: [f32; 2]) -> f64 {
    f64::from(parts[0]) + f64::from(parts[1])
}

/// `x` as a sum of two f32, right to 2^-48 of itself.
pub fn two_parts(x: f64) -> [f32; 2] {
    let first = x as f32;
    [first, (x - f64::from(first)) as f32]
}

/// Texels in a row of a texture that holds a list: a quarter of what every device has.
pub const TEXELS_WIDE: usize = 2048;

/// Base of the numbers of two digits, each of which is an f32.
pub const COUNT_BASE: u32 = 1 << 16;

/// Two numbers in two digits each.
pub fn integer_digits(numbers: [u32; 2]) -> [f32; 4] {
    let [first, second] = numbers.map(|number| [(number / COUNT_BASE) as f32, (number % COUNT_BASE) as f32]);
    [first[0], first[1], second[0], second[1]]
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
