// Places in the lists of the face renderer. The Rust twin is `Lists` in src/render/gpu/layout.rs.
//
// In `lists`: the number of pieces; for each tile its fragments; for each tile how many its deepest pixel has, then where its
// first one is, before the tile's first pixel; for each pixel of each tile how many fragments it has, then where they begin in the
// tile, then where they end; the pieces.
const PIECE_COUNT: u32 = 0u;
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
