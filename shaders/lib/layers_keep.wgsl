// Pass `Layers`: keeps the nearest depths at which a ray passes through the boundary. CPU twin: render/cpu/layers/nearest.rs.

const NEEDS_PLACES: bool = true;

fn count_fragment(tile: u32, local: u32) {}

// Each depth layer takes the nearer of two depths and passes the other on: in any order of arrival the nearest remain, sorted.
fn keep_fragment(tile: u32, local: u32, fragment: Fragment) {
    let depth = fragment.depth.x + fragment.depth.y;
    if depth < params.near {
        return;
    }
    let farness = farness_of(depth);
    var nearness = ~farness;
    atomicMax(&depths[range_at(tile)], nearness);
    atomicMax(&depths[range_at(tile) + 1u], farness);
    let at = layers_at(tile, local);
    for (var layer = 0u; layer < list_params.k && nearness != 0u; layer++) {
        nearness = min(nearness, atomicMax(&depths[at + layer], nearness));
    }
}

// First piece of the slice, and the piece behind its last.
fn pieces_of_slice() -> vec2<u32> {
    return vec2(atomicLoad(&lists[PIECES_FROM]), atomicLoad(&lists[PIECES_TO]));
}
