// Centroid of a cell, and corners about it. CPU twin: render/cpu/points/shape.rs.
//
// Differences of sums of two are right to 2^-24 of themselves however small the cell, and so are the places computed from them.

// A cell about its centroid, in local units.
struct Shape {
    center: ViewVertex,
    // The corners from the centroid on: x, y and depth.
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    d: vec3<f32>,
    // Distance of the farthest of them.
    reach: f32,
}

fn from_to(a: ViewVertex, b: ViewVertex) -> vec3<f32> {
    let x = (b.plane.x - a.plane.x) + (b.plane.y - a.plane.y);
    let y = (b.plane.z - a.plane.z) + (b.plane.w - a.plane.w);
    return vec3(vec2(x, y) / PLANE_SCALE, depth_between(a, b));
}

fn shape_of(tet: Tet) -> Shape {
    let ab = from_to(tet.a, tet.b);
    let ac = from_to(tet.a, tet.c);
    let ad = from_to(tet.a, tet.d);
    let middle = 0.25 * ((ab + ac) + ad);
    let center = moved(tet.a, middle, mean_scalar(tet));
    var shape = Shape(center, -middle, ab - middle, ac - middle, ad - middle, 0.0);
    shape.reach = max(max(length(shape.a), length(shape.b)), max(length(shape.c), length(shape.d)));
    return shape;
}

fn mean_scalar(tet: Tet) -> f32 {
    return 0.25 * ((tet.a.depth.w + tet.b.depth.w) + (tet.c.depth.w + tet.d.depth.w));
}
