// Layers plan: chooses the next pieces of large faces, at most as many as a slice may have, and their workgroups.

const GROUPS_PER_ROW: u32 = 32768u;

@compute @workgroup_size(1)
fn layers_plan() {
    let from_ = lists[PIECES_TO];
    // If not all pieces fit, the host begins again with a longer list.
    let end = min(lists[PIECE_COUNT], list_params.piece_capacity);
    let to = min(end, from_ + list_params.end);
    lists[PIECES_FROM] = from_;
    lists[PIECES_TO] = to;
    let groups = to - from_;
    args[0] = min(groups, GROUPS_PER_ROW);
    args[1] = (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
    args[2] = 1u;
}
