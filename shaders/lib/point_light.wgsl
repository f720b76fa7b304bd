// Light of a ray from its sorted fragments of points. CPU twins: render/cpu/points/tile.rs, render/cpu/light.rs.
//
// - Cells: from entry to exit, each behind what is composited and visible.
// - Slabs: all of each, around its middle.
// - Gaps: from one point to the next.

// Depth from which those of the present segment are counted, so that they keep their digits.
var<private> origin: vec2<f32>;
// What is visible ends `front_by` behind this depth.
var<private> front_depth: vec2<f32>;
var<private> front_by: real;
// The value at vertices where the last segment ended.
var<private> last_value: f32;
// Whether a segment was visible.
var<private> composited: bool;

// Counts depths from `depth` on.
fn count_from(depth: vec2<f32>) {
    origin = depth;
    light.front = front_by - real(depth_after(front_depth, depth));
    light.behind = real(depth.x) + real(depth.y);
}

// Composites the segment between two places in a cell, with the values there.
fn pass_segment(cell: u32, from_: real2, to: real2, values_: vec2<f32>) {
    let is_slab = point_is(SLABS);
    if is_slab || from_.y != light.last.y || values_.x != last_value {
        light.placed = false;
        medium_begin(values_.x);
    }
    light.last = from_;
    medium_pass(cell, values_.y);
    let pieces = optics.pieces;
    let is_behind = composite(cell, to);
    ray_counts.out_of_order += u32(!is_behind && composited);
    // Cells are cut where what is visible ends, so that those that show nothing change nothing. Slabs add up.
    if optics.pieces > pieces && !is_slab {
        front_depth = origin;
        front_by = to.x;
        composited = true;
    }
    light.last = to;
    last_value = values_.y;
}

// Composites the fragments in the order in which they are stored.
fn gather(first: u32, count: u32) {
    ray_counts.hit = count > 0u;
    front_depth = vec2(0.0);
    front_by = real(params.near);
    composited = false;
    last_value = 0.0;
    let is_gap = point_is(GAPS);
    let is_slab = point_is(SLABS);
    var i = 0u;
    for (; i < count && !ray_counts.stopped_early; i++) {
        let fragment = load_stored(first + i);
        let thickness = real(bitcast<f32>(fragment.more.y));
        var from_ = real2(real(0.0), real(fragment.scalar));
        var to = real2(thickness, real(bitcast<f32>(fragment.more.x)));
        if is_gap && i > 0u {
            from_.y = light.last.y;
            to.x = real(depth_after(origin, fragment.depth));
        } else {
            count_from(fragment.depth);
        }
        if is_slab {
            from_.x = real(-0.5) * thickness;
            to.x = real(0.5) * thickness;
        }
        if to.x > from_.x {
            pass_segment(drawn[fragment.rank], from_, to, fragment.values);
        }
        if is_gap {
            // The next gap begins here, or where this one did, if that is behind.
            light.last.y = to.y;
            if to.x > real(0.0) {
                count_from(fragment.depth);
            } else {
                light.placed = false;
            }
        }
        ray_counts.stopped_early = is_opaque();
    }
    expect_end(i >= count || ray_counts.stopped_early);
}
