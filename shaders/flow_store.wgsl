// Flow, third part: stores the numbers of the splats of each tile. Afterwards bins[t] is where those of tile t end. Their order within a tile
// depends on the scheduling of threads, until flow_sort.wgsl.

fn visit_tile(tile: u32, number: u32) {
    let place = atomicAdd(&bins[tile], 1u);
    // If places do not fit, the host reads from the total how many there are, and renders the frame again.
    if place < flow_params.place_capacity {
        atomicStore(&bins[BINS_HEAD + params.tiles.x * params.tiles.y + place], number);
    }
}

@compute @workgroup_size(64)
fn flow_store(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = id.x + id.y * groups.x * 64u;
    if number < flow_params.splat_count {
        visit_tiles(number);
    }
}
