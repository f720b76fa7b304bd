// The tiles of the image.

fn tile_count() -> u32 {
    return params.tiles.x * params.tiles.y;
}

// The pixel of a thread of a workgroup that is a tile, row by row.
fn pixel_of_thread(tile: u32, thread: u32) -> vec2<u32> {
    return vec2(tile % params.tiles.x, tile / params.tiles.x) * TILE_PX + vec2(thread % TILE_PX, thread / TILE_PX);
}
