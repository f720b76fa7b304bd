// Cuts large faces into pieces, one a tile, for passes over the whole image.

// More pieces than any capacity: counting stops there, so that the number does not overflow.
const TOO_MANY: u32 = 0x40000000u;

// Appends the pieces of a large face. If they do not fit, the host begins the frame again with a longer list.
fn cut(rank: u32, box: vec4<u32>) {
    let tiles = box / TILE_PX;
    let count = (tiles.y - tiles.x + 1u) * (tiles.w - tiles.z + 1u);
    if atomicLoad(&lists[PIECE_COUNT]) > TOO_MANY {
        return;
    }
    var piece = atomicAdd(&lists[PIECE_COUNT], count);
    for (var y = tiles.z; y <= tiles.w; y++) {
        for (var x = tiles.x; x <= tiles.y; x++) {
            if piece < list_params.piece_capacity {
                atomicStore(&lists[piece_at(piece)], rank);
                atomicStore(&lists[piece_at(piece) + 1u], y * params.tiles.x + x);
            }
            piece += 1u;
        }
    }
}

// The whole image is one band.
fn is_in_band(tile: u32, local: u32) -> bool {
    return true;
}

// Rows of the band.
fn band_rows() -> vec2<i32> {
    return vec2(0, i32(params.size_px.y) - 1);
}
