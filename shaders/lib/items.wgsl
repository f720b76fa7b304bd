// Pixel boxes of items. CPU twin: render/cpu/raycast/entries.rs, `TileBins::fill`.

// First and last column and row (inclusive) of the places in the plane whose rays may meet the item; empty if x > y or z > w.
fn item_box(item: u32) -> vec4<i32> {
    if item >= params.face_count {
        return whole_plane();
    }
    let cell = items[item] >> 2u;
    for (var i = 0u; i < params.eye_count; i++) {
        // The faces of a cell at the eye are tested with the cell.
        if items[params.face_count + 2u * i] == cell {
            return NO_BOX;
        }
    }
    let ids = face_vertices(cell, items[item] & 3u);
    let a = vertices[ids.x];
    let b = vertices[ids.y];
    let c = vertices[ids.z];
    if is_back_facing(a, b, c) {
        return NO_BOX;
    }
    return face_box(a, b, c);
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
