// Parameters of the upsampling stages. The Rust twin is in src/render/gpu/layout.rs.

struct UpsampleParams {
    // Pixels per row of the small image, rows of it.
    small_px: vec2<u32>,
    // Pixel pitch in samples, a power of two.
    samples_per_pixel: f32,
    // Radius of the kernel Omega in pixels.
    half_px: i32,
    // The weights f and g at a distance d are 2^(-this * d^2).
    domain_per_square: f32,
    reference_per_square: f32,
    unused: vec2<u32>,
}
