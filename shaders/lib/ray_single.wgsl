// Planar geometry in f32. Twin: ray_double.wgsl.
//
// In a single f32 the sheared coordinates would carry the rounding of the vertex's distance to the image's centre; the sums
// below carry 2^-36 of it, so that coordinates near the ray are right to f32's last bits.

alias real = f32;
alias real2 = vec2<f32>;
alias real3 = vec3<f32>;
alias real4 = vec4<f32>;

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

// The ray of the pixel at a place in the plane, with length 1 per depth, its depths counted from the pivot.
fn ray_through(place: vec2<u32>) -> Ray {
    let n = vec2<f32>(2 * vec2<i32>(pixel_at(place)) + 1 - vec2<i32>(params.image_px));
    let origin = leading(params.pivot);
    let x = plane_coordinate(n.x, params.pitch.xy);
    let y = plane_coordinate(-n.y, params.pitch.zw);
    return Ray(x, y, 1.0, vec2(origin, params.pivot - origin));
}

// Image-plane coordinates of a ray times PLANE_SCALE.
fn on_plane(ray: Ray) -> vec2<f32> {
    return vec2(ray.x.x + ray.x.y, ray.y.x + ray.y.y);
}

// The ray with its depths counted from `depth` behind the pivot.
fn ray_from(ray: Ray, depth: real) -> Ray {
    let first = leading(params.pivot + depth);
    return Ray(ray.x, ray.y, ray.length_per_depth, vec2(first, (params.pivot - first) + depth));
}

// Depth of the ray's origin behind that of another: of sums that are close, the difference has few digits.
fn origin_behind(ray: Ray, other: Ray) -> real {
    return (ray.origin.x - other.origin.x) + (ray.origin.y - other.origin.y);
}

// A vertex sheared along a ray: x and y times PLANE_SCALE, depth from the ray's origin, scalar.
fn shear(ray: Ray, v: ViewVertex) -> real4 {
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

// Difference of the depths of two vertices, nearly without error however large they are.
fn depth_between(from_: ViewVertex, to: ViewVertex) -> f32 {
    return (to.depth.x - from_.depth.x) + ((to.depth.y - from_.depth.y) + (to.depth.z - from_.depth.z));
}

// Depth where a ray hits the triangle of three vertices, from the weights of the last two, as a sum of two.
fn depth_of_hit(ray: Ray, weights: real3, a: ViewVertex, b: ViewVertex, c: ViewVertex) -> vec2<f32> {
    let rest = weights.y * depth_between(a, b) + weights.z * depth_between(a, c);
    let depth = two_sum(a.depth.x - ray.origin.x, rest);
    return two_sum(depth.x, depth.y + ((a.depth.y - ray.origin.y) + a.depth.z));
}

// Difference of two depths that are sums of two.
fn depth_after(from_: vec2<f32>, to: vec2<f32>) -> f32 {
    return opaque(to.x - from_.x) + opaque(to.y - from_.y);
}

// Below this share of the product of the reaches (|x| + |y|) an edge function is computed again with the rounding errors of
// its products: above it the plain value is right to 2^-11 of itself.
const CAREFUL: real = 1.0 / 4096.0;

fn opaque_real(x: real) -> real {
    return opaque(x);
}

// The rounding error of a product.
fn product_rest(a: real, b: real, product: real) -> real {
    let a1 = leading(a);
    let a2 = a - a1;
    let b1 = leading(b);
    let b2 = b - b1;
    return ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
}
