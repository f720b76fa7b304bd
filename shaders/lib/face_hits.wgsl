// Hit test of rays and faces. CPU twin: render/cpu/raster.
//
// A ray hits a face if the three edge functions of its corners, sheared along the ray, have one sign. Each is computed with
// the lower of its two vertices first: faces that share an edge get the same bits, whatever the compiler does. Away from its
// edges a cheaper test suffices: an edge function of corners p, q that have been sheared along one ray is linear in the
// distance (dx, dy) from that ray,
//
//   E(dx, dy) = p.x q.y - q.x p.y  +  dx (q.h p.y - p.h q.y)  +  dy (p.h q.x - q.h p.x)
//
// (h: depth in perspective, 1 in parallel projection).

// What is listed: a face.
struct Element {
    ids: vec3<u32>,
    // The cells in front of it and behind it, for a ray that sees its corners counter-clockwise.
    cells: vec2<u32>,
}

// Whether a face with these corners is not entirely in front of the eye.
fn reaches_eye(a: ViewVertex, b: ViewVertex, c: ViewVertex) -> bool {
    let w = vec3(a.depth.x + a.depth.y, b.depth.x + b.depth.y, c.depth.x + c.depth.y);
    return (params.flags & PERSPECTIVE) != 0u && !all(w > vec3(0.0));
}

// Where a ray passes through a face.
struct FaceHit {
    hit: bool,
    // The ray sees the ascending corners clockwise.
    turned: bool,
    // The hit is in front of the eye, as computed from the corners.
    in_front: bool,
    at: HitPoint,
}

const NO_HIT: FaceHit = FaceHit(false, false, true, HitPoint(vec2(0.0), 0.0, 0.0));

// Tests a ray against a face; `ids` ascend, the ray's depths are counted as `Params` has it.
fn hit_face(ray: Ray, ids: vec3<u32>, a: ViewVertex, b: ViewVertex, c: ViewVertex) -> FaceHit {
    var found = NO_HIT;
    let p = shear(ray, a);
    let q = shear(ray, b);
    let r = shear(ray, c);
    let bc = signed_edge(q, r, ids.y, ids.z);
    let ac = signed_edge(p, r, ids.x, ids.z);
    let ab = signed_edge(p, q, ids.x, ids.y);
    found.hit = bc.positive != ac.positive && bc.positive == ab.positive;
    if !found.hit {
        return found;
    }
    found.turned = !bc.positive;
    let edges = max(select(real3(bc.value, -ac.value, ab.value), real3(-bc.value, ac.value, -ab.value), found.turned), real3(0.0));
    // The sum is the same for both cells at the face: its terms are in the order of the ids.
    let terms = edges * real3(p.z, q.z, r.z);
    found.in_front = (opaque_real(terms.x) + opaque_real(terms.y)) + opaque_real(terms.z) > real(0.0);
    found.at = hit_point(ray, edges, Triangle(p, q, r, a, b, c, ids));
    return found;
}

// The fragment of a hit.
fn fragment_of_hit(at: HitPoint, rank: u32, cells: vec2<u32>) -> Fragment {
    return Fragment(at.depth, at.scalar, rank, cells, vec2(at.value, 0.0));
}

// Keeps a fragment for each pixel of a box (first and last column, first and last row) whose ray hits a face.
fn hit_pixels(rank: u32, face: Element, box: vec4<u32>) {
    let a = vertices[face.ids.x];
    let b = vertices[face.ids.y];
    let c = vertices[face.ids.z];
    let at_eye = reaches_eye(a, b, c);
    let middle = vec2((box.x + box.y) / 2u, (box.z + box.w) / 2u);
    let middle_px = vec2<i32>(pixel_at(middle));
    let ray = ray_through(middle);
    let p = vec4<f32>(shear(ray, a));
    let q = vec4<f32>(shear(ray, b));
    let r = vec4<f32>(shear(ray, c));
    let h = select(vec3(1.0), vec3(a.depth.x + a.depth.y, b.depth.x + b.depth.y, c.depth.x + c.depth.y), (params.flags & PERSPECTIVE) != 0u);
    let at = vec3(flat_edge(q, r), flat_edge(r, p), flat_edge(p, q));
    let per_dx = vec3(h.z * q.y - h.y * r.y, h.x * r.y - h.z * p.y, h.y * p.y - h.x * q.y) * (2.0 * params.pitch.x);
    let per_dy = vec3(h.y * r.x - h.z * q.x, h.z * p.x - h.x * r.x, h.x * q.x - h.y * p.x) * (2.0 * params.pitch.z);
    // A bound on all sheared coordinates in the box; its square times 2^-18 exceeds all rounding above: six products of at most
    // that square each, and their factors, are rounded by 2^-24 of themselves at most four times.
    let steps = vec2<f32>(pixel_at(vec2(box.y, box.w)) - pixel_at(vec2(box.x, box.z))) + 1.0;
    let wide = 2.0 * (steps.x * params.pitch.x + steps.y * params.pitch.z) * abs(h);
    let reaches = vec3(dot(abs(p.xy), vec2(1.0)), dot(abs(q.xy), vec2(1.0)), dot(abs(r.xy), vec2(1.0))) + wide;
    let far_reach = max(max(reaches.x, reaches.y), reaches.z);
    let certain = far_reach * far_reach * (1.0 / 262144.0);
    for (var y = box.z; y <= box.w; y++) {
        // Rows go down, the plane's y goes up.
        let in_row = at - f32(i32(pixel_at(vec2(0u, y)).y) - middle_px.y) * per_dy;
        for (var x = box.x; x <= box.y; x++) {
            let e = in_row + f32(i32(pixel_at(vec2(x, 0u)).x) - middle_px.x) * per_dx;
            let least = min(min(e.x, e.y), e.z);
            let most = max(max(e.x, e.y), e.z);
            // Two edge functions certainly differ in sign.
            if least < -certain && most > certain {
                continue;
            }
            let tile = y / TILE_PX * params.tiles.x + x / TILE_PX;
            let local = y % TILE_PX * TILE_PX + x % TILE_PX;
            if !is_in_band(tile, local) {
                continue;
            }
            let inside = !at_eye && (least > certain || most < -certain);
            if inside && !NEEDS_PLACES {
                count_fragment(tile, local);
                continue;
            }
            let found = hit_face(ray_through(vec2(x, y)), face.ids, a, b, c);
            if found.hit && (!at_eye || is_seen(found, face)) {
                let cells = select(face.cells, face.cells.yx, found.turned);
                keep_fragment(tile, local, fragment_of_hit(found.at, list_params.eye_count + rank, cells));
            }
        }
    }
}

// The box of a face, the same in all bands.
fn box_of(face: Element) -> vec4<i32> {
    let a = vertices[face.ids.x];
    let b = vertices[face.ids.y];
    let c = vertices[face.ids.z];
    if (params.flags & PERSPECTIVE) != 0u && (is_at_eye(a) || is_at_eye(b) || is_at_eye(c)) {
        return whole_plane();
    }
    return face_box(a, b, c);
}

// Only points are noted.
fn note(face: Element, is_empty: bool) {}

fn end_notes(thread: u32) {}
