// Twin of optics_grid.wgsl: a transfer function of the scalar alone asks for nothing beside it.

fn grid_begin(value: f32) {}

fn grid_pass(cell: u32, value: f32) {}

fn grid_cut(share: f32) {}
