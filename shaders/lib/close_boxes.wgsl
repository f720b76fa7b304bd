// Pixels whose rays may meet an entry face, computed as on the CPU so that decisions agree. CPU twins: render/cpu/raster/boxes.rs,
// and `pixel_box` in render/cpu/tiles.rs.
//
// The CPU computes places in the image in f64 and rounds them to f32; here they are sums of two f32, rounded to one. Both are right to
// 2^-40 of the image before rounding, so that they give the same f32 unless the place lies that close to the middle of two; and that
// shows only where the end of a box, its pad included, lies within this last bit of a pixel.

// View coordinates as sums of two: x (right) and y (up) times PLANE_SCALE, and w, the depth.
struct Corner {
    x: vec2<f32>,
    y: vec2<f32>,
    w: vec2<f32>,
}

fn corner_of(id: u32) -> Corner {
    let v = vertices[id];
    let depth = two_sum(v.depth.x, v.depth.y);
    return Corner(v.plane.xy, v.plane.zw, two_sum(depth.x, depth.y + v.depth.z));
}

// A plane coordinate over depth (1 for parallel rays) and pixel pitch: pixels from the middle of the image.
fn in_pixels(value: vec2<f32>, w: vec2<f32>, pitch: vec2<f32>) -> vec2<f32> {
    const FAR: f32 = 1e30;
    let pixels = 0.5 * pair_quotient(value, pair_product(w, pitch));
    // Sums of infinite parts would be NaN.
    return select(vec2(clamp(pixels.x, -FAR, FAR), 0.0), pixels, abs(pixels.x) < FAR);
}

// Column and row of a corner in front of the eye, in pixels from the middle of the first pixel, each as a sum of two.
fn place_of(v: Corner, w: vec2<f32>) -> vec4<f32> {
    let middle = 0.5 * vec2<f32>(params.image_px - vec2(1u));
    let column = pair_sum(vec2(middle.x, 0.0), in_pixels(v.x, w, params.pitch.xy));
    let row = pair_sum(vec2(middle.y, 0.0), -in_pixels(v.y, w, params.pitch.zw));
    return vec4(column, row);
}

// Whether some of the pixels `first` to `last` of an image of `size` are among those from `low` to `high`, padded.
fn meets_range(low: f32, high: f32, size: u32, first: u32, last: u32) -> bool {
    let pad = 1e-3 + f32(size) * (1.0 / 4194304.0);
    let from_ = opaque(low - pad);
    let to = opaque(high + pad);
    // Clamped before conversion: 1e9 is beyond any image.
    let begin = select(0, i32(min(from_, 1e9)) + 1, from_ > 0.0);
    let end = min(select(0, i32(min(to, 1e9)) + 1, to > 0.0), i32(size));
    return begin < end && begin <= i32(last) && i32(first) < end;
}

// Whether all rays see corners at these columns and rows clockwise, beyond doubt.
fn is_clockwise(columns: vec3<f32>, rows: vec3<f32>) -> bool {
    let size = f32(max(params.image_px.x, params.image_px.y));
    let ab = vec2(columns.y - columns.x, rows.y - rows.x);
    let ac = vec2(columns.z - columns.x, rows.z - rows.x);
    let clockwise = opaque(opaque(ab.x * ac.y) - opaque(ac.x * ab.y));
    let longest = max(max(abs(ab.x), abs(ab.y)), max(abs(ac.x), abs(ac.y)));
    let largest = max(max(abs(columns.x), abs(rows.x)) + longest, size);
    return clockwise > opaque(longest * largest) * (1.0 / 262144.0);
}

// Whether every ray sees the triangle from behind, beyond doubt, on whichever side of the eye it is.
fn is_seen_from_behind(a: Corner, b: Corner, c: Corner, perspective: bool) -> bool {
    let scale = 1.0 / PLANE_SCALE;
    let ab = array(pair_sum(b.x, -a.x) * scale, pair_sum(b.y, -a.y) * scale, pair_sum(b.w, -a.w));
    let ac = array(pair_sum(c.x, -a.x) * scale, pair_sum(c.y, -a.y) * scale, pair_sum(c.w, -a.w));
    // Along the ray to corner a; parallel rays all go along the depth.
    var ray = array(vec2(0.0), vec2(0.0), vec2(1.0, 0.0));
    if perspective {
        ray = array(a.x * scale, a.y * scale, a.w);
    }
    var dot_ = vec2(0.0);
    for (var i = 0u; i < 3u; i++) {
        let j = (i + 1u) % 3u;
        let k = (i + 2u) % 3u;
        let normal = pair_sum(pair_product(ab[j], ac[k]), -pair_product(ab[k], ac[j]));
        dot_ = pair_sum(dot_, pair_product(normal, ray[i]));
    }
    let lengths = length(vec3(ab[0].x, ab[1].x, ab[2].x)) * length(vec3(ac[0].x, ac[1].x, ac[2].x));
    return dot_.x < -1e-9 * lengths * length(vec3(ray[0].x, ray[1].x, ray[2].x));
}

