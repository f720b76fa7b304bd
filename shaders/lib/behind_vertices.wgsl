// Numbers stored behind the view vertices, eight in the space of one vertex: the stages that need them have no binding left.

fn number_behind_vertices(i: u32) -> f32 {
    let eight = vertices[params.vertex_count + i / 8u];
    let at = i & 3u;
    return select(eight.depth[at], eight.plane[at], (i & 4u) == 0u);
}
