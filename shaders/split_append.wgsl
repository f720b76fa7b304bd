// Split, third part: splits the neighbours of blocks that are split by their own corners, and appends the rays at half the stride in split
// blocks to the list, unless they are in it. CPU twin: render/adaptive/blocks.rs, `split` and `want_in_row`.

// The workgroup's counts of blocks split, by reason, and of blocks filled; of rays appended, and the place of the first.
const KINDS: u32 = 5u;
var<workgroup> kinds: array<atomic<u32>, KINDS>;
var<workgroup> appended: atomic<u32>;
var<workgroup> first_place: u32;

// Whether a neighbour of a block is split by its own corners.
fn is_beside(step: u32, block: vec2<u32>) -> bool {
    let low = max(block, vec2(1u)) - vec2(1u);
    let high = min(block + vec2(1u), block_counts(stride_of(step)) - vec2(1u));
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            if (atomicLoad(&rays[state_at(step, vec2(x, y))]) & OF_ITS_OWN) != 0u {
                return true;
            }
        }
    }
    return false;
}

// Decides whether a block is split, and counts it.
fn decided(step: u32, block: vec2<u32>) -> bool {
    if step == 1u {
        return true;
    }
    let at = state_at(step, block);
    var state = atomicLoad(&rays[at]);
    // Other threads may see either state: neither splits neighbours.
    if state == OPEN && is_beside(step, block) {
        state = OPEN | BESIDE;
        atomicStore(&rays[at], state);
    }
    if state > OPEN {
        atomicAdd(&kinds[firstTrailingBit(state & ~OPEN) - 1u], 1u);
    } else if state == OPEN {
        atomicAdd(&kinds[KINDS - 1u], 1u);
    }
    return state > OPEN;
}

@compute @workgroup_size(16, 16)
fn split_append(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let step = atomicLoad(&rays[STEP]);
    let half = stride_of(step) / 2u;
    let block = id.xy;
    // Numbers of the block's pixels that were not in the list.
    var found: array<u32, 9>;
    var count = 0u;
    if all(block < block_counts(stride_of(step))) && decided(step, block) {
        let corners = corners_of(step, block);
        for (var i = 0u; i < 9u; i++) {
            let number = number_of(min(corners.xy + half * vec2(i % 3u, i / 3u), corners.zw));
            let bit = 1u << (number & 31u);
            if (atomicOr(&rays[ray_params.listed_at + (number >> 5u)], bit) & bit) == 0u {
                found[count] = number;
                count += 1u;
            }
        }
    }
    let place = atomicAdd(&appended, count);
    workgroupBarrier();
    if thread == 0u {
        first_place = atomicAdd(&rays[LISTED], atomicLoad(&appended));
    }
    if thread < KINDS {
        atomicAdd(&rays[BLOCKS + thread], atomicLoad(&kinds[thread]));
    }
    workgroupBarrier();
    for (var i = 0u; i < count; i++) {
        atomicStore(&rays[ray_params.list_at + first_place + place + i], found[i]);
    }
}
