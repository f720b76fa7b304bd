// Twin of cell_scalars.wgsl with a joint table: each segment has its cell's value of the rows, too. These lie behind the scalars, from
// the next multiple of eight on.

fn medium_ray(ray: Ray) {}

fn medium_segment(cell: u32, from_: real2, to: real2) {
    // The place in the table is that of another cell.
    light.placed = false;
    let scalar = real(number_behind_vertices(cell));
    medium_begin(number_behind_vertices((params.cell_count + 7u) / 8u * 8u + cell));
    volume_segment(real2(from_.x, scalar), real2(to.x, scalar));
}
