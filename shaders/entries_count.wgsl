// Entries, first part: how many items meet each tile. CPU twin: render/cpu/raycast/entries.rs, `TileBins::fill`.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> vertices: array<ViewVertex>;
@group(0) @binding(2) var<storage, read> records_0: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> records_1: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> records_2: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> items: array<u32>;
@group(0) @binding(6) var<storage, read_write> bins: array<atomic<u32>>;

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
