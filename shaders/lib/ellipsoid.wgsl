// The projection of an ellipsoid. CPU twin: render/cpu/splat/ellipsoid.rs, which has the formulas and their errors.

// The image of the unit sphere under x -> size (A x) + centre: the rows of A for x, y and depth.
struct Ellipsoid {
    x: vec3<f32>,
    y: vec3<f32>,
    w: vec3<f32>,
    size: f32,
}

// 3/4 of the corners of the regular tet in the unit sphere, times sqrt 3: A is the sum of the corners from the centroid on with these.
const PER_CORNER: f32 = 0.4330127;

// The ellipsoid of least volume around four corners, given from their centroid on; `size` is any length near theirs.
fn ellipsoid_of(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, d: vec3<f32>, size: f32) -> Ellipsoid {
    let x = vec4(a.x, b.x, c.x, d.x) * (PER_CORNER / size);
    let y = vec4(a.y, b.y, c.y, d.y) * (PER_CORNER / size);
    let w = vec4(a.z, b.z, c.z, d.z) * (PER_CORNER / size);
    return Ellipsoid(row_of(x), row_of(y), row_of(w), size);
}

fn row_of(q: vec4<f32>) -> vec3<f32> {
    return vec3((q.x + q.y) - (q.z + q.w), (q.x - q.y) + (q.z - q.w), (q.x - q.y) - (q.z - q.w));
}

fn ball(radius: f32) -> Ellipsoid {
    return Ellipsoid(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0), radius);
}

// Barycentric coordinates in the tet of a point in the unit sphere.
fn weights_in_tet(at: vec3<f32>) -> vec4<f32> {
    let from_center = vec4((at.x + at.y) + at.z, (at.x - at.y) - at.z, (at.y - at.x) - at.z, (at.z - at.x) - at.y);
    return 0.25 + PER_CORNER * from_center;
}

// The chord of a ray.
struct Chord {
    hit: bool,
    // Squared distance of the ray from the centre in the space of the unit sphere.
    q: f32,
    // Depth of the middle behind that of the centre, and half of its length in depth.
    middle: f32,
    half: f32,
    // The middle in the space of the unit sphere.
    at: vec3<f32>,
    // The section across the ray over pi and over the square of `size`.
    area: f32,
}

// The chord of a ray; `slope` is its x and y per depth, `center` how far it passes the centre, x and y.
fn chord_of(ellipsoid: Ellipsoid, slope: vec2<f32>, center: vec2<f32>) -> Chord {
    let x = ellipsoid.x - slope.x * ellipsoid.w;
    let y = ellipsoid.y - slope.y * ellipsoid.w;
    let c = center / ellipsoid.size;
    let n = cross(x, y);
    let w = c.x * y - c.y * x;
    let n2 = dot(n, n);
    let w2 = dot(w, w);
    // False for n = 0.
    if !(w2 <= n2 && n2 > 0.0) {
        return Chord(false, 0.0, 0.0, 0.0, vec3(0.0), 1.0);
    }
    let at = cross(n, w) / n2;
    let q = w2 / n2;
    let half = sqrt(max(1.0 - q, 0.0) / n2) * abs(dot(n, ellipsoid.w)) * ellipsoid.size;
    return Chord(true, q, dot(ellipsoid.w, at) * ellipsoid.size, half, at, sqrt(n2));
}

// The rows for x and y on the image plane at the centre, over `size`, of an ellipsoid around (x, y, depth), in front of the eye.
fn on_plane_at(ellipsoid: Ellipsoid, center: vec3<f32>) -> array<vec3<f32>, 2> {
    if (params.flags & PERSPECTIVE) == 0u {
        return array(ellipsoid.x, ellipsoid.y);
    }
    let slope = center.xy / center.z;
    return array((ellipsoid.x - slope.x * ellipsoid.w) / center.z, (ellipsoid.y - slope.y * ellipsoid.w) / center.z);
}

// Any direction at right angles to a vector of length 1, or any if it is zero. T. Duff et al., "Building an Orthonormal Basis, Revisited",
// JCGT 6(1), 2017.
fn across(v: vec3<f32>) -> vec3<f32> {
    let sign = select(-1.0, 1.0, v.z >= 0.0);
    let b = v.x * v.y * (-1.0 / (sign + v.z));
    return vec3(b, sign + v.y * v.y * (-1.0 / (sign + v.z)), -v.y);
}

fn unit_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let largest = max(max(abs(v.x), abs(v.y)), abs(v.z));
    if largest > 0.0 {
        return normalize(v / largest);
    }
    return other;
}

