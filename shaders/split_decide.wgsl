// Split, second part: which blocks of a step are to be split of their own, by what the rays at their corners have seen. CPU twin:
// render/adaptive/blocks.rs, `split` and `reason`. What splits all blocks beside such a one comes after all have decided.

fn has_met(pixel: vec2<u32>) -> u32 {
    let number = number_of(pixel);
    return (atomicLoad(&rays[ray_params.met_at + (number >> 5u)]) >> (number & 31u)) & 1u;
}

// Whether the box of an entry face reaches into a block. CPU twin: render/cpu/raycast/entries.rs, `EntryBins::reach`.
//
// Boxes here are up to 1/16 of a pixel wider than there, and those of more faces on edge are among them: a block may be split that is
// not on the CPU. Of a cell at the eye the faces are not listed; if the eye is outside of one of them, it may reach anywhere.
fn is_reached(corners: vec4<u32>) -> bool {
    let pairs_at = params.tiles.x * params.tiles.y + 1u;
    let first = corners.xy / TILE_PX;
    let last = corners.zw / TILE_PX;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let tile = y * params.tiles.x + x;
            let corner = vec2(x, y) * TILE_PX;
            var begin = 0u;
            if tile > 0u {
                begin = bins[tile - 1u];
            }
            let end = min(bins[tile], params.pair_capacity);
            for (var i = begin; i < end; i++) {
                let bounds = bins[pairs_at + PAIR_WORDS * i + 1u];
                let low = corner + vec2(bounds & 15u, (bounds >> 8u) & 15u);
                let high = corner + vec2((bounds >> 4u) & 15u, (bounds >> 12u) & 15u);
                let is_face = (bounds & EYE_CELL) == 0u || ((bounds >> SIDES_SHIFT) & 15u) != 0u;
                if is_face && all(low <= corners.zw) && all(corners.xy <= high) {
                    return true;
                }
            }
        }
    }
    return false;
}

// Why a block is to be split, of its own; 0 if it is not.
fn reason(corners: vec4<u32>) -> u32 {
    let a = textureLoad(seen_color, corners.xy, 0);
    let b = textureLoad(seen_color, corners.zy, 0);
    let c = textureLoad(seen_color, corners.xw, 0);
    let d = textureLoad(seen_color, corners.zw, 0);
    let difference = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d));
    if any(difference > vec4(ray_params.contrast)) {
        return CONTRAST;
    }
    let met = has_met(corners.xy) + has_met(corners.zy) + has_met(corners.xw) + has_met(corners.zw);
    if met == 0u {
        return select(0u, REACHED, is_reached(corners));
    }
    return select(0u, BORDER, met < 4u);
}

@compute @workgroup_size(16, 16)
fn split_decide(@builtin(global_invocation_id) id: vec3<u32>) {
    let step = atomicLoad(&rays[STEP]);
    let block = id.xy;
    // Those of the first step are split without being asked.
    if step < 2u || any(block >= block_counts(stride_of(step))) {
        return;
    }
    var state = 0u;
    if step == 2u || atomicLoad(&rays[state_at(step - 1u, block / 2u)]) > OPEN {
        state = OPEN | reason(corners_of(step, block));
    }
    atomicStore(&rays[state_at(step, block)], state);
}
