// Walk, all rays of an image: a workgroup is a tile, a thread a pixel. The walk itself is in lib/walk.wgsl.

// Unused here: no ray depends on whether others met a cell.
fn note_met(pixel: vec2<u32>) {}

// Pixel of a thread in its tile: neighbouring threads work on squares of pixels.
fn pixel_in_tile(thread: u32) -> vec2<u32> {
    return vec2(
        (thread & 1u) | ((thread >> 1u) & 2u) | ((thread >> 2u) & 4u) | ((thread >> 3u) & 8u),
        ((thread >> 1u) & 1u) | ((thread >> 2u) & 2u) | ((thread >> 3u) & 4u) | ((thread >> 4u) & 8u),
    );
}

@compute @workgroup_size(256)
fn walk(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = params.first_tile + group.x;
    let local = pixel_in_tile(thread);
    let pixel = vec2(tile % params.tiles.x, tile / params.tiles.x) * TILE_PX + local;
    if all(pixel < params.size_px) {
        render_pixel(tile, local, pixel);
    }
    workgroupBarrier();
    if thread < COUNTERS {
        counters[tile * COUNTERS + thread] = atomicLoad(&counts[thread]);
    }
}
