// What all splats of flow have in common. The Rust twin is `FlowParams` in src/render/gpu/flow_layout.rs.

struct FlowParams {
    // The head of the texels.
    head: vec4<f32>,
    // Periods of the pattern per local unit, as a sum of two.
    periods: vec2<f32>,
    // Widths of a splat's kernel per width of its site's shape.
    size: f32,
    // Opacity of an icon where it is 1.
    opacity: f32,
    // 1 if patterns fade where the vector is nearly along the ray.
    fades: u32,
    splat_count: u32,
    // Words of each splat.
    splat_words: u32,
    // Capacity in places.
    place_capacity: u32,
}

// Distance from the centre, in widths of the kernel, at which a splat ends.
const END: f32 = 2.5;
