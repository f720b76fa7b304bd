// Fill: pixels whose rays were cast take the colour and depth of these; the others are interpolated from the rays at the corners of their
// block. CPU twin: render/adaptive/mod.rs, `fill_block`, and blocks.rs, `mix`. A workgroup is a tile.

// The block of a step that owns a pixel: the last block of a row or column owns the last pixel, too.
fn owner_of(step: u32, pixel: vec2<u32>) -> vec2<u32> {
    let stride = stride_of(step);
    return min(pixel / stride, block_counts(stride) - vec2(1u));
}

fn is_split(step: u32, block: vec2<u32>) -> bool {
    return rays[state_at(step, block)] > OPEN;
}

@compute @workgroup_size(256)
fn fill(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = params.first_tile + group.x;
    let corner = vec2(tile % params.tiles.x, tile / params.tiles.x) * TILE_PX;
    let pixel = corner + vec2(thread % TILE_PX, thread / TILE_PX);
    if any(pixel >= params.size_px) {
        return;
    }
    let number = number_of(pixel);
    if ((rays[ray_params.listed_at + (number >> 5u)] >> (number & 31u)) & 1u) != 0u {
        textureStore(color_plane, pixel, textureLoad(seen_color, pixel, 0));
        textureStore(depth_plane, pixel, textureLoad(seen_depth, pixel, 0));
        return;
    }
    var step = 2u;
    var block = owner_of(step, pixel);
    while step < LAST_STEP && is_split(step, block) {
        step += 1u;
        block = owner_of(step, pixel);
    }
    let ends = corners_of(step, block);
    let size = ends.zw - ends.xy;
    let at = pixel - ends.xy;
    let share = vec2<f32>(at) / vec2<f32>(max(size, vec2(1u)));
    let a = textureLoad(seen_color, ends.xy, 0);
    let b = textureLoad(seen_color, ends.zy, 0);
    let c = textureLoad(seen_color, ends.xw, 0);
    let d = textureLoad(seen_color, ends.zw, 0);
    let above = a + (b - a) * share.x;
    let below = c + (d - c) * share.x;
    textureStore(color_plane, pixel, above + (below - above) * share.y);
    // In integers: which of two corners is nearer must not depend on how a driver divides.
    let nearest = select(ends.xy, ends.zw, 2u * at > size);
    textureStore(depth_plane, pixel, textureLoad(seen_depth, nearest, 0));
}
