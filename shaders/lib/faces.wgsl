// What the stages of the face renderer share. The Rust twins are in src/render/gpu/layout.rs.

struct FaceParams {
    // Faces of the list.
    drawn_count: u32,
    // Cells at the eye: their records come behind the list.
    eye_count: u32,
    // First unit of the slice, and the one behind its last: faces, pieces or tiles.
    first: u32,
    end: u32,
    // The band: tiles, and of a band within one tile its pixels.
    first_tile: u32,
    end_tile: u32,
    first_pixel: u32,
    end_pixel: u32,
    // Faces of a binding.
    face_part: u32,
    // Fragments of the first binding.
    fragment_part: u32,
    // Pieces that there is room for.
    piece_capacity: u32,
    // Fragments that the buffer of a pixel holds back.
    k: u32,
    // Depths closer than that may be in the wrong order.
    tie: f32,
    flags: u32,
    // Of a round of sorting: the bits in which the places of two fragments that are compared differ.
    sort_mask: u32,
    unused: u32,
}

// Flags: all faces of the active cells are drawn; fragments are put in order whatever it takes.
const COMPLETE: u32 = 1u;
const EXACT_ORDER: u32 = 2u;

const TILE_PIXELS: u32 = 256u;

// Pixels with more fragments are sorted before they are resolved.
const DEEP: u32 = 1024u;

// Words of a face: three corners, ascending; the cell in front of it and the one behind it, for a ray that sees them
// counter-clockwise.
const FACE_WORDS: u32 = 5u;
// Words of a cell at the eye: the cell, bits, corners, ascending. Bits, for face i opposite corner i: i, the eye is outside
// the face; 4 + i, strictly inside; 8 + i, the face has one active cell; 12 + i, a ray that sees its corners counter-clockwise
// enters the cell.
const EYE_WORDS: u32 = 6u;
// FRAGMENT_PAIRS, the pairs of words of a fragment, comes from the composition. Depth as a sum of two; scalar, rank; cell left,
// cell entered; with a joint table, the quantity of vertices and nothing.
const JOINT_PAIRS: u32 = 4u;
// Words of a piece of a large face: its place in the list, a tile.
const PIECE_WORDS: u32 = 2u;
