// Split, first part: begins the next step once the walk has been given all rays of the last one; until then it has no workgroups.

// Threads of a step's workgroup in each direction.
const SPLIT_THREADS: u32 = 16u;

@compute @workgroup_size(1)
fn split_plan() {
    let last = atomicLoad(&rays[STEP]);
    var groups = vec2(0u);
    if last < LAST_STEP && atomicLoad(&rays[CAST]) == atomicLoad(&rays[LISTED]) {
        atomicStore(&rays[STEP], last + 1u);
        groups = (block_counts(stride_of(last + 1u)) + vec2(SPLIT_THREADS - 1u)) / SPLIT_THREADS;
    }
    args[0] = groups.x;
    args[1] = groups.y;
    args[2] = 1u;
    atomicStore(&rays[PAIRS], bins[params.tiles.x * params.tiles.y]);
}
