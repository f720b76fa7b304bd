// Pass `Count`: counts the fragments of each pixel.

const NEEDS_PLACES: bool = false;

fn count_fragment(tile: u32, local: u32) {
    atomicAdd(&lists[pixel_of(tile, local)], 1u);
}

fn keep_fragment(tile: u32, local: u32, fragment: Fragment) {
    count_fragment(tile, local);
}

// First piece of the slice, and the piece behind its last.
fn pieces_of_slice() -> vec2<u32> {
    return vec2(list_params.first, list_params.end);
}
