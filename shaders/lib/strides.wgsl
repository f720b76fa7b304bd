// Numbers of blocks between rays. CPU twin: render/adaptive/blocks.rs, `begin`.

// Pixels from one block of a step to the next.
fn stride_of(step: u32) -> u32 {
    return 32u >> step;
}

// Number of columns and rows of blocks.
fn block_counts(stride: u32) -> vec2<u32> {
    return max((params.size_px - vec2(1u) + vec2(stride - 1u)) / stride, vec2(1u));
}
