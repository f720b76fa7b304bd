// Light of a ray from its sorted fragments of faces. CPU twins: render/cpu/havs/fragment.rs, light.rs, resolve.rs; render/cpu/havs/mod.rs
// explains the orders.
//
// - In exact order, all faces: sorted by depth, then followed from entries through cell after cell to exits; only paths are
//   ordered by depth.
// - In exact order, some faces: sorted by depth, neighbours within rounding by their cells.
// - Else: sorted by rank, the order of the list, then by depth within a buffer of k fragments.

fn active_or_none(cell: u32) -> u32 {
    if cell == NONE || is_active(cell) {
        return cell;
    }
    return NONE;
}

fn scalar_at(slot: u32) -> f32 {
    return bitcast<f32>(pair(slot, 1u).x);
}

// The active cells left and entered; NONE where there is none.
fn cells_at(slot: u32) -> vec2<u32> {
    let cells = pair(slot, 2u);
    return vec2(active_or_none(cells.x), active_or_none(cells.y));
}

// Whether the fragment (depth, cells) belongs in front of fragment `other`, which is stored before it.
fn is_before(depth: vec2<f32>, cells: vec2<u32>, other: u32) -> bool {
    let there = depth_at(other);
    let by = (depth.x - there.x) + (depth.y - there.y);
    if abs(by) > list_params.tie {
        return by < 0.0;
    }
    let here = vec2(active_or_none(cells.x), active_or_none(cells.y));
    let left = cells_at(other);
    if here.y != NONE && here.y == left.x {
        return true;
    }
    if left.y != NONE && left.y == here.x {
        return false;
    }
    let exits = here.y == NONE && left.x == NONE;
    let enters = left.y == NONE && here.x == NONE;
    if exits != enters {
        return exits;
    }
    return by < 0.0;
}

// Sorts each fragment into the `window` before it.
fn sort_in_window(first: u32, count: u32, window: u32) {
    for (var i = 1u; i < count; i++) {
        let moving = load_stored(first + i);
        let depth = moving.depth;
        let stop = max(i, window) - window;
        var at = i;
        while at > stop && is_before(depth, moving.more, first + at - 1u) {
            store(first + at, load_stored(first + at - 1u));
            at -= 1u;
        }
        if at != i {
            store(first + at, moving);
        }
    }
}

// Depth from which the depths of the present path are counted, as a sum of two.
var<private> origin: vec2<f32>;

fn relative(depth: vec2<f32>) -> real {
    return (real(depth.x) - real(origin.x)) + (real(depth.y) - real(origin.y));
}

// Begins a path at a fragment: depths are counted from there.
fn begin_path(slot: u32) {
    let depth = depth_at(slot);
    light.front -= relative(depth);
    origin = depth;
    light.behind = real(depth.x) + real(depth.y);
    light.last = real2(real(0.0), real(scalar_at(slot)));
    light.placed = false;
    medium_begin(value_at(slot));
}

// Largest error of a depth, for faces seen edge-on: edge functions are right to 2^-11 of themselves, corners' depths differ by
// 2 at most.
const NEAR_EYE: f32 = 1.0 / 1024.0;

// Composites all paths, each from a fragment at which the ray enters the active cells. The fragment at which it leaves a cell comes
// next in nearly all lists; else it is searched for to the end of the list, then from its begin. One loop for all: software drivers
// count the rounds of all loops together, and compile nested loops slowly.
fn follow_all(first: u32, count: u32) {
    // Number of fragments that no path has used yet. It bounds the paths, so that they end even if cells form a cycle. Most rays have one
    // path, which leaves none.
    var left = count;
    // The next fragment at which a path may begin.
    var start = 0u;
    // The last fragment of the path, the cell behind it (NONE between paths), and the number of fragments examined since.
    var at = 0u;
    var cell = NONE;
    var looked_at = 0u;
    while left > 0u && (cell != NONE || start < count) {
        if cell == NONE {
            let cells = cells_at(first + start);
            if cells.x == NONE && cells.y != NONE {
                ray_counts.hit = true;
                begin_path(first + start);
                at = start;
                cell = cells.y;
                looked_at = 0u;
                left -= 1u;
            }
            start += 1u;
            continue;
        }
        looked_at += 1u;
        if looked_at >= count {
            // A face hit within rounding of the eye may lie behind it: the next cell begins another path.
            let from_eye = light.behind + light.last.x;
            ray_counts.broken |= (params.flags & PERSPECTIVE) == 0u || from_eye > real(NEAR_EYE);
            cell = NONE;
            continue;
        }
        let next = (at + looked_at) % count;
        let cells = cells_at(first + next);
        if cells.x != cell {
            continue;
        }
        let to = real2(relative(depth_at(first + next)), real(scalar_at(first + next)));
        if to.x > light.last.x {
            medium_pass(cell, value_at(first + next));
            _ = composite(cell, to);
            light.last = to;
        }
        if is_opaque() {
            ray_counts.stopped_early = true;
            return;
        }
        cell = cells.y;
        at = next;
        looked_at = 0u;
        left -= 1u;
    }
    expect_end(left == 0u || (cell == NONE && start >= count));
}

// Composites the fragments in the order in which they are stored.
fn advance_all(first: u32, count: u32) {
    var cell = NONE;
    ray_counts.hit = count > 0u;
    var i = 0u;
    for (; i < count; i++) {
        let slot = first + i;
        let cells = cells_at(slot);
        let to = real2(relative(depth_at(slot)), real(scalar_at(slot)));
        if i > 0u && to.x < light.last.x {
            if cells.x != cell || to.x < light.last.x - real(list_params.tie) {
                ray_counts.out_of_order += 1u;
            } else {
                // Placed by the cell between the two fragments: the segment is within rounding, so nothing is integrated.
                cell = cells.y;
            }
            continue;
        }
        if ray_counts.stopped_early {
            continue;
        }
        if cell == NONE {
            begin_path(slot);
        } else {
            medium_pass(cell, value_at(slot));
            _ = composite(cell, to);
            light.last = to;
        }
        cell = cells.y;
        ray_counts.stopped_early = is_opaque();
    }
    expect_end(i >= count);
}

fn gather(first: u32, count: u32) {
    origin = vec2(0.0);
    let exact_order = (list_params.flags & EXACT_ORDER) != 0u;
    if exact_order && (list_params.flags & COMPLETE) != 0u {
        follow_all(first, count);
    } else {
        sort_in_window(first, count, select(list_params.k, count, exact_order));
        advance_all(first, count);
    }
}
