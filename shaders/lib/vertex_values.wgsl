// The value at vertices of a joint table, mapped by the map of the rows; it lies behind the view vertices.

fn value_of_vertex(vertex: u32) -> f32 {
    return number_behind_vertices(vertex);
}

// The value where a ray hits a triangle, from its edge functions opposite the vertices: interpolated with the scalar's weights, relative
// to one vertex's, and clamped to theirs. CPU twin: `on_face`.
fn value_at_hit(edges: real3, ids: vec3<u32>) -> f32 {
    let e = max(edges, real3(0.0));
    let sum = e.x + e.y + e.z;
    var weights = vec3(1.0 / 3.0);
    if sum > real(0.0) {
        weights = vec3<f32>(e / sum);
    }
    let p = value_of_vertex(ids.x);
    let q = value_of_vertex(ids.y);
    let r = value_of_vertex(ids.z);
    let value = p + weights.y * (q - p) + weights.z * (r - p);
    return clamp(value, min(min(p, q), r), max(max(p, q), r));
}
