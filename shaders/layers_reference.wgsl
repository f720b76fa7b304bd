// Layers reference: maps depth layers for filters to compare, from 0, the nearest depth of the boundary in view, to 1, the farthest.
// CPU twin: render/cpu/layers/mod.rs, `reference`. A workgroup is a tile.

// Value of a missing depth layer.
const MISSING: f32 = 2.0;

@compute @workgroup_size(256)
fn layers_reference(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = params.first_tile + group.x;
    let pixel = pixel_of_thread(tile, thread);
    if any(pixel >= params.size_px) {
        return;
    }
    let extent = depth_range[1] - depth_range[0];
    let at = layers_at(tile, thread);
    var layers = vec4(MISSING);
    for (var layer = 0u; layer < list_params.k; layer++) {
        let nearness = depths[at + layer];
        if nearness != 0u {
            // An empty range counts as having extent 1.
            layers[layer] = (depth_of_nearness(nearness) - depth_range[0]) / select(1.0, extent, extent > 0.0);
        }
    }
    textureStore(reference_plane, pixel, layers);
}