// Least and greatest place of a triangle that is partly behind the eye, along one axis, in pixels from the middle of the image.
fn range_at_eye(values: array<vec2<f32>, 3>, w: array<vec2<f32>, 3>, pitch: vec2<f32>, extent: f32) -> array<vec2<f32>, 2> {
    const FAR: f32 = 1e30;
    var low = vec2(FAR, 0.0);
    var high = vec2(-FAR, 0.0);
    for (var i = 0u; i < 3u; i++) {
        let j = (i + 1u) % 3u;
        if w[i].x > 0.0 {
            let at = in_pixels(values[i], w[i], pitch);
            if at.x < low.x || (at.x == low.x && at.y < low.y) {
                low = at;
            }
            if at.x > high.x || (at.x == high.x && at.y > high.y) {
                high = at;
            }
        }
        if (w[i].x > 0.0) != (w[j].x > 0.0) {
            // The edge leaves the half-space in front of the eye, towards infinity on the side of the value there.
            let share = pair_quotient(w[i], pair_sum(w[i], -w[j]));
            let at = pair_sum(values[i], pair_product(share, pair_sum(values[j], -values[i]))).x;
            if at >= -1e-9 * extent {
                high = vec2(FAR, 0.0);
            }
            if at <= 1e-9 * extent {
                low = vec2(-FAR, 0.0);
            }
        }
    }
    return array(low, high);
}

// As `meets_range`, with `low` and `high` counted from the middle of the image.
fn meets_range_at_eye(low: vec2<f32>, high: vec2<f32>, size: u32, first: u32, last: u32) -> bool {
    const PAD: f32 = 1e-3;
    let middle = 0.5 * f32(size - 1u);
    let to_last = (low.x - (f32(last) - middle)) + (low.y - PAD);
    let to_first = (high.x - (f32(first) - middle)) + (high.y + PAD);
    // Empty if no pixel lies between the low and the high end.
    let begin = ceil(max(low.x + middle + (low.y - PAD), 0.0));
    let end = floor(min(high.x + middle + (high.y + PAD), f32(size))) + 1.0;
    return to_last <= 0.0 && to_first >= 0.0 && begin < end;
}

// Whether the box of an entry face reaches into the pixels from `block.xy` to `block.zw`.
fn reaches_into(ids: vec3<u32>, block: vec4<u32>) -> bool {
    let perspective = (params.flags & PERSPECTIVE) != 0u;
    let corners = array(corner_of(ids.x), corner_of(ids.y), corner_of(ids.z));
    if is_seen_from_behind(corners[0], corners[1], corners[2], perspective) {
        return false;
    }
    var w = array(vec2(1.0, 0.0), vec2(1.0, 0.0), vec2(1.0, 0.0));
    if perspective {
        w = array(corners[0].w, corners[1].w, corners[2].w);
    }
    if min(min(w[0].x, w[1].x), w[2].x) > 0.0 {
        let a = place_of(corners[0], w[0]);
        let b = place_of(corners[1], w[1]);
        let c = place_of(corners[2], w[2]);
        let columns = vec3(a.x, b.x, c.x);
        let rows = vec3(a.z, b.z, c.z);
        if is_clockwise(columns, rows) {
            return false;
        }
        let low = vec2(min(min(columns.x, columns.y), columns.z), min(min(rows.x, rows.y), rows.z));
        let high = vec2(max(max(columns.x, columns.y), columns.z), max(max(rows.x, rows.y), rows.z));
        return meets_range(low.x, high.x, params.image_px.x, block.x, block.z)
            && meets_range(low.y, high.y, params.image_px.y, block.y, block.w);
    }
    if max(max(w[0].x, w[1].x), w[2].x) <= 0.0 {
        return false;
    }
    var extent = 0.0;
    for (var i = 0u; i < 3u; i++) {
        let v = corners[i];
        extent = max(extent, max(max(abs(v.x.x), abs(v.y.x)), abs(v.w.x) * PLANE_SCALE));
    }
    let across = range_at_eye(array(corners[0].x, corners[1].x, corners[2].x), w, params.pitch.xy, extent);
    let upwards = range_at_eye(array(corners[0].y, corners[1].y, corners[2].y), w, params.pitch.zw, extent);
    return meets_range_at_eye(across[0], across[1], params.image_px.x, block.x, block.z)
        && meets_range_at_eye(-upwards[1], -upwards[0], params.image_px.y, block.y, block.w);
}
