// What stages share that bring an image to another size. The Rust twin of the struct is in src/render/gpu/layout.rs.

struct UpsampleParams {
    // Pixels per row of the small image, rows of it.
    small_px: vec2<u32>,
    // Samples from one pixel to the next, a power of two.
    samples_per_pixel: f32,
    // Omega reaches so many pixels to each side.
    half_px: i32,
    // The logarithms (base 2) of f and g are minus these times the square of a distance.
    domain_per_square: f32,
    reference_per_square: f32,
    unused: vec2<u32>,
}
