// Pass `Store`: stores each fragment behind those that its pixel has so far, in any order; the resolve stage sorts them.

const NEEDS_PLACES: bool = true;

fn count_fragment(tile: u32, local: u32) {}

fn keep_fragment(tile: u32, local: u32, fragment: Fragment) {
    store(atomicLoad(&lists[base_of(tile)]) + atomicAdd(&lists[pixel_of(tile, local)], 1u), fragment);
}

fn is_in_band(tile: u32, local: u32) -> bool {
    return tile >= list_params.first_tile && tile < list_params.end_tile
        && local >= list_params.first_pixel && local < list_params.end_pixel;
}

// Rows of the band.
fn band_rows() -> vec2<i32> {
    let first = list_params.first_tile / params.tiles.x * TILE_PX;
    let end = ((list_params.end_tile - 1u) / params.tiles.x + 1u) * TILE_PX;
    return vec2(i32(first), min(i32(end), i32(params.size_px.y)) - 1);
}

// First piece of the slice, and the piece behind its last.
fn pieces_of_slice() -> vec2<u32> {
    return vec2(list_params.first, list_params.end);
}

fn cut(rank: u32, box: vec4<u32>) {}
