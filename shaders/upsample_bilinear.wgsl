// Bilinear interpolation of the four samples around each pixel. CPU twin: image/upsample/bilinear.rs.

@compute @workgroup_size(256)
fn upsample_bilinear(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let pixel = pixel_of_thread(params.first_tile + group.x, thread);
    if any(pixel >= params.size_px) {
        return;
    }
    let at = around(pixel);
    let a = textureLoad(small_color, at.first, 0);
    let b = textureLoad(small_color, vec2(at.last.x, at.first.y), 0);
    let c = textureLoad(small_color, vec2(at.first.x, at.last.y), 0);
    let d = textureLoad(small_color, at.last, 0);
    let above = a + (b - a) * at.share.x;
    let below = c + (d - c) * at.share.x;
    textureStore(color_plane, pixel, above + (below - above) * at.share.y);
    store_depth(pixel);
}
