// Entries, first part: counts the items that meet each tile. CPU twin: render/cpu/raycast/entries.rs, `TileBins::fill`.

@compute @workgroup_size(64)
fn entries_count(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let item = id.x + id.y * groups.x * 64u;
    if item >= params.item_count {
        return;
    }
    let bounds = item_box(item);
    if bounds.x > bounds.y || bounds.z > bounds.w {
        return;
    }
    let tiles = vec4<u32>(bounds) / TILE_PX;
    for (var y = tiles.z; y <= tiles.w; y++) {
        for (var x = tiles.x; x <= tiles.y; x++) {
            atomicAdd(&bins[y * params.tiles.x + x], 1u);
        }
    }
}
