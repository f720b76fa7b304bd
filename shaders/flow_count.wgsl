// Flow, second part: counts the splats that reach each tile. entries_scan.wgsl turns the counts into places.

fn visit_tile(tile: u32, number: u32) {
    atomicAdd(&bins[tile], 1u);
}

@compute @workgroup_size(64)
fn flow_count(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = id.x + id.y * groups.x * 64u;
    if number < flow_params.splat_count {
        visit_tiles(number);
    }
}
