// Bits of pixels in the buffer of rays: whether the pixel's ray is in the list, and whether it met an active cell.

struct RayParams {
    // Contrast above which a block is split.
    contrast: f32,
    // Offsets of the bits of listed pixels, of the bits of pixels that met a cell, and of the list, in words.
    listed_at: u32,
    met_at: u32,
    list_at: u32,
    // Offsets of the block states of steps 2, 3 and 4, and the offset behind them.
    states_at: vec4<u32>,
}

// Row times the width of the image plus column.
fn number_of(pixel: vec2<u32>) -> u32 {
    return pixel.y * params.size_px.x + pixel.x;
}
