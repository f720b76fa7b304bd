// Planar geometry of a ray. CPU twin: render/cpu/ray.rs.
//
// Shearing all vertices along the ray of a pixel makes it the origin of a plane. ray_single.wgsl or ray_double.wgsl, one of which
// precedes this file, defines the numbers (`real`) and the shear.

fn ray_of_pixel(pixel: vec2<u32>) -> Ray {
    var ray = ray_through(pixel);
    if (params.flags & PERSPECTIVE) != 0u {
        let p = on_plane(ray) / PLANE_SCALE;
        ray.length_per_depth = sqrt(1.0 + dot(p, p));
    }
    return ray;
}

// Twice the signed area of the triangle (origin, a, b).
fn edge(a: real4, b: real4) -> real {
    return a.x * b.y - b.x * a.y;
}

fn reach(v: real4) -> real {
    return abs(v.x) + abs(v.y);
}

struct SignedEdge {
    value: real,
    positive: bool,
}

// The edge function nearly to the last bit, and its sign: where the difference of the products loses digits it is exact,
// and so is the difference of their rounding errors. The sign of zero is decided as on the CPU, for the ray shifted by (d, d^2),
// d -> 0, and by the ids where two vertices coincide in the plane.
fn accurate_edge(a: real4, b: real4, a_id: u32, b_id: u32) -> SignedEdge {
    let left = opaque_real(a.x * b.y);
    let right = opaque_real(b.x * a.y);
    let value = (left - right) + (product_rest(a.x, b.y, left) - product_rest(b.x, a.y, right));
    var positive = value > real(0.0);
    if value == real(0.0) {
        if a.y != b.y {
            positive = a.y > b.y;
        } else if a.x != b.x {
            positive = b.x > a.x;
        } else {
            positive = a_id < b_id;
        }
    }
    return SignedEdge(value, positive);
}

fn signed_edge(a: real4, b: real4, a_id: u32, b_id: u32) -> SignedEdge {
    let value = edge(a, b);
    if abs(value) > CAREFUL * reach(a) * reach(b) {
        return SignedEdge(value, value > real(0.0));
    }
    return accurate_edge(a, b, a_id, b_id);
}

// Weights of the corners of a triangle where the ray hits it, from its edge functions opposite them.
fn weights_of_hit(edges: real3) -> real3 {
    let e = max(edges, real3(0.0));
    let sum = e.x + e.y + e.z;
    var weights = real3(1.0 / 3.0);
    if sum > real(0.0) {
        weights = e / sum;
    }
    return weights;
}

// Depth and scalar where the ray hits a triangle, from its edge functions opposite p, q, r. A convex combination.
fn hit(edges: real3, p: real4, q: real4, r: real4) -> real2 {
    let weights = weights_of_hit(edges);
    let at = p.zw + weights.y * (q.zw - p.zw) + weights.z * (r.zw - p.zw);
    return real2(at.x, scalar_on_face(at.y, p.w, q.w, r.w));
}
