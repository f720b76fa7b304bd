// The value at vertices of a joint table, mapped by the map of the rows; it lies behind the view vertices.

// The value where a ray hits a triangle, from its edge functions opposite the vertices: interpolated with the scalar's weights, relative
// to one vertex's, and clamped to theirs. CPU twin: `on_face`.
fn value_at_hit(edges: real3, ids: vec3<u32>) -> f32 {
    let weights = vec3<f32>(weights_of_hit(edges));
    let p = number_behind_vertices(ids.x);
    let q = number_behind_vertices(ids.y);
    let r = number_behind_vertices(ids.z);
    let value = p + weights.y * (q - p) + weights.z * (r - p);
    return clamp(value, min(min(p, q), r), max(max(p, q), r));
}
