// Entry and exit of rays in a tet, by the signs of its six edge functions. CPU twin: render/cpu/points/tet.rs.
//
// A ray hits a face if its three edge functions have one sign, and either two faces or none: each edge has one sign for all cells at it,
// whose corners come in one order (point_corners.wgsl). Away from the edges the cheaper test of face_hits.wgsl suffices.

// What is listed: a point in the shape of its cell.
struct Element {
    cell: u32,
    tet: Tet,
    // What a fragment has if it is not the ray in the cell itself: depth, scalar and value of the point, for gaps, and the length along the
    // ray over that of the cell for which it stands.
    shape: Shape,
    longer: f32,
    // Whether the eye is in the cell, or within rounding of it; then bit i says whether it is strictly inside of the face opposite corner i.
    is_at_eye: bool,
    eye_inside: u32,
    // It has no extent, or it was widened.
    is_nothing: bool,
    is_enlarged: bool,
}

fn listed_element(rank: u32) -> Element {
    let cell = drawn[rank];
    let tet = corners_of(cell);
    var point = Element(cell, tet, Shape(), 1.0, false, 0u, false, false);
    if point_is(AS_CELLS) {
        look_for_eye(&point);
    } else {
        point.shape = shape_of(tet);
        resize(&point);
    }
    return point;
}

// A word of a cell at the eye.
fn eye_word(index: u32, word: u32) -> u32 {
    return drawn[list_params.drawn_count + POINT_EYE_WORDS * index + word];
}

// Looks for a point among the cells at the eye, which ascend.
fn look_for_eye(point: ptr<function, Element>) {
    let cell = (*point).cell;
    var low = 0u;
    var end = list_params.eye_count;
    while low < end {
        let middle = (low + end) / 2u;
        if eye_word(middle, 0u) < cell {
            low = middle + 1u;
        } else {
            end = middle;
        }
    }
    if low >= list_params.eye_count || eye_word(low, 0u) != cell {
        return;
    }
    let sides = eye_word(low, 1u) >> 4u;
    let corners = cell_vertices(cell);
    (*point).is_at_eye = true;
    for (var i = 0u; i < 4u; i++) {
        let id = (*point).tet.ids[i];
        let as_stored = select(select(select(3u, 2u, id == corners.z), 1u, id == corners.y), 0u, id == corners.x);
        (*point).eye_inside |= ((sides >> as_stored) & 1u) << i;
    }
}

// Enlarges a point about its centroid for the level of detail, and to half a pixel.
fn resize(point: ptr<function, Element>) {
    let shape = (*point).shape;
    let size = point_params.enlarged_by * shape.reach;
    let per_plane = per_plane_at(shape.center);
    let least = point_params.least * per_plane;
    let is_enlarged = per_plane > 0.0 && size < least;
    let wide = select(1.0, least / size, is_enlarged);
    let by = point_params.enlarged_by * wide - 1.0;
    let tet = (*point).tet;
    if by != 0.0 {
        (*point).tet.a = moved(tet.a, by * shape.a, tet.a.depth.w);
        (*point).tet.b = moved(tet.b, by * shape.b, tet.b.depth.w);
        (*point).tet.c = moved(tet.c, by * shape.c, tet.c.depth.w);
        (*point).tet.d = moved(tet.d, by * shape.d, tet.d.depth.w);
    }
    (*point).longer = point_params.enlarged_by / (wide * wide);
    (*point).is_nothing = !(size > 0.0);
    (*point).is_enlarged = is_enlarged;
}

fn box_of(point: Element) -> vec4<i32> {
    if point.is_nothing {
        return NO_BOX;
    }
    return tet_box(point.tet);
}

fn note(point: Element, is_empty: bool) {
    note_point(is_empty, point.is_enlarged);
}

// Entry and exit of a ray.
struct TetHit {
    hit: bool,
    entry: HitPoint,
    exit: HitPoint,
    // The corners opposite the faces of these.
    entered: u32,
    left: u32,
}

// Takes a point at which the ray passes through a face: the first, then the second.
fn take(found: ptr<function, TetHit>, at: HitPoint, opposite: u32, is_second: bool) {
    if is_second {
        (*found).hit = true;
        (*found).exit = at;
        (*found).left = opposite;
    } else {
        (*found).entry = at;
        (*found).entered = opposite;
    }
}

