// What lies ahead where other layers are fragments. CPU twin: `FragmentsAhead` in render/layers.rs. Twin: flow_ahead.wgsl.

fn ahead_begin(place: vec2<u32>) {
    listed_begin(place);
}

// Whether something is ahead; its depth as `Params` counts, as a sum of two, and its light.
fn is_some_ahead() -> bool {
    return listed.left > 0u;
}

fn place_ahead() -> vec2<f32> {
    return listed.depth;
}

fn light_ahead() -> vec4<f32> {
    return light_of_listed();
}

fn step_ahead() {
    step_listed();
}

fn count_ahead() {}
