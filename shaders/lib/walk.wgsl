// Walk: from each entry through the active cells to the exit, compositing a segment per cell. CPU twin:
// render/cpu/raycast/walk.rs; render/cpu/raycast/mod.rs explains why no ray is lost or doubled.
//
// A thread is a ray, chosen by walk.wgsl or walk_rays.wgsl. Starts of paths are not stored: each thread searches the items of its tile for
// the nearest four starts after the last one taken, and again when these are used up. Lists of any length cost time but no memory, and
// no start is dropped.

// The nearest starts of paths, in order: depths, and cell << 2 | opposite vertex of the face.
struct Starts {
    depth: real4,
    face: vec4<u32>,
    count: u32,
}

fn comes_before(depth_a: real, face_a: u32, depth_b: real, face_b: u32) -> bool {
    return depth_a < depth_b || (depth_a == depth_b && face_a < face_b);
}

fn insert(starts: ptr<function, Starts>, depth: real, face: u32) {
    var d = depth;
    var f = face;
    for (var i = 0u; i < 4u; i++) {
        if comes_before(d, f, (*starts).depth[i], (*starts).face[i]) {
            let last_depth = (*starts).depth[i];
            let last_face = (*starts).face[i];
            (*starts).depth[i] = d;
            (*starts).face[i] = f;
            d = last_depth;
            f = last_face;
        }
    }
    (*starts).count = min((*starts).count + 1u, 4u);
}

// A start of a path: depth, and cell << 2 | opposite vertex of the face; NONE if there is none.
struct Start {
    depth: real,
    face: u32,
}

// Whether a face is hit in front of the eye: the same for both cells at it, whatever the order of its corners there, since
// the terms are summed in an order given by their ids.
fn is_in_front(face: Crossing, ids: vec3<u32>) -> bool {
    let terms = max(face.edges, real3(0.0)) * real3(face.p.z, face.q.z, face.r.z);
    let x = opaque_real(terms.x);
    let y = opaque_real(terms.y);
    let z = opaque_real(terms.z);
    if ids.x > ids.y && ids.x > ids.z {
        return (y + z) + x > real(0.0);
    }
    if ids.y > ids.z {
        return (x + z) + y > real(0.0);
    }
    return (x + y) + z > real(0.0);
}

// Where a path starts in a cell at the eye. The cells that a ray meets are a chain in this plane, in which a face is in
// front of the eye or not; on which side of an edge next to it the eye truly lies does not matter, as long as all cells
// agree. Only for open faces, which have one active cell, the side is decided exactly (`sides`): an eye in the boundary sees
// nothing behind it. The ray starts in the cell that it enters behind (or at) the eye and leaves in front of it; a cell that
// it enters in front, through an open face, is entered as any other.
fn start_in_eye_cell(ray: Ray, cell: u32, sides: u32) -> Start {
    var start = Start(real(0.0), NONE);
    var enters_open = false;
    var enters_in_front = false;
    var leaves_in_front = false;
    for (var opposite = 0u; opposite < 4u; opposite++) {
        let ids = face_vertices(cell, opposite);
        let entered = crossing(ray, ids);
        if entered.hit {
            start = Start(entered.at.x, (cell << 2u) | opposite);
            enters_open = is_open(cell, opposite);
            enters_in_front = select(is_in_front(entered, ids), ((sides >> opposite) & 1u) != 0u, enters_open);
        } else {
            let left = crossing(ray, ids.xzy);
            if left.hit {
                let inside = ((sides >> (4u + opposite)) & 1u) != 0u;
                leaves_in_front = select(is_in_front(left, ids.xzy), inside, is_open(cell, opposite));
            }
        }
    }
    let starts = select(leaves_in_front, enters_open, enters_in_front);
    if !starts {
        start.face = NONE;
    }
    return start;
}

// Whether there is no active cell on the other side of a face.
fn is_open(cell: u32, opposite: u32) -> bool {
    let neighbour = cell_neighbour(cell, opposite);
    return neighbour == NONE || !is_active(neighbour >> 2u);
}

// Finds the nearest starts behind (depth, face) among the items of a tile. Returns the number of all starts behind it. CPU twin:
// `find_starts`.
fn find_starts(ray: Ray, tile: u32, local: vec2<u32>, after_depth: real, after_face: u32, starts: ptr<function, Starts>) -> u32 {
    *starts = Starts(real4(real(NOWHERE)), vec4(NONE), 0u);
    let pairs_at = params.tiles.x * params.tiles.y + 1u;
    var first = 0u;
    if tile > 0u {
        first = bins[tile - 1u];
    }
    let end = min(bins[tile], params.pair_capacity);
    let perspective = (params.flags & PERSPECTIVE) != 0u;
    var found = 0u;
    for (var i = first; i < end; i++) {
        let bounds = bins[pairs_at + PAIR_WORDS * i + 1u];
        let inside = local.x >= (bounds & 15u) && local.x <= ((bounds >> 4u) & 15u)
            && local.y >= ((bounds >> 8u) & 15u) && local.y <= ((bounds >> 12u) & 15u);
        if inside {
            let item = bins[pairs_at + PAIR_WORDS * i];
            var start = Start(real(0.0), NONE);
            if (bounds & EYE_CELL) != 0u {
                start = start_in_eye_cell(ray, item, bounds >> SIDES_SHIFT);
            } else {
                let entered = crossing(ray, face_vertices(item >> 2u, item & 3u));
                if entered.hit && (!perspective || entered.at.x > real(-params.pivot)) {
                    start = Start(entered.at.x, item);
                }
            }
            if start.face != NONE && comes_before(after_depth, after_face, start.depth, start.face) {
                insert(starts, start.depth, start.face);
                found += 1u;
            }
        }
    }
    return found;
}

