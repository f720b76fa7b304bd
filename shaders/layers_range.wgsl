// Layers range: the least and the greatest depth of the boundary in view, from the ranges of the tiles.

const THREADS: u32 = 256u;
var<workgroup> ranges: array<vec2<u32>, THREADS>;

@compute @workgroup_size(256)
fn layers_range(@builtin(local_invocation_index) thread: u32) {
    var range = vec2(0u);
    for (var tile = thread; tile < tile_count(); tile += THREADS) {
        range = max(range, vec2(depths[range_at(tile)], depths[range_at(tile) + 1u]));
    }
    ranges[thread] = range;
    workgroupBarrier();
    if thread == 0u {
        for (var i = 1u; i < THREADS; i++) {
            range = max(range, ranges[i]);
        }
        // With no boundary in view all depth layers are missing, and the range is not used.
        depth_range[0] = depth_of_nearness(range.x);
        depth_range[1] = depth_of_nearness(~range.y);
    }
}
