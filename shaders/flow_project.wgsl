// Flow, first part: projects the splats; a thread is a splat. CPU twins: `Splat::of` and `Screen` in render/flow/splat.rs, `Kernel::of` in
// render/flow/kernel.rs.
//
// `flow_sites` has three vectors for each site: its place as a sum of two, and the lower triangle L with L L^T its shape: xx, yx, yy, zx, zy, zz.
// `flow_ready` has for each splat: its vector times a power of two, blur, colour, place in the pattern along and across, share of the next icon,
// mean of its icons, depth as `Params` counts as a sum of two, the site, the number of its icon and whether it has one; of a kernel, colour
// and optical depths (`ReadyKernel`).
//
// J is taken per pixel of a unit that faces the viewer: its numbers are of the size of 1, and lengths are local.

const VECTOR_AT: u32 = 0u;
const BLUR_AT: u32 = 3u;
const COLOR_AT: u32 = 4u;
const PHASE_AT: u32 = 7u;
const SHARE_AT: u32 = 9u;
const MEAN_AT: u32 = 10u;
const DEPTH_AT: u32 = 11u;
const SITE_AT: u32 = 13u;
const ICON_AT: u32 = 14u;
const KERNEL_AT: u32 = 15u;
const KERNEL_END: u32 = 20u;
// Bit of the last word of a splat with an icon.
const FLOWS: u32 = 0x80000000u;
// Variance of a pixel, in pixels squared.
const PIXEL: f32 = 0.25;
// Periods per period's length on the screen, at most.
const COMPRESSED: f32 = 3.0;
// What is above counts as infinite.
const HUGE: f32 = 3.0e38;

fn has_kernels() -> bool {
    return flow_params.splat_words == KERNEL_END;
}

fn number_at(at: u32) -> f32 {
    return bitcast<f32>(flow_ready[at]);
}

fn three_at(at: u32) -> vec3<f32> {
    return vec3(number_at(at), number_at(at + 1u), number_at(at + 2u));
}

fn axis(i: u32) -> vec3<f32> {
    return params.axes[3u * i].xyz + (params.axes[3u * i + 1u].xyz + params.axes[3u * i + 2u].xyz);
}

// The projection around a place: rows of J, and their product.
struct Screen {
    right: vec3<f32>,
    down: vec3<f32>,
    product: vec3<f32>,
    // Length of a pixel, and of the ray per depth.
    pixel: f32,
    length_per_depth: f32,
}

fn screen_at(center: ViewVertex) -> Screen {
    let pitch = 2.0 * params.pitch.x / PLANE_SCALE;
    let right = axis(0u);
    let up = axis(1u);
    let forward = axis(2u);
    if (params.flags & PERSPECTIVE) == 0u {
        return Screen(right, -up, forward, pitch, 1.0);
    }
    let depth = center.depth.x + center.depth.y;
    let slope = center.plane.xz / PLANE_SCALE / depth;
    // Far from the middle of the image both rows are nearly along the depth: their product is not computed from them.
    let product = forward + slope.x * right + slope.y * up;
    let down = slope.y * forward - up;
    return Screen(right - slope.x * forward, down, product, pitch * depth, sqrt(1.0 + dot(slope, slope)));
}

// L of a site.
struct Triangle {
    xx: f32,
    yx: f32,
    yy: f32,
    zx: f32,
    zy: f32,
    zz: f32,
}

// L^T times a vector.
fn transposed_times(l: Triangle, v: vec3<f32>) -> vec3<f32> {
    return vec3(l.xx * v.x + l.yx * v.y + l.zx * v.z, l.yy * v.y + l.zy * v.z, l.zz * v.z);
}

// The adjugate of L times a vector.
fn adjugate_times(l: Triangle, v: vec3<f32>) -> vec3<f32> {
    return vec3(
        l.yy * l.zz * v.x,
        l.zz * (l.xx * v.y - l.yx * v.x),
        (l.yx * l.zy - l.yy * l.zx) * v.x + l.xx * (l.yy * v.z - l.zy * v.y),
    );
}

