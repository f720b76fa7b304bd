// The joint bilateral filter of the bilinear image. CPU twin: image/upsample/joint.rs.
//
// A workgroup is a tile. It reads the kernels Omega of all its pixels once, as many rows at a time as fit.

// Capacity in pixels: two vectors each fill the 16 KiB of workgroup memory that WebGPU guarantees.
const ROOM: i32 = 512;
var<workgroup> colors: array<vec4<f32>, ROOM>;
// The reference; w is 1 within the image, 0 outside.
var<workgroup> references: array<vec4<f32>, ROOM>;

fn read(slot: i32, pixel: vec2<i32>) {
    let last = vec2<i32>(params.size_px) - 1;
    let inside = clamp(pixel, vec2(0), last);
    colors[slot] = textureLoad(enlarged, inside, 0);
    references[slot] = vec4(textureLoad(reference, inside, 0).xyz, select(0.0, 1.0, all(inside == pixel)));
}

@compute @workgroup_size(256)
fn upsample_joint(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = params.first_tile + group.x;
    let pixel = vec2<i32>(pixel_of_thread(tile, thread));
    let local = vec2<i32>(vec2(thread % TILE_PX, thread / TILE_PX));
    let half = upsample_params.half_px;
    // The tile with a margin of Omega's radius, and how many of its rows fit at a time.
    let corner = vec2<i32>(pixel_of_thread(tile, 0u)) - half;
    let wide = i32(TILE_PX) + 2 * half;
    let rows = ROOM / wide;
    let here = textureLoad(reference, min(pixel, vec2<i32>(params.size_px) - 1), 0).xyz;
    var sum = vec4(0.0);
    var weights = 0.0;
    for (var top = 0; top < wide; top += rows) {
        workgroupBarrier();
        let places = min(rows, wide - top) * wide;
        for (var i = i32(thread); i < places; i += 256) {
            read(i, corner + vec2(i % wide, top + i / wide));
        }
        workgroupBarrier();
        let last = min(local.y + 2 * half, min(top + rows, wide) - 1);
        for (var y = max(local.y, top); y <= last; y++) {
            let first = (y - top) * wide + local.x;
            let down = f32(y - local.y - half);
            var of_row = vec4(0.0);
            var weights_of_row = 0.0;
            for (var x = 0; x <= 2 * half; x++) {
                let there = references[first + x];
                let apart = there.xyz - here;
                let along = f32(x - half);
                let of_domain = (along * along + down * down) * upsample_params.domain_per_square;
                let weight = there.w * exp2(-(of_domain + dot(apart, apart) * upsample_params.reference_per_square));
                of_row += weight * colors[first + x];
                weights_of_row += weight;
            }
            sum += of_row;
            weights += weights_of_row;
        }
    }
    if all(pixel < vec2<i32>(params.size_px)) {
        // The pixel itself has the weight 1.
        textureStore(color_plane, pixel, sum / weights);
    }
}
