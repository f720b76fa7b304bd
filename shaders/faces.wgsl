// Faces: tests each face of the list against the pixels of its box. CPU twin: render/cpu/raster.

@compute @workgroup_size(64)
fn faces(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let rank = face_params.first + id.x + id.y * groups.x * 64u;
    if rank >= face_params.end {
        return;
    }
    let face = listed_face(rank);
    let box = box_of(face);
    if box.x > box.y || box.z > box.w {
        return;
    }
    if is_large(box) {
        cut(rank, vec4<u32>(box));
        return;
    }
    let rows = band_rows();
    let first = max(box.z, rows.x);
    let last = min(box.w, rows.y);
    if first <= last {
        hit_pixels(rank, face, vec4(vec2<u32>(box.xy), u32(first), u32(last)));
    }
}
