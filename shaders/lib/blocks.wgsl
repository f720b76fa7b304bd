// Blocks between rays. CPU twin: render/adaptive/blocks.rs.

// Bits of a block's state: it exists, and the reason why it is split.
const OPEN: u32 = 1u;
const CONTRAST: u32 = 2u;
const BORDER: u32 = 4u;
const REACHED: u32 = 8u;
const BESIDE: u32 = 16u;
// Reasons that split the neighbours, too.
const OF_ITS_OWN: u32 = CONTRAST | BORDER | REACHED;

// Word of a block's state, for step 2 or later.
fn state_at(step: u32, block: vec2<u32>) -> u32 {
    return ray_params.states_at[step - 2u] + block.y * block_counts(stride_of(step)).x + block.x;
}

// The first and the last pixel of a block: columns in x and z, rows in y and w.
fn corners_of(step: u32, block: vec2<u32>) -> vec4<u32> {
    let stride = stride_of(step);
    return vec4(block * stride, min((block + vec2(1u)) * stride, params.size_px - vec2(1u)));
}
