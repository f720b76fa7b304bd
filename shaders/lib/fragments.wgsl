// Access to stored fragments by slot.

fn pair(slot: u32, i: u32) -> vec2<u32> {
    let part = list_params.fragment_part;
    if slot < part {
        return fragments_0[FRAGMENT_PAIRS * slot + i];
    }
    return fragments_1[FRAGMENT_PAIRS * (slot - part) + i];
}

fn fragment_of(depth: vec2<u32>, scalar_rank: vec2<u32>, more: vec2<u32>) -> Fragment {
    return Fragment(bitcast<vec2<f32>>(depth), bitcast<f32>(scalar_rank.x), scalar_rank.y, more, vec2(0.0));
}

fn load_stored(slot: u32) -> Fragment {
    let part = list_params.fragment_part;
    if slot < part {
        let at = FRAGMENT_PAIRS * slot;
        var stored = fragment_of(fragments_0[at], fragments_0[at + 1u], fragments_0[at + 2u]);
        if FRAGMENT_PAIRS == JOINT_PAIRS {
            stored.values = bitcast<vec2<f32>>(fragments_0[at + 3u]);
        }
        return stored;
    }
    let at = FRAGMENT_PAIRS * (slot - part);
    var stored = fragment_of(fragments_1[at], fragments_1[at + 1u], fragments_1[at + 2u]);
    if FRAGMENT_PAIRS == JOINT_PAIRS {
        stored.values = bitcast<vec2<f32>>(fragments_1[at + 3u]);
    }
    return stored;
}

fn store(slot: u32, stored: Fragment) {
    let part = list_params.fragment_part;
    let scalar_rank = vec2(bitcast<u32>(stored.scalar), stored.rank);
    if slot < part {
        let at = FRAGMENT_PAIRS * slot;
        fragments_0[at] = bitcast<vec2<u32>>(stored.depth);
        fragments_0[at + 1u] = scalar_rank;
        fragments_0[at + 2u] = stored.more;
        if FRAGMENT_PAIRS == JOINT_PAIRS {
            fragments_0[at + 3u] = bitcast<vec2<u32>>(stored.values);
        }
    } else {
        let at = FRAGMENT_PAIRS * (slot - part);
        fragments_1[at] = bitcast<vec2<u32>>(stored.depth);
        fragments_1[at + 1u] = scalar_rank;
        fragments_1[at + 2u] = stored.more;
        if FRAGMENT_PAIRS == JOINT_PAIRS {
            fragments_1[at + 3u] = bitcast<vec2<u32>>(stored.values);
        }
    }
}

fn depth_at(slot: u32) -> vec2<f32> {
    return bitcast<vec2<f32>>(pair(slot, 0u));
}

fn rank_at(slot: u32) -> u32 {
    return pair(slot, 1u).y;
}

// The value at vertices, interpolated at a fragment; 0 without a joint table.
fn value_at(slot: u32) -> f32 {
    if FRAGMENT_PAIRS == JOINT_PAIRS {
        return bitcast<f32>(pair(slot, 3u).x);
    }
    return 0.0;
}
