// Sums of counts.

// Saturating sum; its largest value exceeds any capacity.
fn add_up(a: u32, b: u32) -> u32 {
    return select(a + b, 0xffffffffu, a > 0xffffffffu - b);
}
