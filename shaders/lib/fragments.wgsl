// Access to stored fragments by slot.

// A fragment as it is stored.
struct Stored {
    depth: vec2<u32>,
    scalar_rank: vec2<u32>,
    cells: vec2<u32>,
    // With a joint table, the value at vertices and padding.
    value: vec2<u32>,
}

fn pair(slot: u32, i: u32) -> vec2<u32> {
    let part = face_params.fragment_part;
    if slot < part {
        return fragments_0[FRAGMENT_PAIRS * slot + i];
    }
    return fragments_1[FRAGMENT_PAIRS * (slot - part) + i];
}

fn load_stored(slot: u32) -> Stored {
    let part = face_params.fragment_part;
    if slot < part {
        let at = FRAGMENT_PAIRS * slot;
        var stored = Stored(fragments_0[at], fragments_0[at + 1u], fragments_0[at + 2u], vec2(0u));
        if FRAGMENT_PAIRS == JOINT_PAIRS {
            stored.value = fragments_0[at + 3u];
        }
        return stored;
    }
    let at = FRAGMENT_PAIRS * (slot - part);
    var stored = Stored(fragments_1[at], fragments_1[at + 1u], fragments_1[at + 2u], vec2(0u));
    if FRAGMENT_PAIRS == JOINT_PAIRS {
        stored.value = fragments_1[at + 3u];
    }
    return stored;
}

fn store(slot: u32, stored: Stored) {
    let part = face_params.fragment_part;
    if slot < part {
        let at = FRAGMENT_PAIRS * slot;
        fragments_0[at] = stored.depth;
        fragments_0[at + 1u] = stored.scalar_rank;
        fragments_0[at + 2u] = stored.cells;
        if FRAGMENT_PAIRS == JOINT_PAIRS {
            fragments_0[at + 3u] = stored.value;
        }
    } else {
        let at = FRAGMENT_PAIRS * (slot - part);
        fragments_1[at] = stored.depth;
        fragments_1[at + 1u] = stored.scalar_rank;
        fragments_1[at + 2u] = stored.cells;
        if FRAGMENT_PAIRS == JOINT_PAIRS {
            fragments_1[at + 3u] = stored.value;
        }
    }
}

fn depth_at(slot: u32) -> vec2<f32> {
    return bitcast<vec2<f32>>(pair(slot, 0u));
}

// The value at vertices, interpolated at a fragment; 0 without a joint table.
fn value_at(slot: u32) -> f32 {
    if FRAGMENT_PAIRS == JOINT_PAIRS {
        return bitcast<f32>(pair(slot, 3u).x);
    }
    return 0.0;
}

// Whether a fragment comes before `other`: by depth, then rank, if `by_depth`; else by rank.
fn comes_before(depth: vec2<f32>, rank: u32, other: u32, by_depth: bool) -> bool {
    if by_depth {
        let there = depth_at(other);
        if depth.x != there.x {
            return depth.x < there.x;
        }
        if depth.y != there.y {
            return depth.y < there.y;
        }
    }
    return rank < pair(other, 1u).y;
}
