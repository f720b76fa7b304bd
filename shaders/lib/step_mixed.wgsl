// Scalars between two steps, in f64: the other step's are in the buffer. CPU twin: pipeline/time.rs, `mix`. Twin: step_as_is.wgsl.

// Returns x unchanged, hidden from the compiler, which would else round a product and a sum only once.
fn opaque_double(x: f64) -> f64 {
    return x - f64(step.zero);
}

// A number of 53 bits from its parts; every order of the sum is exact.
fn whole(parts: vec3<f32>) -> f64 {
    return (f64(parts.x) + f64(parts.y)) + f64(parts.z);
}

fn at_moment(i: u32, value: f32) -> f32 {
    let before = opaque_double(f64(scalars[i]) * whole(step.weight_before));
    return f32(before + opaque_double(f64(value) * whole(step.weight)));
}
