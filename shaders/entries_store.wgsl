// Entries, third part: stores the items of each tile, with their boxes in it. Afterwards bins[t] is where the items of tile t end.
// Their order within a tile depends on the scheduling of threads; the walk sorts the starts that it finds.

@compute @workgroup_size(64)
fn entries_store(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let item = id.x + id.y * groups.x * 64u;
    if item >= params.item_count {
        return;
    }
    let bounds = item_box(item);
    if bounds.x > bounds.y || bounds.z > bounds.w {
        return;
    }
    let pairs_at = params.tiles.x * params.tiles.y + 1u;
    let box = vec4<u32>(bounds);
    let tiles = box / TILE_PX;
    var word = items[item];
    var kind = 0u;
    if item >= params.face_count {
        let at = params.face_count + 2u * (item - params.face_count);
        word = items[at];
        kind = EYE_CELL | (items[at + 1u] << SIDES_SHIFT);
    }
    for (var y = tiles.z; y <= tiles.w; y++) {
        for (var x = tiles.x; x <= tiles.y; x++) {
            let place = atomicAdd(&bins[y * params.tiles.x + x], 1u);
            // If pairs do not fit, the host reads from the total how many there are, and renders the frame again.
            if place < params.pair_capacity {
                let corner = vec2(x, y) * TILE_PX;
                let low = vec2(max(box.x, corner.x), max(box.z, corner.y)) - corner;
                let high = vec2(min(box.y - corner.x, TILE_PX - 1u), min(box.w - corner.y, TILE_PX - 1u));
                let at = pairs_at + PAIR_WORDS * place;
                atomicStore(&bins[at], word);
                atomicStore(&bins[at + 1u], kind | low.x | (high.x << 4u) | (low.y << 8u) | (high.y << 12u));
            }
        }
    }
}
