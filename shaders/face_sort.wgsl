// Face sort: the fragments of deep pixels, one round of a bitonic sorting network for all of them; a workgroup is a tile, all
// its threads work on one pixel after the other. A thread that sorted as many alone would take too long: systems reset a GPU
// that does not answer, drivers in software give up after so many rounds of loops.
//
// The network (Batcher, "Sorting networks and their applications", 1968) in the form in which all comparisons point the same
// way: a fragment is compared with the one whose place differs in the bits of `sort_mask`. For lists of any length: what would
// lie behind the end counts as the greatest, and stays there.

@compute @workgroup_size(256)
fn face_sort(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = face_params.first_tile + group.x + group.y * groups.x;
    if tile >= face_params.end_tile {
        return;
    }
    let by_depth = (face_params.flags & EXACT_ORDER) != 0u;
    let mask = face_params.sort_mask;
    // The highest bit in which the two places differ: the nearer one has not set it.
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

// Puts the one that comes first to the first place.
fn exchange(first: u32, second: u32, by_depth: bool) {
    if comes_before(depth_at(second), pair(second, 1u).y, first, by_depth) {
        let moving = load_stored(first);
        store(first, load_stored(second));
        store(second, moving);
    }
}
