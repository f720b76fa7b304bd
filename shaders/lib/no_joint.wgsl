// Twin of optics_joint.wgsl for a transfer function of the scalar alone: no values at vertices or cells.

fn medium_begin(value: f32) {}

fn medium_pass(cell: u32, value: f32) {}

fn medium_cut(share: f32) {}
