// Scalars of a step, not mixed with another's. Twin: step_mixed.wgsl.

fn at_moment(i: u32, value: f32) -> f32 {
    return value;
}
