// Each pixel takes the colour of the nearest sample. CPU twin: image/upsample/nearest.rs.

@compute @workgroup_size(256)
fn upsample_nearest(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let pixel = pixel_of_thread(params.first_tile + group.x, thread);
    if all(pixel < params.size_px) {
        textureStore(color_plane, pixel, textureLoad(small_color, nearest_to(pixel), 0));
        store_depth(pixel);
    }
}
