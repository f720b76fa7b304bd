// View transform: transforms vertices to view coordinates and maps scalars, once per frame. CPU twins: render/cpu/ray.rs,
// `transform`; `ScalarMap::seen`.

// Clamped to stay finite: a cell that reaches beyond 1e30 times the table's range is drawn as if it ended there.
fn seen(scalar: f32) -> f32 {
    return clamp((scalar - params.scalar_offset) * params.scalar_scale, -1e30, 1e30);
}

// The mapped scalars of four cells; behind the last cell its scalar again.
fn seen_from(first: u32) -> vec4<f32> {
    let at = min(vec4(first) + vec4(0u, 1u, 2u, 3u), vec4(params.cell_count - 1u));
    return vec4(seen(scalars[at.x]), seen(scalars[at.y]), seen(scalars[at.z]), seen(scalars[at.w]));
}

@compute @workgroup_size(256)
fn view_transform(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let v = id.x + id.y * groups.x * 256u;
    if v >= params.vertex_count {
        // Behind the vertices a thread is eight cells, whose scalars lie as behind_vertices.wgsl reads them.
        let first = 8u * (v - params.vertex_count);
        if first < params.cell_count {
            vertices[v] = ViewVertex(seen_from(first), seen_from(first + 4u));
        }
        return;
    }
    let p = vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]);
    vertices[v] = in_view(p, vec3(0.0), seen(scalars[v]));
}
