// What the fragments of points are sorted by. CPU twin: render/cpu/points/fragment.rs. Twin: face_order.wgsl.

alias Key = Fragment;

fn key_of(fragment: Fragment) -> Key {
    return fragment;
}

fn key_at(slot: u32) -> Key {
    return load_stored(slot);
}

// Whether a fragment comes before `other`: in exact order by depth, then by thickness and scalars, so that the order does not depend on
// that of the cells, then by rank; else by rank.
fn comes_before(key: Key, other: u32) -> bool {
    if (list_params.flags & EXACT_ORDER) != 0u {
        let there = depth_at(other);
        if key.depth.x != there.x {
            return key.depth.x < there.x;
        }
        if key.depth.y != there.y {
            return key.depth.y < there.y;
        }
        let fragment = load_stored(other);
        let thickness = bitcast<vec2<f32>>(vec2(key.more.y, fragment.more.y));
        if thickness.x != thickness.y {
            return thickness.x < thickness.y;
        }
        if key.scalar != fragment.scalar {
            return key.scalar < fragment.scalar;
        }
        let exits = bitcast<vec2<f32>>(vec2(key.more.x, fragment.more.x));
        if exits.x != exits.y {
            return exits.x < exits.y;
        }
    }
    return key.rank < rank_at(other);
}
