// Parameters and constants of the stages that list fragments, those of faces or of points. The Rust twins are in
// src/render/gpu/layout.rs.

struct ListParams {
    // Number of elements (faces, or cells) in the list.
    drawn_count: u32,
    // Number of cells at the eye; their records come behind the list.
    eye_count: u32,
    // First unit (element, piece or tile) of the slice, and the unit behind its last.
    first: u32,
    end: u32,
    // Tiles of the band, and pixels of each tile (not all in a band within one tile); the ends are exclusive.
    first_tile: u32,
    end_tile: u32,
    first_pixel: u32,
    end_pixel: u32,
    // Faces per binding.
    face_part: u32,
    // Capacity of the first binding in fragments.
    fragment_part: u32,
    // Capacity in pieces.
    piece_capacity: u32,
    // Fragments in a pixel's k-buffer; for depth layers their number.
    k: u32,
    // Depth difference, local units, below which fragments may be in the wrong order.
    tie: f32,
    flags: u32,
    // The bits in which the places of two compared fragments differ, in a round of sorting.
    sort_mask: u32,
    unused: u32,
}

// Flags: all faces of the active cells are drawn; fragments are sorted completely by depth.
const COMPLETE: u32 = 1u;
const EXACT_ORDER: u32 = 2u;

const TILE_PIXELS: u32 = 256u;

// Number of fragments above which those of a pixel are sorted before the resolve stage.
const DEEP: u32 = 1024u;

// Words of a face: three corners, ascending; the cell in front of it and the one behind it, for a ray that sees them
// counter-clockwise.
const FACE_WORDS: u32 = 5u;
// Words of a cell at the eye: the cell, bits, corners, ascending. Bits, for face i opposite corner i: i, the eye is outside
// the face; 4 + i, strictly inside; 8 + i, the face has one active cell; 12 + i, a ray that sees its corners counter-clockwise
// enters the cell.
const EYE_WORDS: u32 = 6u;
// Words of a cell at the eye that is a point: the cell; bits, for face i opposite corner i: i, the eye is outside the face; 4 + i, strictly
// inside.
const POINT_EYE_WORDS: u32 = 2u;
// FRAGMENT_PAIRS, the pairs of words of a fragment, is prepended by `Stage::source`: `Fragment` in this order, with values only for a joint
// table.
const JOINT_PAIRS: u32 = 4u;
// Words of a piece of an element with a large box: the element's place in the list, a tile.
const PIECE_WORDS: u32 = 2u;

// Where a ray meets an element.
struct Fragment {
    // Depth as `Params` counts, as a sum of two: of a face; of a cell's entry; else of the middle of a point.
    depth: vec2<f32>,
    scalar: f32,
    // Place of the element in the list; cells at the eye come before it.
    rank: u32,
    // Of a face the cells left and entered; of a point its scalar at the exit, and its thickness in depth.
    more: vec2<u32>,
    // With a joint table, the value at vertices there; of a point, at entry and exit.
    values: vec2<f32>,
}
