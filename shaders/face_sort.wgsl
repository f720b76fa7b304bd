// Face sort: one round of a bitonic sorting network over the fragments of all deep pixels; a workgroup is a tile, all its
// threads work on one pixel after the other. One thread alone would take too long: systems reset a GPU that does not answer,
// and software drivers abort loops after a number of rounds.
//
// The network (Batcher, "Sorting networks and their applications", 1968) in the form in which all comparisons point the same
// way: a fragment is compared with the one whose place differs in the bits of `sort_mask`. Lists may have any length: places
// behind the end count as the greatest, and stay there.

@compute @workgroup_size(256)
fn face_sort(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = face_params.first_tile + group.x + group.y * groups.x;
    if tile >= face_params.end_tile {
        return;
    }
    let by_depth = (face_params.flags & EXACT_ORDER) != 0u;
    let mask = face_params.sort_mask;
    // The highest bit in which the two places differ: the nearer place has it unset.
    let bit = firstLeadingBit(mask);
    let below = (1u << bit) - 1u;
    for (var local = face_params.first_pixel; local < face_params.end_pixel; local++) {
        let fragments = fragments_of(tile, local);
        if fragments.y <= DEEP {
            continue;
        }
        for (var i = thread; ; i += 256u) {
            let near = ((i & ~below) << 1u) | (i & below);
            if near >= fragments.y {
                break;
            }
            let far = near ^ mask;
            if far < fragments.y {
                exchange(fragments.x + near, fragments.x + far, by_depth);
            }
        }
    }
}

// Puts the fragment that comes first in the first slot.
fn exchange(first: u32, second: u32, by_depth: bool) {
    if comes_before(depth_at(second), pair(second, 1u).y, first, by_depth) {
        let moving = load_stored(first);
        store(first, load_stored(second));
        store(second, moving);
    }
}
