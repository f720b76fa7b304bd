// What the fragments of faces are sorted by. Twin: point_order.wgsl.

struct Key {
    depth: vec2<f32>,
    rank: u32,
}

fn key_of(fragment: Fragment) -> Key {
    return Key(fragment.depth, fragment.rank);
}

fn key_at(slot: u32) -> Key {
    return Key(depth_at(slot), rank_at(slot));
}

// Whether a fragment comes before `other`: in exact order by depth, then rank; else by rank.
fn comes_before(key: Key, other: u32) -> bool {
    if (list_params.flags & EXACT_ORDER) != 0u {
        let there = depth_at(other);
        if key.depth.x != there.x {
            return key.depth.x < there.x;
        }
        if key.depth.y != there.y {
            return key.depth.y < there.y;
        }
    }
    return key.rank < rank_at(other);
}
