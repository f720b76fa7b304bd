// The set of active cells.

fn is_active(cell: u32) -> bool {
    return (params.flags & ALL_ACTIVE) != 0u || ((active_cells[cell >> 5u] >> (cell & 31u)) & 1u) == 1u;
}
