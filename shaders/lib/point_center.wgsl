// The centre of a point, of a cell the centroid: its place and its scalar. CPU twin: render/cpu/points/shape.rs.

// A vertex moved, with another scalar.
fn moved(v: ViewVertex, by: vec3<f32>, scalar: f32) -> ViewVertex {
    let x = two_sum(v.plane.x, v.plane.y + by.x * PLANE_SCALE);
    let y = two_sum(v.plane.z, v.plane.w + by.y * PLANE_SCALE);
    let depth = two_sum(v.depth.x, by.z);
    let first = leading(depth.x);
    let rest = two_sum(depth.x - first, depth.y + (v.depth.y + v.depth.z));
    return ViewVertex(vec4(x, y), vec4(first, rest, scalar));
}

// The scalar of a point: the mean of its corners', or the cell's.
fn scalar_of_point(cell: u32, center: ViewVertex) -> f32 {
    if params.cell_count > 0u {
        return number_behind_vertices(cell);
    }
    return center.depth.w;
}

// Depth of the centre from the eye; 1 for parallel rays.
fn per_plane_at(center: ViewVertex) -> f32 {
    return select(1.0, center.depth.x + center.depth.y, (params.flags & PERSPECTIVE) != 0u);
}

// Depth of the centre as the depths along rays are counted, as a sum of two.
fn depth_of_center(ray: Ray, center: ViewVertex) -> vec2<f32> {
    return depth_of_hit(ray, real3(real(0.0)), center, center, center);
}
