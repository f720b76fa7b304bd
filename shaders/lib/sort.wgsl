// Sorts a pixel's fragments where they lie; what they are sorted by is in face_order.wgsl or point_order.wgsl.

struct Rays {
    hit: bool,
    stopped_early: bool,
    broken: bool,
    out_of_order: u32,
}
var<private> ray_counts: Rays;

// Marks the ray as broken if a loop did not run to its end: software drivers abort loops after a number of rounds (Mesa's after
// 65,535 of all loops of a pixel together).
fn expect_end(is_end: bool) {
    ray_counts.broken |= !is_end;
}

// Moves for each fragment, on average, after which insertion is given up.
const PATIENCE: u32 = 4u;

// Sorts a pixel's fragments. They are stored nearly in the order of the list, so that insertion finds most of them in place and
// reads only their depths. After too many moves Shell sort takes over.
fn sort(first: u32, count: u32) {
    var moves = 0u;
    var i = 1u;
    for (; i < count; i++) {
        // All fragments before it are sorted: the last of them is the greatest.
        let key = key_at(first + i);
        if comes_before(key, first + i - 1u) {
            let moving = load_stored(first + i);
            var at = i;
            while at > 0u && comes_before(key, first + at - 1u) {
                store(first + at, load_stored(first + at - 1u));
                at -= 1u;
            }
            store(first + at, moving);
            moves += i - at;
            if moves > PATIENCE * (count + 16u) {
                shell_sort(first, count);
                return;
            }
        }
    }
    expect_end(i >= count);
}

fn shell_sort(first: u32, count: u32) {
    var gap = 1u;
    while gap < count / 3u {
        gap = 3u * gap + 1u;
    }
    while gap > 0u {
        for (var i = gap; i < count; i++) {
            let moving = load_stored(first + i);
            let key = key_of(moving);
            var at = i;
            while at >= gap && comes_before(key, first + at - gap) {
                store(first + at, load_stored(first + at - gap));
                at -= gap;
            }
            if at != i {
                store(first + at, moving);
            }
        }
        gap /= 3u;
    }
    expect_end(gap == 0u);
}
