// Records of the cells: vertices, then neighbours (cell << 2 | opposite vertex, or NONE), split over bindings.
// RECORD_PARTS and RECORD_SHIFT are prepended by `Stage::source`.

fn cell_vertices(cell: u32) -> vec4<u32> {
    if RECORD_PARTS == 1u {
        return records_0[2u * cell];
    }
    let at = 2u * (cell & ((1u << RECORD_SHIFT) - 1u));
    switch cell >> RECORD_SHIFT {
        case 0u: { return records_0[at]; }
        case 1u: { return records_1[at]; }
        default: { return records_2[at]; }
    }
}

fn cell_neighbour(cell: u32, face: u32) -> u32 {
    if RECORD_PARTS == 1u {
        return records_0[2u * cell + 1u][face];
    }
    let at = 2u * (cell & ((1u << RECORD_SHIFT) - 1u)) + 1u;
    switch cell >> RECORD_SHIFT {
        case 0u: { return records_0[at][face]; }
        case 1u: { return records_1[at][face]; }
        default: { return records_2[at][face]; }
    }
}

// Vertices of the face opposite vertex `opposite`, counter-clockwise seen from outside.
fn face_vertices(cell: u32, opposite: u32) -> vec3<u32> {
    let tet = cell_vertices(cell);
    switch opposite {
        case 0u: { return tet.yzw; }
        case 1u: { return tet.xwz; }
        case 2u: { return tet.xyw; }
        default: { return tet.xzy; }
    }
}
