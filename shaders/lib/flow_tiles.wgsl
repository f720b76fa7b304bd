// The tiles that a splat of flow reaches: calls `visit_tile` for each.

// Column and row of the splat's centre, counted from the middle of the first pixel.
fn pixel_of_center(record: FlowRecord) -> vec2<f32> {
    let perspective = (params.flags & PERSPECTIVE) != 0u;
    let w = select(1.0, record.center.depth.x + record.center.depth.y, perspective);
    let at = vec2(record.center.plane.x, -record.center.plane.z) / w / params.pitch.xz;
    return 0.5 * (at + (vec2<f32>(params.image_px) - vec2(1.0)));
}

// How much wider splats are taken, in pixels: a sixteenth, and more than centres far outside, and large splats, are rounded by.
fn pad_around(center: vec2<f32>, halves: vec2<f32>) -> vec2<f32> {
    return vec2(0.0625) + (abs(center) + halves) / 524288.0;
}

// Half of a row of the splat.
fn half_of_row(record: FlowRecord, below: f32) -> f32 {
    let at = record.down * below;
    return sqrt(max(END * END - at * at, 0.0)) / record.root;
}

// The first tile of a row of them that the splat reaches, and the tile behind the last.
fn tiles_of_row(record: FlowRecord, center: vec2<f32>, pad: vec2<f32>, row: u32) -> vec2<u32> {
    let last = min((row + 1u) * TILE_PX, params.size_px.y) - 1u;
    let rows = vec2(f32(pixel_at(vec2(0u, row * TILE_PX)).y), f32(pixel_at(vec2(0u, last)).y));
    let half = record.halves.y;
    let below = clamp((rows - center.y + vec2(-pad.y, pad.y)) * record.pixel, vec2(-half), vec2(half));
    // What is convex has its ends at the splat's, or nearest to them.
    let at = clamp(vec2(-record.lean, record.lean), vec2(below.x), vec2(below.y));
    let left = record.slope * at.x - half_of_row(record, at.x);
    let right = record.slope * at.y + half_of_row(record, at.y);
    let columns = center.x + vec2(left, right) / record.pixel + vec2(-pad.x, pad.x);
    let places = places_between(columns, rows);
    if places.x > places.y {
        return vec2(0u);
    }
    return vec2(u32(places.x) / TILE_PX, u32(places.y) / TILE_PX + 1u);
}

fn visit_tiles(number: u32) {
    let record = record_of(number);
    if record.halves.x < 0.0 {
        return;
    }
    let center = pixel_of_center(record);
    let halves = record.halves / record.pixel;
    let pad = pad_around(center, halves);
    let reach = halves + pad;
    let box = places_between(center.x + vec2(-reach.x, reach.x), center.y + vec2(-reach.y, reach.y));
    if box.x > box.y || box.z > box.w {
        return;
    }
    for (var row = u32(box.z) / TILE_PX; row <= u32(box.w) / TILE_PX; row++) {
        let tiles = tiles_of_row(record, center, pad, row);
        for (var column = tiles.x; column < tiles.y; column++) {
            visit_tile(row * params.tiles.x + column, number);
        }
    }
}
