// Pixel boxes of faces. CPU twin: render/cpu/tiles.rs, `pixel_box`.

// The empty box.
const NO_BOX: vec4<i32> = vec4<i32>(1, 0, 1, 0);

// First place in the plane whose pixel is at `pixel` or after it, per axis; behind the plane's last place if there is none.
fn first_from(pixel: vec2<i32>) -> vec2<i32> {
    let stride = vec2<i32>(params.stride_px);
    let size = vec2<i32>(params.size_px);
    let next = min((pixel + stride - vec2(1)) / stride, size - vec2(1));
    return select(next, size, pixel >= vec2<i32>(params.image_px));
}

// The box of all places in the plane.
fn whole_plane() -> vec4<i32> {
    return vec4(0, i32(params.size_px.x) - 1, 0, i32(params.size_px.y) - 1);
}

// First and last column and row (inclusive) of the places in the plane whose rays may meet the triangle in front of the eye; empty if
// x > y or z > w.
fn face_box(a: ViewVertex, b: ViewVertex, c: ViewVertex) -> vec4<i32> {
    var w = vec3(1.0);
    if (params.flags & PERSPECTIVE) != 0u {
        w = vec3(a.depth.x + a.depth.y, b.depth.x + b.depth.y, c.depth.x + c.depth.y);
    }
    if max(max(w.x, w.y), w.z) <= 0.0 {
        return NO_BOX;
    }
    let x = vec3(a.plane.x, b.plane.x, c.plane.x);
    let y = vec3(a.plane.z, b.plane.z, c.plane.z);
    return box_between(plane_range(x, w), plane_range(y, w));
}

// The box of the places between two x and between two y on the image plane.
fn box_between(x: vec2<f32>, y: vec2<f32>) -> vec4<i32> {
    let last = vec2<f32>(params.image_px) - vec2(1.0);
    let across = x / params.pitch.x;
    let upwards = y / params.pitch.z;
    // Rounding is below 2^-20 of the image's size; the pad is 1/16 of a pixel, and images have at most 2^15 of them.
    let columns = 0.5 * (across + last.x) + vec2(-0.0625, 0.0625);
    let rows = 0.5 * (vec2(-upwards.y, -upwards.x) + last.y) + vec2(-0.0625, 0.0625);
    return places_between(columns, rows);
}

// The box of the places between two columns and between two rows of the image, which are counted from the middle of its first pixel.
fn places_between(columns: vec2<f32>, rows: vec2<f32>) -> vec4<i32> {
    let end = vec2<f32>(params.image_px) - vec2(1.0);
    // Clamped before conversion: infinities are not integers.
    let first = vec2(clamp(ceil(columns.x), 0.0, end.x + 1.0), clamp(ceil(rows.x), 0.0, end.y + 1.0));
    let final_ = vec2(clamp(floor(columns.y), -1.0, end.x), clamp(floor(rows.y), -1.0, end.y));
    let from_ = first_from(vec2<i32>(first));
    let to = first_from(vec2<i32>(final_) + vec2(1)) - vec2(1);
    return vec4(from_.x, to.x, from_.y, to.y);
}

// Least and greatest value / w over the part of a triangle in front of the eye.
fn plane_range(value: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    const FAR: f32 = 1e30;
    var range = vec2(FAR, -FAR);
    // The first part of a coordinate is right to 2^-24 of it, or of the mesh's extent: a triangle whose plane passes that close to
    // the eye may be on either side.
    let slack = 1e-5 * max(max(abs(value.x), abs(value.y)), abs(value.z)) + PLANE_SCALE / 1048576.0;
    for (var i = 0u; i < 3u; i++) {
        let j = select(i + 1u, 0u, i == 2u);
        if w[i] > 0.0 {
            let at = clamp(value[i] / w[i], -FAR, FAR);
            range = vec2(min(range.x, at), max(range.y, at));
        }
        if (w[i] > 0.0) != (w[j] > 0.0) {
            // The edge leaves the half-space in front of the eye, towards infinity on the side of the value there.
            let at = value[i] + w[i] / (w[i] - w[j]) * (value[j] - value[i]);
            range = vec2(select(range.x, -FAR, at <= slack), select(range.y, FAR, at >= -slack));
        }
    }
    return range;
}
