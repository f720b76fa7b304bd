// A sorting network (Batcher, "Sorting networks and their applications", 1968) in the form in which all comparisons point the same way: what is
// at a place is compared with what is at the place that differs in the bits of a round's mask. Lists may have any length: places behind the
// end count as the greatest, and stay there.

// The nearer place of comparison `i` of a round: it has the highest bit of the mask unset.
fn near_place(i: u32, mask: u32) -> u32 {
    let below = (1u << firstLeadingBit(mask)) - 1u;
    return ((i & ~below) << 1u) | (i & below);
}
