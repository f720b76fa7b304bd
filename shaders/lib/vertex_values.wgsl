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

// The value of a point: the mean of its corners', or the cell's. CPU twin: render/cpu/points/tile.rs, `values`.
fn mean_value(cell: u32, ids: vec4<u32>) -> f32 {
    if params.cell_count > 0u {
        return number_behind_vertices((params.cell_count + 7u) / 8u * 8u + cell);
    }
    let first = number_behind_vertices(ids.x) + number_behind_vertices(ids.y);
    return 0.25 * (first + (number_behind_vertices(ids.z) + number_behind_vertices(ids.w)));
}
