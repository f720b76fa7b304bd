// Rays through squares and ellipsoids, which are slabs of one scalar. CPU twin: render/cpu/points/shape.rs. slab_of_cell.wgsl or
// slab_of_ball.wgsl makes them.

// What is listed: a point.
struct Element {
    cell: u32,
    ids: vec4<u32>,
    // Its centre, and the depth of that from the eye; 1 for parallel rays.
    center: ViewVertex,
    per_plane: f32,
    // Distance from there of the farthest corner of the cell, or the radius of the ball.
    reach: f32,
    ellipsoid: Ellipsoid,
    // Of a square half its width at the depth of its centre.
    half: f32,
    // Volume of the cells that it stands for, over the square of its reach.
    volume: f32,
    // Scalars of the corners; the scalar of the point.
    scalars: vec4<f32>,
    scalar: f32,
    // It has no extent, or it was widened.
    is_nothing: bool,
    is_enlarged: bool,
}

// A point without extent.
fn point_at(cell: u32, ids: vec4<u32>, center: ViewVertex, reach: f32) -> Element {
    let nothing = Ellipsoid(vec3(0.0), vec3(0.0), vec3(0.0), 1.0);
    let scalar = scalar_of_point(cell, center);
    return Element(cell, ids, center, per_plane_at(center), reach, nothing, 0.0, 0.0, vec4(scalar), scalar, true, false);
}

// Gives a point its shape: the square around a ball, or an ellipsoid; at least half a pixel wide.
fn give_shape(point: ptr<function, Element>, whole: Ellipsoid) {
    let per_plane = (*point).per_plane;
    let is_in_front = per_plane > 0.0;
    let least = point_params.least * per_plane;
    if point_is(SQUARE) {
        (*point).half = max(whole.size, least);
        (*point).is_nothing = !is_in_front;
        (*point).is_enlarged = whole.size < least;
        return;
    }
    var shape = whole;
    if is_in_front {
        // Of a shape far below a pixel, the widened rows would overflow.
        rescale(&shape, max(whole.size, least));
        (*point).is_enlarged = widen(&shape, center_of(*point), point_params.least);
    }
    (*point).ellipsoid = shape;
    (*point).is_nothing = false;
}

// The centre: x, y and depth.
fn center_of(point: Element) -> vec3<f32> {
    let v = point.center;
    return vec3(vec2(v.plane.x + v.plane.y, v.plane.z + v.plane.w) / PLANE_SCALE, v.depth.x + v.depth.y);
}

fn box_of(point: Element) -> vec4<i32> {
    if point.is_nothing {
        return NO_BOX;
    }
    let center = center_of(point);
    if !point_is(SQUARE) {
        return ellipsoid_box(point.ellipsoid, point.center, center);
    }
    let to_plane = PLANE_SCALE / point.per_plane;
    return box_between((center.x + vec2(-point.half, point.half)) * to_plane, (center.y + vec2(-point.half, point.half)) * to_plane);
}

fn note(point: Element, is_empty: bool) {
    note_point(is_empty, point.is_enlarged);
}

// The slab of a ray.
struct Slab {
    hit: bool,
    // Depth of its middle behind the centre, thickness in depth, scalar.
    middle: f32,
    thickness: f32,
    scalar: f32,
}

fn slab_of(point: Element, ray: Ray) -> Slab {
    let from_ray = vec2<f32>(shear(ray, point.center).xy / real(PLANE_SCALE));
    if point_is(SQUARE) {
        let per_width = point.reach / (2.0 * point.half);
        return Slab(all(abs(from_ray) <= vec2(point.half)), 0.0, point.volume * per_width * per_width, point.scalar);
    }
    let slope = select(vec2(0.0), on_plane(ray) / PLANE_SCALE, (params.flags & PERSPECTIVE) != 0u);
    let chord = chord_of(point.ellipsoid, slope, from_ray);
    let relative = point.reach / point.ellipsoid.size;
    // All of the chord is behind the eye.
    let is_behind = (params.flags & PERSPECTIVE) != 0u && point.per_plane + (chord.middle + chord.half) <= 0.0;
    // 3 / (2 pi).
    let thickness = 0.47746483 * point.volume * relative * relative * sqrt(max(1.0 - chord.q, 0.0)) / chord.area;
    // Balls around one place have one middle, to the bit: where the ray is nearest to the centre.
    let nearest = dot(from_ray, slope) / (1.0 + dot(slope, slope));
    let middle = select(chord.middle, nearest, point_is(BALL));
    return Slab(chord.hit && !is_behind, middle, thickness, scalar_in(point, chord.at));
}

// The scalar at a point of the unit sphere: that of the point if it is a ball, or cells have scalars; else within the corners' range.
fn scalar_in(point: Element, at: vec3<f32>) -> f32 {
    if point_is(BALL) || params.cell_count > 0u {
        return point.scalar;
    }
    let weights = weights_in_tet(at * point_params.radius);
    let s = point.scalars;
    // Relative to one corner's: a constant scalar stays exact.
    let rise = (weights.y * (s.y - s.x) + weights.z * (s.z - s.x)) + weights.w * (s.w - s.x);
    return clamp(s.x + rise, min(min(s.x, s.y), min(s.z, s.w)), max(max(s.x, s.y), max(s.z, s.w)));
}

fn fragment_of_slab(ray: Ray, point: Element, slab: Slab, rank: u32) -> Fragment {
    let center = depth_of_center(ray, point.center);
    let values = vec2(mean_value(point.cell, point.ids));
    if point_is(GAPS) {
        return Fragment(center, point.scalar, rank, vec2(bitcast<u32>(point.scalar), 0u), values);
    }
    let middle = two_sum(center.x, center.y + slab.middle);
    return Fragment(middle, slab.scalar, rank, bitcast<vec2<u32>>(vec2(slab.scalar, slab.thickness)), values);
}

// Keeps a fragment for each pixel of a box (first and last column, first and last row) whose ray hits the point.
fn hit_pixels(rank: u32, point: Element, box: vec4<u32>) {
    for (var y = box.z; y <= box.w; y++) {
        for (var x = box.x; x <= box.y; x++) {
            let tile = y / TILE_PX * params.tiles.x + x / TILE_PX;
            let local = y % TILE_PX * TILE_PX + x % TILE_PX;
            if !is_in_band(tile, local) {
                continue;
            }
            let ray = ray_through(vec2(x, y));
            let slab = slab_of(point, ray);
            if !slab.hit {
                continue;
            }
            if NEEDS_PLACES {
                keep_fragment(tile, local, fragment_of_slab(ray, point, slab, rank));
            } else {
                count_fragment(tile, local);
            }
        }
    }
}
