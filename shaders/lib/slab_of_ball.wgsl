// The ball of a cloud's point, or the square around it. Its cell has the number of its vertex.

fn listed_element(rank: u32) -> Element {
    let cell = drawn[rank];
    // The radius, and half of the thickness at the middle: of a ball without a volume of its own the radius again.
    let radii = balls[cell];
    var point = point_at(cell, vec4(cell), vertices[cell], radii.x);
    if !(radii.x > 0.0) {
        return point;
    }
    // 4 pi / 3.
    point.volume = 4.1887902 * radii.y * point_params.stands_for;
    give_shape(&point, ball(point_params.scale * radii.x));
    return point;
}
