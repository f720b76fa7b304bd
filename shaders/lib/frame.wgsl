// Shared by all stages: the parameters of a frame, view vertices, and constants.
// The Rust twins are in src/render/gpu/layout.rs; a test compares every offset.

struct Params {
    // Eye in local units, as an unevaluated sum.
    eye_hi: vec4<f32>,
    eye_lo: vec4<f32>,
    // Unit vectors right, up, forward; each as the sum of three parts, the first two of 12 bits.
    axes: array<vec4<f32>, 9>,
    // Half the pixel pitch on the image plane times PLANE_SCALE: x as a sum of two, y as a sum of two.
    pitch: vec4<f32>,
    // Depth from which depths are counted: the eye's, or, for parallel rays, that of the local origin, as a sum of two.
    depth_origin: vec2<f32>,
    // The scalar map: (scalar - offset) * scale.
    scalar_offset: f32,
    scalar_scale: f32,
    // Pixels per row of the plane that is rendered, rows of it.
    size_px: vec2<u32>,
    // Tiles per row, rows of tiles.
    tiles: vec2<u32>,
    // Pixels per row of the image, rows of it; those whose column and row are multiples of the stride, or the last, make the plane.
    image_px: vec2<u32>,
    stride_px: vec2<u32>,
    // Depth of the near distance, counted from the pivot.
    near: f32,
    vertex_count: u32,
    // Numbers of items: first entry faces, then cells at the eye, each a word and the eye's sides of its faces.
    face_count: u32,
    eye_count: u32,
    item_count: u32,
    // Capacity in pairs of tile and item.
    pair_capacity: u32,
    // First tile of the slice.
    first_tile: u32,
    flags: u32,
    // Intervals of the table of the exact integrator.
    interval_count: u32,
    // Depth from which the depths along rays are counted: that of the middle of the mesh if the eye is far, else 0.
    pivot: f32,
    // Cells that have the scalars, which lie behind the view vertices (behind_vertices.wgsl); 0 if vertices have them.
    cell_count: u32,
    // Zero, unknown to compilers.
    zero: u32,
}

// The pixel at a place in the plane that is rendered.
fn pixel_at(place: vec2<u32>) -> vec2<u32> {
    return min(place * params.stride_px, params.image_px - vec2(1u));
}

// Flags.
const PERSPECTIVE: u32 = 1u;
const EARLY_TERMINATION: u32 = 2u;
const ALL_ACTIVE: u32 = 4u;

// Factor 2^30 of x and y, so that products of four of them and their rounding errors neither over- nor underflow.
const PLANE_SCALE: f32 = 1073741824.0;

// A vertex in view coordinates.
struct ViewVertex {
    // x and y times PLANE_SCALE, as sums: x, rest of x, y, rest of y.
    plane: vec4<f32>,
    // Depth as a sum of three, the first of 12 bits; scalar.
    depth: vec4<f32>,
}

const TILE_PX: u32 = 16u;

// Words of a (tile, item) pair: the item, and its box in the tile.
const PAIR_WORDS: u32 = 2u;
// In the second word: the item is a cell at the eye.
const EYE_CELL: u32 = 0x10000u;
// From this bit on: the eye's side of each of the cell's faces (outside: bits 0 to 3; strictly inside: bits 4 to 7).
const SIDES_SHIFT: u32 = 17u;

// No neighbour.
const NONE: u32 = 0xffffffffu;

// Returns x unchanged, hidden from the compiler. Without it drivers simplify (a + b) - a to b (Mesa's do), or round a product
// and a sum only once.
fn opaque(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ params.zero);
}

// The leading 12 bits of a mantissa: products of two such are exact. Masked, not computed: no compiler can undo it.
fn leading(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) & 0xfffff000u);
}
