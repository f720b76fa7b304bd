// Walk, the rays of a list: a thread is a ray, whatever tile its pixel is in, so that workgroups are full at any stride. The walk itself
// is in lib/walk.wgsl.

fn note_met(pixel: vec2<u32>) {
    let number = number_of(pixel);
    atomicOr(&rays[ray_params.met_at + (number >> 5u)], 1u << (number & 31u));
}

// Adds to a 64-bit sum of two words, the lower one first.
fn add_to_sum(at: u32, count: u32) {
    let before = atomicAdd(&rays[at], count);
    if before > 0xffffffffu - count {
        atomicAdd(&rays[at + 1u], 1u);
    }
}

@compute @workgroup_size(256)
fn walk_rays(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let ray = atomicLoad(&rays[FIRST]) + group.x * GROUP_RAYS + thread;
    if ray < atomicLoad(&rays[CAST]) {
        let number = atomicLoad(&rays[ray_params.list_at + ray]);
        let pixel = vec2(number % params.size_px.x, number / params.size_px.x);
        let tile = pixel / TILE_PX;
        render_pixel(tile.y * params.tiles.x + tile.x, pixel % TILE_PX, pixel);
    }
    workgroupBarrier();
    if thread < COUNTERS {
        add_to_sum(SUMS + 2u * thread, atomicLoad(&counts[thread]));
    }
}