// Edge functions opposite the corners of a triangle, from those of its edges: rounding around zero is not negative.
fn of_triangle(bc: SignedEdge, ac: SignedEdge, ab: SignedEdge) -> real3 {
    let edges = real3(bc.value, -ac.value, ab.value);
    return max(select(edges, -edges, !bc.positive), real3(0.0));
}

fn is_crossed(bc: SignedEdge, ac: SignedEdge, ab: SignedEdge) -> bool {
    return bc.positive != ac.positive && bc.positive == ab.positive;
}

// Entry and exit of a ray that meets the tet in front of the eye. Of a cell at the eye that is decided exactly: a ray leaves a cell in front
// of an eye that is strictly inside of the face. An eye in a face sees none of the cell behind it, where a depth is within rounding of 0.
fn hit_tet(ray: Ray, point: Element) -> TetHit {
    let tet = point.tet;
    let nowhere = HitPoint(vec2(0.0), 0.0, 0.0);
    var found = TetHit(false, nowhere, nowhere, 0u, 0u);
    let p = shear(ray, tet.a);
    let q = shear(ray, tet.b);
    let r = shear(ray, tet.c);
    let s = shear(ray, tet.d);
    let pq = signed_edge(p, q, 0u, 1u);
    let pr = signed_edge(p, r, 0u, 2u);
    let ps = signed_edge(p, s, 0u, 3u);
    let qr = signed_edge(q, r, 1u, 2u);
    let qs = signed_edge(q, s, 1u, 3u);
    let rs = signed_edge(r, s, 2u, 3u);
    var is_second = false;
    if is_crossed(rs, qs, qr) {
        take(&found, hit_point(ray, of_triangle(rs, qs, qr), Triangle(q, r, s, tet.b, tet.c, tet.d, tet.ids.yzw)), 0u, false);
        is_second = true;
    }
    if is_crossed(rs, ps, pr) {
        take(&found, hit_point(ray, of_triangle(rs, ps, pr), Triangle(p, r, s, tet.a, tet.c, tet.d, tet.ids.xzw)), 1u, is_second);
        is_second = true;
    }
    if is_crossed(qs, ps, pq) {
        take(&found, hit_point(ray, of_triangle(qs, ps, pq), Triangle(p, q, s, tet.a, tet.b, tet.d, tet.ids.xyw)), 2u, is_second);
        is_second = true;
    }
    if is_crossed(qr, pr, pq) {
        take(&found, hit_point(ray, of_triangle(qr, pr, pq), Triangle(p, q, r, tet.a, tet.b, tet.c, tet.ids.xyz)), 3u, is_second);
    }
    if depth_after(found.exit.depth, found.entry.depth) > 0.0 {
        found = TetHit(found.hit, found.exit, found.entry, found.left, found.entered);
    }
    if point.is_at_eye {
        found.hit = found.hit && ((point.eye_inside >> found.left) & 1u) != 0u;
    } else if (params.flags & PERSPECTIVE) != 0u {
        found.hit = found.hit && (found.exit.depth.x + params.pivot) + found.exit.depth.y > 0.0;
    }
    return found;
}

fn fragment_of_tet(ray: Ray, point: Element, found: TetHit, rank: u32) -> Fragment {
    let length = depth_after(found.entry.depth, found.exit.depth);
    var fragment = Fragment(found.entry.depth, found.entry.scalar, rank, vec2(0u), vec2(found.entry.value, found.exit.value));
    fragment.more = bitcast<vec2<u32>>(vec2(found.exit.scalar, length));
    if point_is(AS_CELLS) {
        return fragment;
    }
    fragment.values = vec2(mean_value(point.cell, point.tet.ids));
    if point_is(GAPS) {
        fragment.depth = depth_of_center(ray, point.shape.center);
        fragment.scalar = scalar_of_point(point.cell, point.shape.center);
        fragment.more = vec2(bitcast<u32>(fragment.scalar), 0u);
    } else if point.longer != 1.0 {
        fragment.depth = two_sum(fragment.depth.x, fragment.depth.y + 0.5 * (1.0 - point.longer) * length);
        fragment.more.y = bitcast<u32>(point.longer * length);
    }
    return fragment;
}

