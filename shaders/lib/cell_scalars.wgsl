// Twin of no_surfaces.wgsl for scalars of cells, which lie behind the view vertices: each segment has its cell's at both ends. CPU twin:
// `CellMedium`.

fn medium_ray(ray: Ray) {}

fn medium_segment(cell: u32, from_: real2, to: real2) {
    // The place in the table is that of another cell's scalar.
    light.placed = false;
    let scalar = real(number_behind_vertices(cell));
    volume_segment(real2(from_.x, scalar), real2(to.x, scalar));
}
