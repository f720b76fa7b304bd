// Tables of intervals, on which colour and extinction are linear, for optics_exact.wgsl and optics_partial.wgsl.

// The table has three vectors an interval: (lo, hi, width, 1 / width or 0), colour and extinction at its foot, their rise to the other
// end. The foot is the end with less extinction; 1 / width is negative where that is hi.
// The first and the last interval are constant and reach beyond all scalars.
const INTERVAL_WORDS: u32 = 3u;

struct Interval {
    number: u32,
    range: vec4<f32>,
    at_foot: vec4<f32>,
    rise: vec4<f32>,
}

// The interval that the ray is in.
var<private> interval: Interval;

fn interval_load(number: u32) {
    interval.number = number;
    interval.range = table[INTERVAL_WORDS * number];
    interval.at_foot = table[INTERVAL_WORDS * number + 1u];
    interval.rise = table[INTERVAL_WORDS * number + 2u];
}

// Loads the first interval whose end lies beyond a scalar, or at it if `ends`.
fn interval_find(scalar: f32, ends: bool) {
    var low = 0u;
    var high = params.interval_count - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        let hi = table[INTERVAL_WORDS * middle].y;
        if select(hi <= scalar, hi < scalar, ends) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    interval_load(low);
}

fn interval_is_transparent() -> bool {
    return interval.at_foot.w == 0.0 && interval.rise.w == 0.0;
}

// Colour and extinction at a scalar in the interval. The ends of a narrow interval are rounded, its width is not: at its end
// the computed share would be arbitrary.
fn interval_at(scalar: f32) -> vec4<f32> {
    let ends = select(interval.range.xy, interval.range.yx, interval.range.w < 0.0);
    let share = min((scalar - ends.x) * interval.range.w, 1.0);
    return interval.at_foot + interval.rise * select(share, 1.0, scalar == ends.y);
}

// Colour and extinction at the upper or at the lower end of the interval.
fn interval_at_end(upper: bool) -> vec4<f32> {
    return interval.at_foot + select(vec4(0.0), interval.rise, upper == (interval.range.w >= 0.0));
}
