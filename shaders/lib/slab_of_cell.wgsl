// The square, ball or ellipsoid of a cell.

fn listed_element(rank: u32) -> Element {
    let cell = drawn[rank];
    let tet = corners_of(cell);
    let shape = shape_of(tet);
    let reach = shape.reach;
    var point = point_at(cell, tet.ids, shape.center, reach);
    point.scalars = vec4(tet.a.depth.w, tet.b.depth.w, tet.c.depth.w, tet.d.depth.w);
    if !(reach > 0.0) {
        return point;
    }
    let triple = dot(cross((shape.b - shape.a) / reach, (shape.c - shape.a) / reach), (shape.d - shape.a) / reach);
    point.volume = abs(triple) / 6.0 * point_params.stands_for * reach;
    let size = point_params.scale * reach;
    var outline = ball(size);
    if !point_is(BALL) && !point_is(SQUARE) {
        outline = ellipsoid_of(shape.a, shape.b, shape.c, shape.d, reach);
        outline.size = size;
    }
    give_shape(&point, outline);
    return point;
}
