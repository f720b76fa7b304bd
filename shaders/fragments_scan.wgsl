// Fragments scan: turns the fragment count of each pixel into the place of its first fragment in its tile; a workgroup is a tile.
// The host sums up the tiles, divides them into bands, and decides whether deep pixels are sorted first.

var<workgroup> sums: array<u32, TILE_PIXELS>;
var<workgroup> deepest: atomic<u32>;

@compute @workgroup_size(256)
fn fragments_scan(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = group.x + group.y * groups.x;
    if tile >= tile_count() {
        return;
    }
    sums[local] = lists[pixel_of(tile, local)];
    atomicMax(&deepest, sums[local]);
    workgroupBarrier();
    for (var step = 1u; step < TILE_PIXELS; step *= 2u) {
        var before = 0u;
        if local >= step {
            before = sums[local - step];
        }
        workgroupBarrier();
        sums[local] = add_up(sums[local], before);
        workgroupBarrier();
    }
    var place = 0u;
    if local > 0u {
        place = sums[local - 1u];
    }
    lists[pixel_of(tile, local)] = place;
    if local == TILE_PIXELS - 1u {
        lists[sum_of(tile)] = sums[local];
        lists[base_of(tile)] = atomicLoad(&deepest);
    }
}
