// What lies ahead where splats of flow are drawn among fragments of other layers, which lie in front at equal depths. Twin:
// fragments_ahead.wgsl.

// Whether the next of both is a splat.
var<private> is_splat_ahead: bool;

fn ahead_begin(place: vec2<u32>) {
    splats_begin(place);
    listed = Listed(0u, 0u, vec2(NOWHERE, 0.0));
    if splats.head.z > 0.0 {
        listed_begin(place);
    }
    choose_ahead();
}

fn choose_ahead() {
    is_splat_ahead = depth_after(splats.depth, listed.depth) > 0.0;
}

fn is_some_ahead() -> bool {
    return is_splat_ahead || listed.left > 0u;
}

fn place_ahead() -> vec2<f32> {
    return select(listed.depth, splats.depth, is_splat_ahead);
}

fn light_ahead() -> vec4<f32> {
    if is_splat_ahead {
        return splats.light;
    }
    return light_of_listed();
}

fn step_ahead() {
    if is_splat_ahead {
        next_splat();
    } else {
        step_listed();
    }
    choose_ahead();
}

// Adds the splats of the ray to those of the workgroup.
fn count_ahead() {
    atomicAdd(&counts[FLOW_DRAWN], splats.drawn);
    atomicAdd(&counts[FLOW_OUTSIDE], splats.outside);
}
