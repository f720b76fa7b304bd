// Fragments find: tests each element of the list against the pixels of its box. CPU twins: render/cpu/raster, render/cpu/points.

@compute @workgroup_size(64)
fn fragments_find(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let rank = list_params.first + id.x + id.y * groups.x * 64u;
    if rank < list_params.end {
        find(rank);
    }
    end_notes(id.x % 64u);
}

fn find(rank: u32) {
    let element = listed_element(rank);
    let box = box_of(element);
    let is_empty = box.x > box.y || box.z > box.w;
    note(element, is_empty);
    if is_empty {
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
        hit_pixels(rank, element, vec4(vec2<u32>(box.xy), u32(first), u32(last)));
    }
}
