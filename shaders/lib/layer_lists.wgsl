// Layout of the buffers of depth layers. The Rust twin is `LayerLists` in src/render/gpu/layout.rs.
//
// `lists` holds the number of pieces of large faces, the first piece of the slice, the piece behind its last, padding; the pieces.
const PIECE_COUNT: u32 = 0u;
const PIECES_FROM: u32 = 1u;
const PIECES_TO: u32 = 2u;
const LISTS_HEAD: u32 = 4u;

fn piece_at(piece: u32) -> u32 {
    return LISTS_HEAD + PIECE_WORDS * piece;
}

// `depths` holds per tile the nearness of its nearest and the farness of its farthest depth, then per pixel of each tile its depth layers
// as nearness. Nearness falls, farness rises with depth; both are above 0, which means missing.
fn range_at(tile: u32) -> u32 {
    return 2u * tile;
}

fn layers_at(tile: u32, local: u32) -> u32 {
    return 2u * tile_count() + list_params.k * (TILE_PIXELS * tile + local);
}

// An integer in the order of depths.
fn farness_of(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    return select(bits | 0x80000000u, ~bits, (bits >> 31u) == 1u);
}

// The depth of a nearness.
fn depth_of_nearness(nearness: u32) -> f32 {
    let farness = ~nearness;
    return bitcast<f32>(select(~farness, farness & 0x7fffffffu, (farness >> 31u) == 1u));
}
