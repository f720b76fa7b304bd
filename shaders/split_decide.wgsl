// Split, second part: decides which blocks of a step are split by the rays at their own corners. CPU twin: render/adaptive/blocks.rs,
// `split` and `reason`. Their neighbours are split once all blocks have decided (split_append.wgsl).

fn has_met(pixel: vec2<u32>) -> u32 {
    let number = number_of(pixel);
    return (atomicLoad(&rays[ray_params.met_at + (number >> 5u)]) >> (number & 31u)) & 1u;
}

// Whether the box of an entry face reaches into a block. CPU twin: render/cpu/raycast/entries.rs, `EntryBins::reach`.
//
// Only items whose listed boxes overlap the block are tested: those boxes are up to 1/16 of a pixel wider. Faces of cells at the eye are
// not listed themselves.
fn is_reached(block: vec4<u32>) -> bool {
    let pairs_at = params.tiles.x * params.tiles.y + 1u;
    let first = block.xy / TILE_PX;
    let last = block.zw / TILE_PX;
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
                let at = pairs_at + PAIR_WORDS * i;
                let bounds = bins[at + 1u];
                let low = corner + vec2(bounds & 15u, (bounds >> 8u) & 15u);
                let high = corner + vec2((bounds >> 4u) & 15u, (bounds >> 12u) & 15u);
                if all(low <= block.zw) && all(block.xy <= high) && item_reaches(bins[at], bounds, block) {
                    return true;
                }
            }
        }
    }
    return false;
}

// Whether the face of an item, or an open face of a cell at the eye, reaches into a block.
fn item_reaches(item: u32, bounds: u32, block: vec4<u32>) -> bool {
    if (bounds & EYE_CELL) == 0u {
        return reaches_into(face_vertices(item >> 2u, item & 3u), block);
    }
    for (var face = 0u; face < 4u; face++) {
        let neighbour = cell_neighbour(item, face);
        let is_open = neighbour == NONE || !is_active(neighbour >> 2u);
        if is_open && reaches_into(face_vertices(item, face), block) {
            return true;
        }
    }
    return false;
}

// The reason why a block is split by its own corners; 0 if there is none.
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
    // Blocks of the first step are always split.
    if step < 2u || any(block >= block_counts(stride_of(step))) {
        return;
    }
    var state = 0u;
    if step == 2u || atomicLoad(&rays[state_at(step - 1u, block / 2u)]) > OPEN {
        state = OPEN | reason(corners_of(step, block));
    }
    atomicStore(&rays[state_at(step, block)], state);
}
