// What hits of faces and of points have in common.

// A triangle: its corners sheared along a ray, and as they are; their ids.
struct Triangle {
    p: real4,
    q: real4,
    r: real4,
    a: ViewVertex,
    b: ViewVertex,
    c: ViewVertex,
    ids: vec3<u32>,
}

// Where a ray passes through a triangle.
struct HitPoint {
    // Depth as `Params` counts, as a sum of two.
    depth: vec2<f32>,
    scalar: f32,
    // With a joint table, the value at vertices, interpolated.
    value: f32,
}

// Where a ray passes through a triangle, from its edge functions opposite the corners. The bits are those that any other with its corners
// in the same order has.
fn hit_point(ray: Ray, edges: real3, on: Triangle) -> HitPoint {
    let weights = weights_of_hit(edges);
    let scalar = on.p.w + weights.y * (on.q.w - on.p.w) + weights.z * (on.r.w - on.p.w);
    let within = f32(scalar_on_face(scalar, on.p.w, on.q.w, on.r.w));
    return HitPoint(depth_of_hit(ray, weights, on.a, on.b, on.c), within, value_at_hit(edges, on.ids));
}

// An edge function in f32.
fn flat_edge(a: vec4<f32>, b: vec4<f32>) -> f32 {
    return a.x * b.y - b.x * a.y;
}

// Whether a vertex is within rounding of the eye.
fn is_at_eye(v: ViewVertex) -> bool {
    let depth = abs(v.depth.x + v.depth.y) * PLANE_SCALE;
    return max(max(abs(v.plane.x), abs(v.plane.z)), depth) < PLANE_SCALE / 1048576.0;
}

// Pixels of a box above which its element is cut into pieces, one a tile: else all other threads would wait for one.
const LARGE_PX: i32 = 1024;

fn is_large(box: vec4<i32>) -> bool {
    return (box.y - box.x + 1) * (box.w - box.z + 1) > LARGE_PX;
}
