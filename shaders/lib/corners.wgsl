// Vertices of the cells, for stages without cell records (cells.wgsl).

fn cell_vertices(cell: u32) -> vec4<u32> {
    return corners[cell];
}
