// Twin of surfaces.wgsl for cells with the volume alone.

fn medium_ray(ray: Ray) {}

fn medium_segment(cell: u32, from_: real2, to: real2) {
    volume_segment(from_, to);
}