@compute @workgroup_size(64)
fn flow_project(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = id.x + id.y * groups.x * 64u;
    if number == 0u {
        textureStore(flow_plane, texel_place(0u), flow_params.head);
    }
    if number < flow_params.splat_count {
        project(number);
    }
}

fn project(number: u32) {
    let words = flow_params.splat_words * number;
    let site = 3u * flow_ready[words + SITE_AT];
    let high = flow_sites[site];
    let low = flow_sites[site + 1u];
    let rest = flow_sites[site + 2u];
    let center = in_view(high.xyz, low.xyz, 0.0);
    let l = Triangle(high.w, low.w, rest.x, rest.y, rest.z, rest.w);
    let screen = screen_at(center);

    // J S J^T and a pixel's variance. A needle keeps its determinant, of which no part is negative.
    let square = flow_params.size * flow_params.size;
    let a = flow_params.size * transposed_times(l, screen.right);
    let b = flow_params.size * transposed_times(l, screen.down);
    let across = adjugate_times(l, screen.product);
    let pixel = PIXEL * screen.pixel * screen.pixel;
    let ways = vec2(dot(a, a), dot(b, b));
    let mixed = dot(a, b);
    let determinant = square * square * dot(across, across) + pixel * (ways.x + ways.y) + pixel * pixel;
    let variances = ways + vec2(pixel);

    let form = vec4(sqrt(variances.y / determinant), mixed / variances.y, inverseSqrt(variances.y), END * mixed * inverseSqrt(variances.x));
    let pattern = pattern_of(center, three_at(words + VECTOR_AT));
    let phase = vec2(number_at(words + PHASE_AT), number_at(words + PHASE_AT + 1u));
    let at = RECORD_VECTORS * number;
    flow_records[at] = center.plane;
    flow_records[at + 1u] = vec4(center.depth.xyz, screen.pixel);
    flow_records[at + 2u] = form;
    flow_records[at + 3u] = pattern.periods;
    flow_records[at + 4u] = pattern.rests;
    // What is no number is not seen.
    let halves = select(vec2(-1.0), END * sqrt(variances), form.x > 0.0 && form.x < HUGE && determinant < HUGE);
    flow_records[at + 5u] = vec4(phase, halves);
    write_texels(number, screen, pattern, kernel_of(words, screen, l, across, determinant));
}

// The pattern of a vector on the screen.
struct Pattern {
    // Periods along and across, per length to the right and down; and what they lack: far from the centre, many have passed.
    periods: vec4<f32>,
    rests: vec4<f32>,
    // Periods per length along.
    frequency: f32,
    contrast: f32,
}

// J times a vector: right and down, as sums of two.
fn project_way(center: ViewVertex, way: vec3<f32>) -> array<vec2<f32>, 2> {
    var right = along(way, vec3(0.0), 0u);
    var up = along(way, vec3(0.0), 1u);
    if (params.flags & PERSPECTIVE) != 0u {
        let forward = along(way, vec3(0.0), 2u);
        let depth = double_depth(center);
        right = plus(right, -times(over(center.plane.xy / PLANE_SCALE, depth), forward));
        up = plus(up, -times(over(center.plane.zw / PLANE_SCALE, depth), forward));
    }
    return array(right, -up);
}

fn length_of(way: vec3<f32>) -> vec2<f32> {
    return root_of(plus(plus(two_product(way.x, way.x), two_product(way.y, way.y)), two_product(way.z, way.z)));
}

