// Where the pixels of the full image lie in the small one. CPU twin: image/upsample/mod.rs.

// The middle of a pixel, in samples, whose middles are the integers; beyond the outermost it is at these. All of it is exact.
fn place_of(pixel: vec2<u32>) -> vec2<f32> {
    let small = vec2<f32>(upsample_params.small_px);
    let from_middle = vec2<f32>(pixel) + 0.5 - 0.5 * vec2<f32>(params.size_px);
    return clamp(from_middle * upsample_params.samples_per_pixel + (0.5 * small - 0.5), vec2(0.0), small - 1.0);
}

// The samples around a pixel: the one to the left above and the one to the right below, and how far it is between them.
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

// Depths are those of the nearest sample; the right or the lower one of two.
fn nearest_to(pixel: vec2<u32>) -> vec2<u32> {
    return vec2<u32>(place_of(pixel) + 0.5);
}

fn store_depth(pixel: vec2<u32>) {
    textureStore(depth_plane, pixel, textureLoad(small_depth, nearest_to(pixel), 0));
}
