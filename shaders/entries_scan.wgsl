// Entries, second part: turns the item counts of the tiles into the places of their first items; the sum goes behind the last. The same for
// splats of flow.

const THREADS: u32 = 256u;
var<workgroup> sums: array<u32, THREADS>;

@compute @workgroup_size(256)
fn entries_scan(@builtin(local_invocation_index) thread: u32) {
    let tile_count = params.tiles.x * params.tiles.y;
    let share = (tile_count + THREADS - 1u) / THREADS;
    let from_tile = min(thread * share, tile_count);
    let to_tile = min(from_tile + share, tile_count);
    var sum = 0u;
    for (var t = from_tile; t < to_tile; t++) {
        sum = add_up(sum, bins[t]);
    }
    sums[thread] = sum;
    workgroupBarrier();
    var place = 0u;
    for (var i = 0u; i < thread; i++) {
        place = add_up(place, sums[i]);
    }
    for (var t = from_tile; t < to_tile; t++) {
        let count = bins[t];
        bins[t] = place;
        place = add_up(place, count);
    }
    if thread == THREADS - 1u {
        bins[tile_count] = place;
    }
}
