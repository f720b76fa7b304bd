// The joint bilateral filter on the image that is bilinear. CPU twin: image/upsample/joint.rs.

@compute @workgroup_size(256)
fn upsample_joint(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let pixel = vec2<i32>(pixel_of_thread(params.first_tile + group.x, thread));
    let size = vec2<i32>(params.size_px);
    if any(pixel >= size) {
        return;
    }
    let here = textureLoad(reference, pixel, 0).xyz;
    // Omega, cropped at the image's border.
    let first = max(pixel - upsample_params.half_px, vec2(0));
    let last = min(pixel + upsample_params.half_px, size - 1);
    var sum = vec4(0.0);
    var weights = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        var of_row = vec4(0.0);
        var weights_of_row = 0.0;
        for (var x = first.x; x <= last.x; x++) {
            let there = vec2(x, y);
            let apart = textureLoad(reference, there, 0).xyz - here;
            let away = vec2<f32>(there - pixel);
            let t = dot(away, away) * upsample_params.domain_per_square + dot(apart, apart) * upsample_params.reference_per_square;
            let weight = exp2(-t);
            of_row += weight * textureLoad(enlarged, there, 0);
            weights_of_row += weight;
        }
        sum += of_row;
        weights += weights_of_row;
    }
    // The pixel itself has the weight 1.
    textureStore(color_plane, pixel, sum / weights);
}
