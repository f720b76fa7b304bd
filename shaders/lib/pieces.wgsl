// Large faces in pieces, one a tile, for passes about all of the image.

// More pieces than there can be room for: their number stays there, and does not run over.
const TOO_MANY: u32 = 0x40000000u;

// Has a large face done in pieces. If there is no room for them, the frame is begun again with more.
fn cut(rank: u32, box: vec4<u32>) {
    let tiles = box / TILE_PX;
    let count = (tiles.y - tiles.x + 1u) * (tiles.w - tiles.z + 1u);
    if atomicLoad(&lists[PIECE_COUNT]) > TOO_MANY {
        return;
    }
    var piece = atomicAdd(&lists[PIECE_COUNT], count);
    for (var y = tiles.z; y <= tiles.w; y++) {
        for (var x = tiles.x; x <= tiles.y; x++) {
            if piece < face_params.piece_capacity {
                atomicStore(&lists[piece_at(piece)], rank);
                atomicStore(&lists[piece_at(piece) + 1u], y * params.tiles.x + x);
            }
            piece += 1u;
        }
    }
}

// There is one band, the image.
fn is_in_band(tile: u32, local: u32) -> bool {
    return true;
}

// Rows of the band.
fn band_rows() -> vec2<i32> {
    return vec2(0, i32(params.size_px.y) - 1);
}
