// The corners of a cell, sorted by their places: what is summed over them does not depend on the order in which the cell has them.

fn is_less(a: vec4<f32>, b: vec4<f32>) -> bool {
    return a.x < b.x || (a.x == b.x && (a.y < b.y || (a.y == b.y && (a.z < b.z || (a.z == b.z && a.w < b.w)))));
}

fn is_before(a: ViewVertex, b: ViewVertex) -> bool {
    return is_less(a.depth, b.depth) || (all(a.depth == b.depth) && is_less(a.plane, b.plane));
}

fn corners_of(cell: u32) -> Tet {
    let ids = cell_vertices(cell);
    var tet = Tet(vertices[ids.x], vertices[ids.y], vertices[ids.z], vertices[ids.w], ids);
    if is_before(tet.b, tet.a) {
        tet = Tet(tet.b, tet.a, tet.c, tet.d, tet.ids.yxzw);
    }
    if is_before(tet.d, tet.c) {
        tet = Tet(tet.a, tet.b, tet.d, tet.c, tet.ids.xywz);
    }
    if is_before(tet.c, tet.a) {
        tet = Tet(tet.c, tet.b, tet.a, tet.d, tet.ids.zyxw);
    }
    if is_before(tet.d, tet.b) {
        tet = Tet(tet.a, tet.d, tet.c, tet.b, tet.ids.xwzy);
    }
    if is_before(tet.c, tet.b) {
        tet = Tet(tet.a, tet.c, tet.b, tet.d, tet.ids.xzyw);
    }
    return tet;
}
