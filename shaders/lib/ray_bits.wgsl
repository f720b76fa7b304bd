// Bits of pixels in the buffer of rays: whether a ray is in the list, and whether one that was cast met an active cell.

struct RayParams {
    // The contrast that splits blocks.
    contrast: f32,
    // Words before the bits of what is listed, of what has met a cell, and before the list.
    listed_at: u32,
    met_at: u32,
    list_at: u32,
    // Words before the states of the blocks of steps 2, 3 and 4.
    states_at: vec4<u32>,
}

// Row times the width of the image plus column.
fn number_of(pixel: vec2<u32>) -> u32 {
    return pixel.y * params.size_px.x + pixel.x;
}
