// Interpolation of those of the four samples around each pixel at which the reference has nearly the same value. CPU twin:
// image/upsample/joint2x2.rs. A workgroup is a tile.

const COUNTERS: u32 = 9u;
// The least sum of weights; below it the pixel falls back to bilinear interpolation.
const LEAST_SUM: f32 = 1e-6;

// Number of pixels that fell back to bilinear interpolation.
var<workgroup> fallen_back: atomic<u32>;

fn alike(here: vec3<f32>, sample: vec2<u32>) -> f32 {
    let apart = textureLoad(small_reference, sample, 0).xyz - here;
    return exp2(-dot(apart, apart) * upsample_params.reference_per_square);
}

fn upsample(pixel: vec2<u32>) {
    let at = around(pixel);
    let right = vec2(at.last.x, at.first.y);
    let below = vec2(at.first.x, at.last.y);
    let away = 1.0 - at.share;
    let shares = vec4(away.x * away.y, at.share.x * away.y, away.x * at.share.y, at.share.x * at.share.y);
    let here = textureLoad(reference, pixel, 0).xyz;
    var weights = shares * vec4(alike(here, at.first), alike(here, right), alike(here, below), alike(here, at.last));
    var sum = weights.x + weights.y + weights.z + weights.w;
    if sum < LEAST_SUM {
        weights = shares;
        sum = shares.x + shares.y + shares.z + shares.w;
        atomicAdd(&fallen_back, 1u);
    }
    let above = weights.x * textureLoad(small_color, at.first, 0) + weights.y * textureLoad(small_color, right, 0);
    let mixed = above + weights.z * textureLoad(small_color, below, 0) + weights.w * textureLoad(small_color, at.last, 0);
    textureStore(color_plane, pixel, mixed / sum);
    store_depth(pixel);
}

@compute @workgroup_size(256)
fn upsample_joint2x2(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = params.first_tile + group.x;
    let pixel = pixel_of_thread(tile, thread);
    if all(pixel < params.size_px) {
        upsample(pixel);
    }
    workgroupBarrier();
    if thread == 0u {
        counters[COUNTERS * tile] = atomicLoad(&fallen_back);
    }
}
