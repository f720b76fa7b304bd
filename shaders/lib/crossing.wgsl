// Tests whether a ray enters a cell through a face.

// Where a ray passes through a triangle from its front; only valid if `hit`.
struct Crossing {
    hit: bool,
    p: real4,
    q: real4,
    r: real4,
    // Edge functions opposite p, q, r.
    edges: real3,
    // Depth and scalar.
    at: real2,
}

fn crossing(ray: Ray, ids: vec3<u32>) -> Crossing {
    let p = shear(ray, vertices[ids.x]);
    let q = shear(ray, vertices[ids.y]);
    let r = shear(ray, vertices[ids.z]);
    let a = signed_edge(q, r, ids.y, ids.z);
    let b = signed_edge(r, p, ids.z, ids.x);
    let c = signed_edge(p, q, ids.x, ids.y);
    let edges = real3(a.value, b.value, c.value);
    return Crossing(a.positive && b.positive && c.positive, p, q, r, edges, hit(edges, p, q, r));
}