// Writes an ellipsoid with another size.
fn rescale(ellipsoid: ptr<function, Ellipsoid>, size: f32) {
    let by = (*ellipsoid).size / size;
    *ellipsoid = Ellipsoid(by * (*ellipsoid).x, by * (*ellipsoid).y, by * (*ellipsoid).w, size);
}

// Widens an ellipsoid across the ray of its centre so that both half axes of its projection are at least `least`, a length on the image
// plane; whether they were not. The centre is in front of the eye.
fn widen(ellipsoid: ptr<function, Ellipsoid>, center: vec3<f32>, least: f32) -> bool {
    let rows = on_plane_at(*ellipsoid, center);
    let x = rows[0];
    let y = rows[1];
    let least_row = least / (*ellipsoid).size;
    let xx_yy = dot(x, x) - dot(y, y);
    let xy = 2.0 * dot(x, y);
    // The rotation that makes the rows orthogonal (one of Jacobi's): the first is the longer one. By half-angle formulas.
    let h = sqrt(xx_yy * xx_yy + xy * xy);
    var turn = vec2(1.0, 0.0);
    if h > 0.0 {
        let cos2 = xx_yy / h;
        let sin2 = xy / h;
        if cos2 >= 0.0 {
            let c = sqrt(0.5 * (1.0 + cos2));
            turn = vec2(c, 0.5 * sin2 / c);
        } else {
            let s = select(-1.0, 1.0, sin2 >= 0.0) * sqrt(0.5 * (1.0 - cos2));
            turn = vec2(0.5 * sin2 / s, s);
        }
    }
    let long = turn.x * x + turn.y * y;
    let short = turn.x * y - turn.y * x;
    if length(short) >= least_row {
        return false;
    }
    var wide_long = long;
    if length(long) < least_row {
        wide_long = unit_or(long, vec3(1.0, 0.0, 0.0)) * least_row;
    }
    let along = unit_or(wide_long, vec3(1.0, 0.0, 0.0));
    // A flat ellipsoid's short row is rounding, of any direction.
    let wide_short = unit_or(short - dot(short, along) * along, across(along)) * least_row;
    let per_plane = select(1.0, center.z, (params.flags & PERSPECTIVE) != 0u);
    let d_long = per_plane * (wide_long - long);
    let d_short = per_plane * (wide_short - short);
    (*ellipsoid).x += turn.x * d_long - turn.y * d_short;
    (*ellipsoid).y += turn.y * d_long + turn.x * d_short;
    return true;
}

// Least and greatest x / w of an ellipsoid with rows `x` and `w` about (`cx`, `cw`), of which all is at least half of `cw` in front of the
// eye. CPU twin: `shadow`.
fn shadow(x: vec3<f32>, w: vec3<f32>, cx: f32, cw: f32) -> vec2<f32> {
    let half = length(w);
    let a = (cw - half) * (cw + half);
    let b = cx * cw - dot(x, w);
    let beside = cw * x - cx * w;
    let behind = cross(x, w);
    let root = sqrt(max(dot(beside, beside) - dot(behind, behind), 0.0));
    return vec2(b - root, b + root) / a;
}

// The box of an ellipsoid around a vertex, `center` its x, y and depth.
fn ellipsoid_box(ellipsoid: Ellipsoid, vertex: ViewVertex, center: vec3<f32>) -> vec4<i32> {
    let size = ellipsoid.size;
    if (params.flags & PERSPECTIVE) == 0u {
        let half = size * vec2(length(ellipsoid.x), length(ellipsoid.y));
        return box_between(PLANE_SCALE * (center.x + vec2(-half.x, half.x)), PLANE_SCALE * (center.y + vec2(-half.y, half.y)));
    }
    let half = size * length(ellipsoid.w);
    if center.z + half <= 0.0 {
        return NO_BOX;
    }
    if center.z >= 2.0 * half {
        let w = size * ellipsoid.w;
        let x = shadow(size * ellipsoid.x, w, center.x, center.z);
        let y = shadow(size * ellipsoid.y, w, center.y, center.z);
        return box_between(PLANE_SCALE * x, PLANE_SCALE * y);
    }
    // At the eye: that of the tet around it, three times the one in it.
    let k = sqrt(3.0) * size;
    let rows = mat3x3(ellipsoid.x, ellipsoid.y, ellipsoid.w);
    let a = moved(vertex, k * (vec3(1.0, 1.0, 1.0) * rows), 0.0);
    let b = moved(vertex, k * (vec3(1.0, -1.0, -1.0) * rows), 0.0);
    let c = moved(vertex, k * (vec3(-1.0, 1.0, -1.0) * rows), 0.0);
    let d = moved(vertex, k * (vec3(-1.0, -1.0, 1.0) * rows), 0.0);
    return tet_box(Tet(a, b, c, d, vec4(0u)));
}
