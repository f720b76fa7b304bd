// Splats of flow on the ray, from the list of its tile (flow_layout.wgsl). CPU twins: `Splat::seen` in render/flow/lanes.rs, `Splat::light` in
// render/flow/rows.rs, `Kernel::light` in render/flow/kernel.rs and `Inside::has` in render/cpu/layers/inside.rs.
//
// `flow_inside` has for each pixel an interval of depths, as two sums of two, or NOWHERE, the number of intervals, and where they lie.

// What kernels are: none, smooth, or as in the paper.
const NO_KERNELS: f32 = 0.0;
const SMOOTH_KERNELS: f32 = 1.0;
// Squared distance in widths at which splats end, and the kernel there.
const SPLAT_END: f32 = 6.25;
const SPLAT_LEAST: f32 = 0.043936934;

struct Splats {
    head: vec4<f32>,
    // Pixels from the middle of the tile to the ray's, and the ray's number.
    beside: vec2<f32>,
    ray: u32,
    // The next texel of the list, and places left.
    next: u32,
    left: u32,
    // Depth of the next splat that is seen, as a sum of two, and its light.
    depth: vec2<f32>,
    light: vec4<f32>,
    // Splats seen so far, and those that would be but for the cells.
    drawn: u32,
    outside: u32,
}
var<private> splats: Splats;

fn texel_of_flow(at: u32) -> vec4<f32> {
    return textureLoad(flow_lists, texel_place(at), 0);
}

// Begins a ray, at a place in the plane that is rendered.
fn splats_begin(place: vec2<u32>) {
    let tile = place / TILE_PX;
    let beside = vec2<f32>(vec2<i32>(pixel_at(place)) - vec2<i32>(pixel_at(middle_of_tile(tile))));
    let list = integers(texel_of_flow(FLOW_HEAD + tile.y * params.tiles.x + tile.x));
    let ray = place.y * params.size_px.x + place.x;
    splats = Splats(texel_of_flow(0u), beside, ray, list.x, list.y, vec2(NOWHERE, 0.0), vec4(0.0), 0u, 0u);
    next_splat();
}

// Goes on to the next splat that is seen.
fn next_splat() {
    splats.depth = vec2(NOWHERE, 0.0);
    var is_found = false;
    while splats.left > 0u && !is_found {
        let window = texel_of_flow(splats.next);
        let pattern = texel_of_flow(splats.next + 1u);
        splats.next += PLACE_TEXELS;
        splats.left -= 1u;
        let u = window.x + (window.z * splats.beside.x + window.w * splats.beside.y);
        let v = window.y + pattern.x * splats.beside.y;
        let squared = u * u + v * v;
        if squared < SPLAT_END {
            is_found = look_at_splat(u32(pattern.w), squared, pattern.yz);
        }
    }
}

// Whether a splat is seen at this squared distance in widths; `at` is the place in its pattern, in the middle of the tile.
fn look_at_splat(number: u32, squared: f32, at: vec2<f32>) -> bool {
    let first = texel_of_splat(number);
    let window = max(exp_neg(0.5 * squared) - SPLAT_LEAST, 0.0) * (1.0 / (1.0 - SPLAT_LEAST));
    let placed = texel_of_flow(first + 1u);
    let color = texel_of_flow(first + 2u);
    var icon = 0.0;
    if color.w > 0.0 {
        icon = color.w * (window * splat_pattern(first, at, placed.z));
    }
    if splats.head.x == NO_KERNELS {
        if !(icon > 0.0) {
            return false;
        }
        splats.light = vec4(color.xyz * icon, icon);
    } else {
        if !(window > 0.0) {
            return false;
        }
        splats.light = over_kernel(texel_of_flow(first + 4u), placed.w, window, vec4(color.xyz, icon));
    }
    if splats.head.y > 0.0 && !is_inside(placed.xy) {
        splats.outside += 1u;
        return false;
    }
    splats.drawn += 1u;
    splats.depth = placed.xy;
    return true;
}

// The pattern of a splat.
fn splat_pattern(first: u32, at: vec2<f32>, wide: f32) -> f32 {
    let mixed = texel_of_flow(first + 3u);
    if mixed.x == 0.0 {
        return mixed.w;
    }
    let along = texel_of_flow(first);
    let here = at + vec2(dot(along.xy, splats.beside), dot(along.zw, splats.beside));
    let icon = u32(mixed.z);
    var mean = icon_mean(icon, here, wide);
    if mixed.y > 0.0 {
        mean += mixed.y * (icon_mean(icon + 8u, here, wide) - mean);
    }
    return mixed.w + mixed.x * mean;
}

// The light of a kernel, of this opacity through its centre, where the window has this value, with an icon.
fn over_kernel(kernel: vec4<f32>, opacity: f32, window: f32, icon: vec4<f32>) -> vec4<f32> {
    if splats.head.x == SMOOTH_KERNELS {
        // The icon lies over the kernel.
        let front = opacity * icon.w;
        let behind = (1.0 - icon.w) * alpha_of_depth(kernel.w * window);
        return vec4(front * icon.xyz + behind * kernel.xyz, front + behind);
    }
    let alpha = opacity * ((1.0 - icon.w) * window + icon.w);
    return vec4(alpha * icon.w * icon.xyz + alpha * (1.0 - icon.w) * kernel.xyz, alpha);
}

// Whether a depth lies between the ends of an interval.
fn is_between(ends: vec4<f32>, depth: vec2<f32>) -> bool {
    return depth_after(ends.xy, depth) >= 0.0 && depth_after(depth, ends.zw) >= 0.0;
}

// Whether the place of the ray at a depth is in a cell that is shown.
fn is_inside(depth: vec2<f32>) -> bool {
    let only = textureLoad(flow_inside, texel_place(splats.ray), 0);
    if only.x < NOWHERE {
        return is_between(only, depth);
    }
    let first = u32(only.z) * COUNT_BASE + u32(only.w);
    for (var i = 0u; i < u32(only.y); i += 1u) {
        if is_between(textureLoad(flow_inside, texel_place(first + i), 0), depth) {
            return true;
        }
    }
    return false;
}
