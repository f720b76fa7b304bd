// Pixel boxes of items. CPU twin: render/cpu/raycast/entries.rs, `pixel_box`.

// First and last column and row (inclusive) of the pixels whose rays may meet the item; empty if x > y or z > w.
fn item_box(item: u32) -> vec4<i32> {
    let last = vec2<i32>(params.size_px) - vec2(1);
    if item >= params.face_count {
        return vec4(0, last.x, 0, last.y);
    }
    let cell = items[item] >> 2u;
    for (var i = 0u; i < params.eye_count; i++) {
        // The faces of a cell at the eye are looked at with the cell.
        if items[params.face_count + 2u * i] == cell {
            return NO_BOX;
        }
    }
    let ids = face_vertices(cell, items[item] & 3u);
    return face_box(vertices[ids.x], vertices[ids.y], vertices[ids.z], last);
}

const NO_BOX: vec4<i32> = vec4<i32>(1, 0, 1, 0);

fn face_box(a: ViewVertex, b: ViewVertex, c: ViewVertex, last: vec2<i32>) -> vec4<i32> {
    var w = vec3(1.0);
    if (params.flags & PERSPECTIVE) != 0u {
        w = vec3(a.depth.x + a.depth.y, b.depth.x + b.depth.y, c.depth.x + c.depth.y);
    }
    if max(max(w.x, w.y), w.z) <= 0.0 || is_back_facing(a, b, c) {
        return NO_BOX;
    }
    let x = vec3(a.plane.x, b.plane.x, c.plane.x);
    let y = vec3(a.plane.z, b.plane.z, c.plane.z);
    let across = plane_range(x, w) / params.pitch.x;
    let upwards = plane_range(y, w) / params.pitch.z;
    // Rounding is below 2^-20 of the image's size; the pad is 1/16 of a pixel, and images have at most 2^15 of them.
    let columns = 0.5 * (across + f32(last.x)) + vec2(-0.0625, 0.0625);
    let rows = 0.5 * (vec2(-upwards.y, -upwards.x) + f32(last.y)) + vec2(-0.0625, 0.0625);
    let end = vec2<f32>(last);
    // Clamped before conversion: infinities are not integers.
    let first = vec2(clamp(ceil(columns.x), 0.0, end.x + 1.0), clamp(ceil(rows.x), 0.0, end.y + 1.0));
    let final_ = vec2(clamp(floor(columns.y), -1.0, end.x), clamp(floor(rows.y), -1.0, end.y));
    return vec4(i32(first.x), i32(final_.x), i32(first.y), i32(final_.y));
}

// Least and greatest value / w over the part of a triangle in front of the eye.
fn plane_range(value: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    const FAR: f32 = 1e30;
    var range = vec2(FAR, -FAR);
    let slack = 1e-5 * max(max(abs(value.x), abs(value.y)), abs(value.z));
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

// Whether every ray sees the triangle from behind, beyond doubt.
fn is_back_facing(a: ViewVertex, b: ViewVertex, c: ViewVertex) -> bool {
    // Differences of sums: accurate however small the triangle.
    let p = (b.plane.xz - a.plane.xz) + (b.plane.yw - a.plane.yw);
    let q = (c.plane.xz - a.plane.xz) + (c.plane.yw - a.plane.yw);
    let ab = vec3(p / PLANE_SCALE, (b.depth.x - a.depth.x) + (b.depth.y - a.depth.y));
    let ac = vec3(q / PLANE_SCALE, (c.depth.x - a.depth.x) + (c.depth.y - a.depth.y));
    // Along the ray to corner a; parallel rays all go along the depth.
    var ray = vec3(0.0, 0.0, 1.0);
    if (params.flags & PERSPECTIVE) != 0u {
        ray = vec3(a.plane.xz / PLANE_SCALE, a.depth.x + a.depth.y);
    }
    return dot(cross(ab, ac), ray) < -1e-4 * length(ab) * length(ac) * length(ray);
}
