// Fragments sort: one round of a bitonic sorting network over the fragments of all deep pixels; a workgroup is a tile, all its
// threads work on one pixel after the other. One thread alone would take too long: systems reset a GPU that does not answer,
// and software drivers abort loops after a number of rounds. The network is in lib/network.wgsl.

@compute @workgroup_size(256)
fn fragments_sort(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = list_params.first_tile + group.x + group.y * groups.x;
    if tile >= list_params.end_tile {
        return;
    }
    let mask = list_params.sort_mask;
    for (var local = list_params.first_pixel; local < list_params.end_pixel; local++) {
        let fragments = fragments_of(tile, local);
        if fragments.y <= DEEP {
            continue;
        }
        for (var i = thread; ; i += 256u) {
            let near = near_place(i, mask);
            if near >= fragments.y {
                break;
            }
            let far = near ^ mask;
            if far < fragments.y {
                exchange(fragments.x + near, fragments.x + far);
            }
        }
    }
}

// Puts the fragment that comes first in the first slot.
fn exchange(first: u32, second: u32) {
    if comes_before(key_at(second), first) {
        let moving = load_stored(first);
        store(first, load_stored(second));
        store(second, moving);
    }
}
