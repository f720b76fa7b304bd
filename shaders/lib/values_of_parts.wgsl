// Values of the source's cells, which the mesh has in parts: each cell has that of the one it is a part of. CPU twin:
// `SourceCells::expand`. Twin: values_as_stored.wgsl.

fn value_of(i: u32) -> u32 {
    return source_cells[i];
}
