// The next pieces of large faces, as many as a slice may have, and the workgroups for them.

const GROUPS_PER_ROW: u32 = 32768u;

@compute @workgroup_size(1)
fn layers_plan() {
    let from_ = lists[PIECES_TO];
    // Without room for all, the host begins again with more.
    let end = min(lists[PIECE_COUNT], face_params.piece_capacity);
    let to = min(end, from_ + face_params.end);
    lists[PIECES_FROM] = from_;
    lists[PIECES_TO] = to;
    let groups = to - from_;
    args[0] = min(groups, GROUPS_PER_ROW);
    args[1] = (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
    args[2] = 1u;
}
