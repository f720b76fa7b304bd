// Positions of the full image's pixels in the small image. CPU twin: image/upsample/mod.rs.

// The middle of a pixel, in samples, whose middles are the integers; clamped to the outermost ones. Computed exactly.
fn place_of(pixel: vec2<u32>) -> vec2<f32> {
    let small = vec2<f32>(upsample_params.small_px);
    let from_middle = vec2<f32>(pixel) + 0.5 - 0.5 * vec2<f32>(params.size_px);
    return clamp(from_middle * upsample_params.samples_per_pixel + (0.5 * small - 0.5), vec2(0.0), small - 1.0);
}

// The samples around a pixel: the upper left and the lower right one, and the pixel's position between them, 0 to 1.
struct Around {
    first: vec2<u32>,
    last: vec2<u32>,
    share: vec2<f32>,
}

fn around(pixel: vec2<u32>) -> Around {
    let place = place_of(pixel);
    let first = vec2<u32>(place);
    return Around(first, min(first + vec2(1u), upsample_params.small_px - vec2(1u)), place - floor(place));
}

// The nearest sample; the right or the lower one of two.
fn nearest_to(pixel: vec2<u32>) -> vec2<u32> {
    return vec2<u32>(place_of(pixel) + 0.5);
}

fn store_depth(pixel: vec2<u32>) {
    textureStore(depth_plane, pixel, textureLoad(small_depth, nearest_to(pixel), 0));
}
