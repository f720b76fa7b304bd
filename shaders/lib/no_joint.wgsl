// Twin of optics_joint.wgsl: a transfer function of the scalar alone asks for nothing beside it.

fn medium_begin(value: f32) {}

fn medium_pass(cell: u32, value: f32) {}

fn medium_cut(share: f32) {}
