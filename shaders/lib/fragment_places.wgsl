// Where the fragments of a pixel are stored, once they have been counted and stored.

// Slot of a pixel's first fragment, and the number of its fragments.
fn fragments_of(tile: u32, local: u32) -> vec2<u32> {
    var begin = 0u;
    if local > 0u {
        begin = lists[pixel_of(tile, local - 1u)];
    }
    return vec2(lists[base_of(tile)] + begin, lists[pixel_of(tile, local)] - begin);
}
