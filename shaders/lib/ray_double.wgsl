// Planar geometry in f64, for cells so thin that f32 cannot separate their faces. Twin: ray_single.wgsl.

alias real = f64;
alias real2 = vec2<f64>;
alias real3 = vec3<f64>;
alias real4 = vec4<f64>;

struct Ray {
    // Image-plane coordinates times PLANE_SCALE.
    x: f64,
    y: f64,
    // Length of the ray per unit of depth.
    length_per_depth: f32,
    // Depth from which the depths along the ray are counted.
    origin: f64,
}

// The ray of the pixel at a place in the plane, with length 1 per depth, its depths counted from the pivot.
fn ray_through(place: vec2<u32>) -> Ray {
    let n = vec2<f32>(2 * vec2<i32>(pixel_at(place)) + 1 - vec2<i32>(params.image_px));
    let x = f64(n.x) * (f64(params.pitch.x) + f64(params.pitch.y));
    let y = f64(-n.y) * (f64(params.pitch.z) + f64(params.pitch.w));
    return Ray(x, y, 1.0, f64(params.pivot));
}

// Image-plane coordinates of a ray times PLANE_SCALE.
fn on_plane(ray: Ray) -> vec2<f32> {
    return vec2(f32(ray.x), f32(ray.y));
}

// The ray with its depths counted from `depth` behind the pivot.
fn ray_from(ray: Ray, depth: real) -> Ray {
    return Ray(ray.x, ray.y, ray.length_per_depth, f64(params.pivot) + depth);
}

// Depth of the ray's origin behind that of another.
fn origin_behind(ray: Ray, other: Ray) -> real {
    return ray.origin - other.origin;
}

fn depth_of_vertex(v: ViewVertex) -> f64 {
    return (f64(v.depth.x) + f64(v.depth.y)) + f64(v.depth.z);
}

// A vertex sheared along a ray: x and y times PLANE_SCALE, depth from the ray's origin, scalar.
fn shear(ray: Ray, v: ViewVertex) -> real4 {
    let depth = depth_of_vertex(v);
    // The products are rounded here whatever the compiler does, so that all cells and faces at the vertex get the same bits.
    let w = select(f64(1.0), depth, (params.flags & PERSPECTIVE) != 0u);
    let x = (f64(v.plane.x) + f64(v.plane.y)) - opaque_real(ray.x * w);
    let y = (f64(v.plane.z) + f64(v.plane.w)) - opaque_real(ray.y * w);
    return real4(x, y, depth - ray.origin, f64(v.depth.w));
}

// Difference of the depths of two vertices.
fn depth_between(from_: ViewVertex, to: ViewVertex) -> f32 {
    return f32(depth_of_vertex(to) - depth_of_vertex(from_));
}

// Depth where a ray hits the triangle of three vertices, from the weights of the last two, as a sum of two.
fn depth_of_hit(ray: Ray, weights: real3, a: ViewVertex, b: ViewVertex, c: ViewVertex) -> vec2<f32> {
    let first = depth_of_vertex(a);
    let rest = weights.y * (depth_of_vertex(b) - first) + weights.z * (depth_of_vertex(c) - first);
    let depth = (first - ray.origin) + rest;
    let hi = f32(depth);
    return vec2(hi, f32(depth - f64(hi)));
}

// Difference of two depths that are sums of two, rounded to f32.
fn depth_after(from_: vec2<f32>, to: vec2<f32>) -> f32 {
    return f32((f64(to.x) - f64(from_.x)) + (f64(to.y) - f64(from_.y)));
}

// Below this share of the product of the reaches (|x| + |y|) an edge function is computed again with the rounding errors of
// its products: above it the plain value is right to 2^-21 of itself.
const CAREFUL: real = f64(1.0 / 1073741824.0);

// Returns x unchanged, hidden from the compiler.
fn opaque_real(x: real) -> real {
    return x + f64(params.zero);
}

// The rounding error of a product. A number is split where f32 ends: products of two first parts, of 24 bits, are exact, and
// so are those of a first and a second, which has 29.
fn product_rest(a: real, b: real, product: real) -> real {
    let a1 = f64(f32(a));
    let a2 = a - a1;
    let b1 = f64(f32(b));
    let b2 = b - b1;
    return ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
}
