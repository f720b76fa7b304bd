// Fragments pieces: tests elements with large boxes, tile by tile; a thread is half a row of the tile.

@compute @workgroup_size(32)
fn fragments_pieces(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let slice = pieces_of_slice();
    let piece = slice.x + group.x + group.y * groups.x;
    if piece >= slice.y {
        return;
    }
    let rank = atomicLoad(&lists[piece_at(piece)]);
    let tile = atomicLoad(&lists[piece_at(piece) + 1u]);
    if !(is_in_band(tile, list_params.first_pixel)) {
        return;
    }
    let element = listed_element(rank);
    let box = box_of(element);
    let corner = vec2<i32>(vec2(tile % params.tiles.x, tile / params.tiles.x) * TILE_PX);
    let row = corner.y + i32(thread / 2u);
    let half = i32(TILE_PX) / 2;
    let left = corner.x + i32(thread & 1u) * half;
    let first = max(box.x, left);
    let last = min(box.y, left + half - 1);
    if row >= box.z && row <= box.w && first <= last {
        hit_pixels(rank, element, vec4(u32(first), u32(last), u32(row), u32(row)));
    }
}
