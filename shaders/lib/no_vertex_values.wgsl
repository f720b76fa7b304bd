// Twin of vertex_values.wgsl for vertices with scalars alone.

fn value_at_hit(edges: real3, ids: vec3<u32>) -> f32 {
    return 0.0;
}

fn mean_value(cell: u32, ids: vec4<u32>) -> f32 {
    return 0.0;
}