// The change of an edge function per distance from the ray, dx and dy.
fn per_step(p: vec4<f32>, q: vec4<f32>, p_h: f32, q_h: f32) -> vec2<f32> {
    return vec2(q_h * p.y - p_h * q.y, p_h * q.x - q_h * p.x);
}

// Whether a ray misses a face for sure: two of its edge functions, around the face, differ in sign.
fn misses(around: vec3<f32>, certain: f32) -> bool {
    return min(min(around.x, around.y), around.z) < -certain && max(max(around.x, around.y), around.z) > certain;
}

// Keeps a fragment for each pixel of a box (first and last column, first and last row) whose ray hits the tet.
fn hit_pixels(rank: u32, point: Element, box: vec4<u32>) {
    let tet = point.tet;
    let middle = vec2((box.x + box.y) / 2u, (box.z + box.w) / 2u);
    let middle_px = vec2<i32>(pixel_at(middle));
    let ray = ray_through(middle);
    let p = vec4<f32>(shear(ray, tet.a));
    let q = vec4<f32>(shear(ray, tet.b));
    let r = vec4<f32>(shear(ray, tet.c));
    let s = vec4<f32>(shear(ray, tet.d));
    let h = depths_of(tet);
    // Edges pq, pr, ps, and qr, qs, rs.
    let at_p = vec3(flat_edge(p, q), flat_edge(p, r), flat_edge(p, s));
    let at_rest = vec3(flat_edge(q, r), flat_edge(q, s), flat_edge(r, s));
    let pq = per_step(p, q, h.x, h.y);
    let pr = per_step(p, r, h.x, h.z);
    let ps = per_step(p, s, h.x, h.w);
    let qr = per_step(q, r, h.y, h.z);
    let qs = per_step(q, s, h.y, h.w);
    let rs = per_step(r, s, h.z, h.w);
    let pitch = 2.0 * params.pitch.xz;
    let p_per_dx = vec3(pq.x, pr.x, ps.x) * pitch.x;
    let p_per_dy = vec3(pq.y, pr.y, ps.y) * pitch.y;
    let rest_per_dx = vec3(qr.x, qs.x, rs.x) * pitch.x;
    let rest_per_dy = vec3(qr.y, qs.y, rs.y) * pitch.y;
    // As for faces (face_hits.wgsl).
    let steps = vec2<f32>(pixel_at(vec2(box.y, box.w)) - pixel_at(vec2(box.x, box.z))) + 1.0;
    let wide = dot(steps, pitch) * abs(h);
    let reaches = vec4(abs(p.x) + abs(p.y), abs(q.x) + abs(q.y), abs(r.x) + abs(r.y), abs(s.x) + abs(s.y)) + wide;
    let far_reach = max(max(reaches.x, reaches.y), max(reaches.z, reaches.w));
    let certain = far_reach * far_reach * (1.0 / 262144.0);
    // Some hits may be behind the eye.
    let at_eye = point.is_at_eye || min(min(h.x, h.y), min(h.z, h.w)) <= 0.0;
    for (var y = box.z; y <= box.w; y++) {
        // Rows go down, the plane's y goes up.
        let dy = f32(i32(pixel_at(vec2(0u, y)).y) - middle_px.y);
        for (var x = box.x; x <= box.y; x++) {
            let dx = f32(i32(pixel_at(vec2(x, 0u)).x) - middle_px.x);
            let e = at_p - dy * p_per_dy + dx * p_per_dx;
            let f = at_rest - dy * rest_per_dy + dx * rest_per_dx;
            let misses_two = misses(vec3(f.x, f.z, -f.y), certain) && misses(vec3(e.y, f.z, -e.z), certain);
            if misses_two && misses(vec3(e.x, f.y, -e.z), certain) && misses(vec3(e.x, f.x, -e.y), certain) {
                continue;
            }
            let tile = y / TILE_PX * params.tiles.x + x / TILE_PX;
            let local = y % TILE_PX * TILE_PX + x % TILE_PX;
            if !is_in_band(tile, local) {
                continue;
            }
            let least = min(abs(e), abs(f));
            if !NEEDS_PLACES && !at_eye && min(min(least.x, least.y), least.z) > certain {
                count_fragment(tile, local);
                continue;
            }
            let here = ray_through(vec2(x, y));
            let found = hit_tet(here, point);
            if found.hit {
                keep_fragment(tile, local, fragment_of_tet(here, point, found, rank));
            }
        }
    }
}