fn pattern_of(center: ViewVertex, vector: vec3<f32>) -> Pattern {
    let way = project_way(center, vector);
    let squared = plus(times(way[0], way[0]), times(way[1], way[1]));
    if !(squared.x > 0.0) {
        let still = COMPRESSED * flow_params.periods;
        return Pattern(vec4(still.x, 0.0, 0.0, -flow_params.periods.x), vec4(0.0), still.x, contrast_at(0.0));
    }
    let projected = root_of(squared);
    let whole = length_of(vector);
    // Per unit that faces the viewer.
    let foreshortening = projected.x / whole.x;
    var compression = vec2(COMPRESSED, 0.0);
    if foreshortening * COMPRESSED > 1.0 {
        compression = over(whole, projected);
    }
    let frequency = times(compression, flow_params.periods);
    let right = over(way[0], projected);
    let down = over(way[1], projected);
    let a = times(right, frequency);
    let b = times(down, frequency);
    let c = times(down, flow_params.periods);
    let d = -times(right, flow_params.periods);
    let contrast = contrast_at(foreshortening);
    return Pattern(vec4(a.x, b.x, c.x, d.x), vec4(a.y, b.y, c.y, d.y), frequency.x, contrast);
}

// How much of a pattern is left.
fn contrast_at(foreshortening: f32) -> f32 {
    if flow_params.fades == 0u {
        return 1.0;
    }
    let at = min(foreshortening * COMPRESSED, 1.0);
    return at * at * (3.0 - 2.0 * at);
}

// The level of an icon whose rows are at least as many texels as a pixel is across.
fn level_of(periods_per_pixel: f32) -> u32 {
    let texels = periods_per_pixel * f32(ICON_ROWS);
    var level = 0u;
    while level < ICON_LEVELS - 1u && texels > f32(1u << level) {
        level += 1u;
    }
    return level;
}

// Opacity and optical depth of a splat's kernel, if it has one. `across` is adj(L) n for the product n of J's rows.
fn kernel_of(words: u32, screen: Screen, l: Triangle, across: vec3<f32>, determinant: f32) -> vec2<f32> {
    if !has_kernels() {
        return vec2(0.0);
    }
    // Of all places on the ray, which is along n, the Gaussian has a width of 1 / sqrt(n^T S^-1 n) for n of length 1.
    var width = 0.0;
    let reach = length(across);
    if reach > 0.0 {
        width = l.xx * l.yy * l.zz * length(screen.product) / reach;
    }
    let depth = number_at(words + KERNEL_AT + 4u) * screen.length_per_depth * inverseSqrt(determinant);
    return vec2(alpha_of_depth(number_at(words + KERNEL_AT + 3u) * width), depth);
}

// Writes what rays read of a splat, but for its places.
fn write_texels(number: u32, screen: Screen, pattern: Pattern, kernel: vec2<f32>) {
    let words = flow_params.splat_words * number;
    let icon = flow_ready[words + ICON_AT];
    let per_pixel = pattern.frequency * screen.pixel;
    let wide = clamp(per_pixel + number_at(words + BLUR_AT), 1.0 / f32(ICON_ROWS), 1.0) * f32(ICON_ROWS);
    // Where a pattern has no place it is not seen.
    let opacity = select(0.0, flow_params.opacity, (icon & FLOWS) != 0u && per_pixel < HUGE);
    let whole = (1.0 - pattern.contrast) * number_at(words + MEAN_AT);
    let numbered = 8u * (icon & ~FLOWS) + level_of(flow_params.periods.x * screen.pixel);
    var kernel_color = vec3(0.0);
    if has_kernels() {
        kernel_color = three_at(words + KERNEL_AT);
    }
    let depth = vec2(number_at(words + DEPTH_AT), number_at(words + DEPTH_AT + 1u));
    let at = texel_of_splat(number);
    textureStore(flow_plane, texel_place(at), pattern.periods * screen.pixel);
    textureStore(flow_plane, texel_place(at + 1u), vec4(depth, wide, kernel.x));
    textureStore(flow_plane, texel_place(at + 2u), vec4(three_at(words + COLOR_AT), opacity));
    textureStore(flow_plane, texel_place(at + 3u), vec4(pattern.contrast, number_at(words + SHARE_AT), f32(numbered), whole));
    textureStore(flow_plane, texel_place(at + 4u), vec4(kernel_color, kernel.y));
}
