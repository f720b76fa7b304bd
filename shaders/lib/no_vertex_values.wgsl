// Twin of vertex_values.wgsl: vertices have nothing beside their scalars.

fn value_at_hit(edges: real3, ids: vec3<u32>) -> f32 {
    return 0.0;
}
