// Fragments resolve: orders and composites the fragments of each pixel, as lib/face_paths.wgsl or lib/point_light.wgsl has it.
//
// A workgroup is a tile, a thread a pixel; it sorts its fragments where they lie. Those of deep pixels have been sorted
// (fragments_sort.wgsl).

fn resolve_pixel(tile: u32, local: u32, pixel: vec2<u32>) {
    ray_counts = Rays(false, false, false, 0u);
    light_transparent(ray_of_pixel(pixel));
    ahead_begin(pixel);
    let fragments = fragments_of(tile, local);
    let first = fragments.x;
    let count = fragments.y;
    if count <= DEEP {
        sort(first, count);
    }
    gather(first, count);
    meet_rest();
    textureStore(color_plane, pixel, optics.light);
    textureStore(depth_plane, pixel, vec4(light.visible_from, 0.0, 0.0, 0.0));
    if count > 0u {
        atomicAdd(&counts[SEGMENTS], optics.pieces);
        atomicAdd(&counts[RAYS_HIT], u32(ray_counts.hit));
        atomicAdd(&counts[STOPPED_EARLY], u32(ray_counts.stopped_early));
        atomicAdd(&counts[OUT_OF_ORDER], ray_counts.out_of_order);
        atomicAdd(&counts[BROKEN], u32(ray_counts.broken));
    }
}

@compute @workgroup_size(256)
fn fragments_resolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = list_params.first + group.x + group.y * groups.x;
    let pixel = pixel_of_thread(tile, local);
    let is_wanted = local >= list_params.first_pixel && local < list_params.end_pixel;
    if tile < list_params.end && is_wanted && all(pixel < params.size_px) {
        resolve_pixel(tile, local, pixel);
    }
    workgroupBarrier();
    if tile < list_params.end && local < COUNTERS {
        counters[tile * COUNTERS + local] = atomicLoad(&counts[local]);
    }
}
