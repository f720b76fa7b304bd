// Twin of surfaces.wgsl: cells have nothing but the volume in them.

fn medium_ray(ray: Ray) {}

fn medium_segment(cell: u32, from_: real2, to: real2) {
    volume_segment(from_, to);
}