// State of a ray's walk: the face through which it enters the present cell. Its accumulated light is in `light` and `optics`.
struct Walk {
    ray: Ray,
    cell: u32,
    opposite: u32,
    p: real4,
    q: real4,
    r: real4,
    ids: vec3<u32>,
    edges: real3,
    steps: u32,
    out_of_order: u32,
    stopped_early: bool,
    broken: bool,
}
var<private> path: Walk;

fn begin_path(depth: real, face: u32) {
    let before = path.ray;
    path.ray = ray_from(path.ray, depth);
    light.front -= origin_behind(path.ray, before);
    light.behind = origin_behind(path.ray, ray_from(path.ray, real(0.0)));
    path.cell = face >> 2u;
    path.opposite = face & 3u;
    path.ids = face_vertices(face >> 2u, face & 3u);
    let start = crossing(path.ray, path.ids);
    path.p = start.p;
    path.q = start.q;
    path.r = start.r;
    path.edges = start.edges;
    light.last = start.at;
    light.placed = false;
    medium_begin(value_at_hit(path.edges, path.ids));
}

// Walks through one cell. Returns false at the end of the path or of the ray.
fn step_cell() -> bool {
    path.steps += 1u;
    let tet = cell_vertices(path.cell);
    let new_id = tet[path.opposite];
    let fresh = shear(path.ray, vertices[new_id]);
    let p = path.p;
    let q = path.q;
    let r = path.r;
    var to = real3(edge(fresh, p), edge(fresh, q), edge(fresh, r));
    var positive = to > real3(0.0);
    let bound = CAREFUL * reach(fresh) * real3(reach(p), reach(q), reach(r));
    if any(abs(to) <= bound) {
        let ids = path.ids;
        let a = accurate_edge(fresh, p, new_id, ids.x);
        let b = accurate_edge(fresh, q, new_id, ids.y);
        let c = accurate_edge(fresh, r, new_id, ids.z);
        to = real3(a.value, b.value, c.value);
        positive = vec3(a.positive, b.positive, c.positive);
    }
    // Which corner the new vertex replaces; the triangle turns so that it comes last.
    let ids = path.ids;
    var gone: u32;
    if positive.x && !positive.y {
        // The ray leaves between p and q: r is replaced.
        gone = ids.z;
        path.ids = vec3(ids.x, ids.y, new_id);
        path.edges = real3(-to.y, to.x, path.edges.z);
    } else if positive.y && !positive.z {
        gone = ids.x;
        path.p = q;
        path.q = r;
        path.ids = vec3(ids.y, ids.z, new_id);
        path.edges = real3(-to.z, to.y, path.edges.x);
    } else if positive.z && !positive.x {
        gone = ids.y;
        path.p = r;
        path.q = p;
        path.ids = vec3(ids.z, ids.x, new_id);
        path.edges = real3(-to.x, to.z, path.edges.y);
    } else {
        // All signs are equal: impossible with exact signs.
        path.broken = true;
        return false;
    }
    path.r = fresh;
    let exit = select(0u, 1u, tet.y == gone) + select(0u, 2u, tet.z == gone) + select(0u, 3u, tet.w == gone);
    let neighbour = cell_neighbour(path.cell, exit);
    let here = hit(path.edges, path.p, path.q, path.r);
    if here.x > light.last.x {
        medium_pass(path.cell, value_at_hit(path.edges, path.ids));
        let is_behind = composite(path.cell, here);
        path.out_of_order += u32(!is_behind && light.composited);
        light.last = here;
    }
    if is_opaque() {
        path.stopped_early = true;
        return false;
    }
    if neighbour == NONE || !is_active(neighbour >> 2u) {
        return false;
    }
    path.cell = neighbour >> 2u;
    path.opposite = neighbour & 3u;
    return true;
}

fn render_pixel(tile: u32, local: vec2<u32>, pixel: vec2<u32>) {
    path = Walk();
    path.ray = ray_of_pixel(pixel);
    light_transparent(path.ray);
    ahead_begin(pixel);
    var starts: Starts;
    let entries = find_starts(path.ray, tile, local, real(-NOWHERE), 0u, &starts);
    var going = entries > 0u;
    while going {
        // Four starts at a time; they are shifted after each path.
        begin_path(starts.depth.x, starts.face.x);
        let taken_depth = starts.depth.x;
        let taken_face = starts.face.x;
        while step_cell() {}
        if path.stopped_early {
            break;
        }
        starts.depth = real4(starts.depth.yzw, real(NOWHERE));
        starts.face = vec4(starts.face.yzw, NONE);
        starts.count -= 1u;
        if starts.count == 0u && entries > 4u {
            _ = find_starts(ray_from(path.ray, real(0.0)), tile, local, taken_depth, taken_face, &starts);
        }
        going = starts.count > 0u;
    }
    meet_rest();
    textureStore(color_plane, pixel, optics.light);
    textureStore(depth_plane, pixel, vec4(light.visible_from, 0.0, 0.0, 0.0));
    if entries > 0u {
        note_met(pixel);
        atomicAdd(&counts[STEPS], path.steps);
        atomicAdd(&counts[SEGMENTS], optics.pieces);
        atomicAdd(&counts[ENTRIES], entries);
        atomicAdd(&counts[RAYS_HIT], 1u);
        atomicAdd(&counts[STOPPED_EARLY], u32(path.stopped_early));
        atomicAdd(&counts[OUT_OF_ORDER], path.out_of_order);
        atomicAdd(&counts[BROKEN], u32(path.broken));
    }
}
