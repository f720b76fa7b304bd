// Planar geometry of a ray. CPU twin: render/cpu/raycast/view.rs.
//
// The ray of a pixel is made the origin of a plane by shearing all vertices along it. In a single f32 the sheared
// coordinates would carry the rounding of the vertex's distance to the image's centre; the sums below carry 2^-36 of it, so
// that coordinates near the ray are right to f32's last bits.

struct Ray {
    // Image-plane coordinates times PLANE_SCALE: a part of 12 bits and a rest, for x and y.
    x: vec2<f32>,
    y: vec2<f32>,
    // Length of the ray per unit of depth.
    length_per_depth: f32,
    // Depth from which the depths along the ray are counted, as a sum of two, the first of 12 bits: near it they keep
    // their digits, however far the eye.
    origin: vec2<f32>,
}

// n * (pitch.x + pitch.y) as a part of 12 bits and a rest; |n| is an integer below 2^24.
fn plane_coordinate(n: f32, pitch: vec2<f32>) -> vec2<f32> {
    let n1 = leading(n);
    let n2 = n - n1;
    let k1 = leading(pitch.x);
    let k2 = pitch.x - k1;
    let product = opaque(n * pitch.x);
    let rest = (((n1 * k1 - product) + n1 * k2 + n2 * k1) + n2 * k2) + n * pitch.y;
    let first = leading(product);
    return vec2(first, (product - first) + rest);
}

fn ray_of_pixel(pixel: vec2<u32>) -> Ray {
    let n = vec2<f32>(2 * vec2<i32>(pixel) + 1 - vec2<i32>(params.size_px));
    let x = plane_coordinate(n.x, params.pitch.xy);
    let y = plane_coordinate(-n.y, params.pitch.zw);
    var length_per_depth = 1.0;
    if (params.flags & PERSPECTIVE) != 0u {
        let p = vec2(x.x + x.y, y.x + y.y) / PLANE_SCALE;
        length_per_depth = sqrt(1.0 + dot(p, p));
    }
    return ray_from(Ray(x, y, length_per_depth, vec2(0.0)), 0.0);
}

// A vertex sheared along a ray: x and y times PLANE_SCALE, depth from the ray's origin, scalar.
fn shear(ray: Ray, v: ViewVertex) -> vec4<f32> {
    let perspective = (params.flags & PERSPECTIVE) != 0u;
    let w1 = select(1.0, v.depth.x, perspective);
    let w2 = select(0.0, v.depth.y, perspective);
    let w = w1 + w2;
    // Products of two 12-bit parts are exact, and so is the first difference near the ray.
    let x = (v.plane.x - ray.x.x * w1) + (v.plane.y - (ray.x.x * w2 + ray.x.y * w));
    let y = (v.plane.z - ray.y.x * w1) + (v.plane.w - (ray.y.x * w2 + ray.y.y * w));
    let depth = (v.depth.x - ray.origin.x) + ((v.depth.y - ray.origin.y) + v.depth.z);
    return vec4(x, y, depth, v.depth.w);
}

// Twice the signed area of the triangle (origin, a, b).
fn edge(a: vec4<f32>, b: vec4<f32>) -> f32 {
    return a.x * b.y - b.x * a.y;
}

// Below this share of the product of the reaches (|x| + |y|) an edge function is computed again with the rounding errors of
// its products: above it the plain value is right to 2^-11 of itself.
const CAREFUL: f32 = 1.0 / 4096.0;

fn reach(v: vec4<f32>) -> f32 {
    return abs(v.x) + abs(v.y);
}

// The rounding error of a product.
fn product_rest(a: f32, b: f32, product: f32) -> f32 {
    let a1 = leading(a);
    let a2 = a - a1;
    let b1 = leading(b);
    let b2 = b - b1;
    return ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
}

struct SignedEdge {
    value: f32,
    positive: bool,
}

// The edge function nearly to the last bit, and its sign: where the difference of the products loses digits it is exact,
// and so is the difference of their rests. Zero is decided as on the CPU, for the ray shifted by (d, d^2), d -> 0, and by
// the ids where two vertices coincide in the plane.
fn accurate_edge(a: vec4<f32>, b: vec4<f32>, a_id: u32, b_id: u32) -> SignedEdge {
    let left = opaque(a.x * b.y);
    let right = opaque(b.x * a.y);
    let value = (left - right) + (product_rest(a.x, b.y, left) - product_rest(b.x, a.y, right));
    var positive = value > 0.0;
    if value == 0.0 {
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

fn signed_edge(a: vec4<f32>, b: vec4<f32>, a_id: u32, b_id: u32) -> SignedEdge {
    let value = edge(a, b);
    if abs(value) > CAREFUL * reach(a) * reach(b) {
        return SignedEdge(value, value > 0.0);
    }
    return accurate_edge(a, b, a_id, b_id);
}

// Depth and scalar where the ray hits a triangle, from its edge functions opposite p, q, r. A convex combination.
fn hit(edges: vec3<f32>, p: vec4<f32>, q: vec4<f32>, r: vec4<f32>) -> vec2<f32> {
    var e = max(edges, vec3(0.0));
    let sum = e.x + e.y + e.z;
    var weights = vec3(1.0 / 3.0);
    if sum > 0.0 {
        weights = e / sum;
    }
    return p.zw + weights.y * (q.zw - p.zw) + weights.z * (r.zw - p.zw);
}

// The ray with its depths counted from `depth` behind the pivot.
fn ray_from(ray: Ray, depth: f32) -> Ray {
    let first = leading(params.pivot + depth);
    return Ray(ray.x, ray.y, ray.length_per_depth, vec2(first, (params.pivot - first) + depth));
}

// Depth of the ray's origin behind that of another: of sums that are close, the difference has few digits.
fn origin_behind(ray: Ray, other: vec2<f32>) -> f32 {
    return (ray.origin.x - other.x) + (ray.origin.y - other.y);
}
