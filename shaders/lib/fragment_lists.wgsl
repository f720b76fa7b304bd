// Layout of the lists of fragments. The Rust twin is `Lists` in src/render/gpu/layout.rs.
//
// `lists` holds the number of pieces, of points without a pixel, and of points that were widened; per tile its fragment count; per tile the count of its deepest pixel, later the slot where
// the fragments of its first pixel begin; per pixel of each tile its fragment count, later where they begin in the tile, then where
// they end; the pieces.
const PIECE_COUNT: u32 = 0u;
const CULLED: u32 = 1u;
const ENLARGED: u32 = 2u;
const LISTS_HEAD: u32 = 4u;

fn sum_of(tile: u32) -> u32 {
    return LISTS_HEAD + tile;
}

fn base_of(tile: u32) -> u32 {
    return LISTS_HEAD + tile_count() + tile;
}

fn pixel_of(tile: u32, local: u32) -> u32 {
    return LISTS_HEAD + 2u * tile_count() + TILE_PIXELS * tile + local;
}

fn piece_at(piece: u32) -> u32 {
    return LISTS_HEAD + (2u + TILE_PIXELS) * tile_count() + PIECE_WORDS * piece;
}
