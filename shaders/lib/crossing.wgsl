// Faces of cells that a ray enters through.

// Where the ray passes through a triangle from its front.
struct Crossing {
    hit: bool,
    p: vec4<f32>,
    q: vec4<f32>,
    r: vec4<f32>,
    // Edge functions opposite p, q, r.
    edges: vec3<f32>,
    // Depth and scalar.
    at: vec2<f32>,
}

fn crossing(ray: Ray, ids: vec3<u32>) -> Crossing {
    let p = shear(ray, vertices[ids.x]);
    let q = shear(ray, vertices[ids.y]);
    let r = shear(ray, vertices[ids.z]);
    let a = signed_edge(q, r, ids.y, ids.z);
    let b = signed_edge(r, p, ids.z, ids.x);
    let c = signed_edge(p, q, ids.x, ids.y);
    let edges = vec3(a.value, b.value, c.value);
    return Crossing(a.positive && b.positive && c.positive, p, q, r, edges, hit(edges, p, q, r));
}
