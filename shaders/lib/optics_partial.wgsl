// Partial pre-integration: the part of a segment between nodes comes from precomputed sums. CPU twin: optics/partial.rs, where
// the method is described. Replaces optics_exact.wgsl, with the same functions and `optics`.

// The table: three vectors an interval, as in optics_exact.wgsl: (lo, hi, width, 1 / width or 0), colour and extinction at lo,
// their rise to hi. Behind them two vectors a sum: (mean colour, integral of the extinction over the scalar), (tilt, 0).
const INTERVAL_WORDS: u32 = 3u;
const SUM_WORDS: u32 = 2u;
// The largest optical depth of a sum that is composited as two colours.
const SUM_DEPTH: f32 = 0.25;
// Transmittance below which a ray counts as opaque (optics::OPAQUE_TRANSMITTANCE).
const PARTIAL_OPAQUE: f32 = 1.0 / 131072.0;

struct Optics {
    interval: u32,
    range: vec4<f32>,
    at_lo: vec4<f32>,
    rise: vec4<f32>,
    // Accumulated premultiplied colour and opacity; remaining transmittance.
    light: vec4<f32>,
    transmittance: f32,
    // Rounding error of the transmittance, carried.
    carried: f32,
    pieces: u32,
    // Whether a segment had extinction, and before which share of the first such segment it began.
    visible: bool,
    visible_share: f32,
}

// The ray's place in the table (interval to rise), and its light.
var<private> optics: Optics;

// A sum: mean colour and integral of the extinction; tilt; the place at which it ends.
struct Sum {
    mean: vec4<f32>,
    tilt: vec3<f32>,
    end: u32,
}

// Resets the optics before a ray's first segment.
fn optics_transparent() {
    optics = Optics(0u, vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), 1.0, 0.0, 0u, false, 0.0);
}

fn optics_load(interval: u32) {
    optics.interval = interval;
    optics.range = table[INTERVAL_WORDS * interval];
    optics.at_lo = table[INTERVAL_WORDS * interval + 1u];
    optics.rise = table[INTERVAL_WORDS * interval + 2u];
}

// Colour and extinction at a scalar in the present interval. The ends of a narrow interval are rounded, its width is not: at its end
// the computed share would be arbitrary.
fn optics_at(scalar: f32) -> vec4<f32> {
    let share = min((scalar - optics.range.x) * optics.range.w, 1.0);
    return optics.at_lo + optics.rise * select(share, 1.0, scalar == optics.range.y);
}

// Colour and extinction at the upper or at the lower end of the interval.
fn optics_at_end(upper: bool) -> vec4<f32> {
    return optics.at_lo + select(vec4(0.0), optics.rise, upper);
}

// Goes to the interval that holds a scalar; at a node to the one that ends there if `ends`, else to the one that begins.
fn optics_find(scalar: f32, ends: bool) {
    let range = optics.range;
    if select(range.x <= scalar && scalar < range.y, range.x < scalar && scalar <= range.y, ends) {
        return;
    }
    var low = 0u;
    var high = params.interval_count - 1u;
    // The first interval whose end lies beyond the scalar, or at it.
    while low < high {
        let middle = (low + high) / 2u;
        let hi = table[INTERVAL_WORDS * middle].y;
        if select(hi <= scalar, hi < scalar, ends) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    optics_load(low);
}

// Enters the table at this scalar, after a gap.
fn optics_enter(scalar: f32) {
    optics_load(0u);
    optics_find(scalar, false);
}

// Optical depth: extinction times length. Beyond 1e9 it is opaque; larger products would overflow. Rounding may leave a tiny negative
// extinction where a ramp reaches zero.
fn optics_depth(tau: f32, length: f32) -> f32 {
    return clamp(tau * length, 0.0, 1e9);
}

// Composites premultiplied colour and opacity behind the accumulated light.
fn optics_add(rgb: vec3<f32>, alpha: f32) {
    optics.light += vec4(rgb, alpha) * optics.transmittance;
    optics_dim(optics.transmittance * alpha);
    optics.pieces += 1u;
}

// Composites a part of a segment without a node: colour and extinction go from near to far in the present interval.
fn optics_within(near: vec4<f32>, far: vec4<f32>, length: f32) {
    if optics.at_lo.w == 0.0 && optics.rise.w == 0.0 {
        return;
    }
    let weights = piece_weights(optics_depth(near.w, length), optics_depth(far.w, length));
    optics_add(near.xyz * weights.x + far.xyz * weights.y, weights.x + weights.y);
}

// Composites a sum.
fn optics_sum(sum: Sum, depth: f32) {
    let weights = homogeneous_weights(depth);
    let alpha = weights.x + weights.y;
    // The linear function may leave the range of colours.
    let rgb = clamp(sum.mean.xyz * alpha + sum.tilt * (weights.y - weights.x), vec3(0.0), vec3(alpha));
    optics_add(rgb, alpha);
}

// The sum from place `here` towards `there`, and where it ends: at the middle of the largest block in whose halves both are, or at
// `there` if `here` is the middle of a block that holds it.
fn optics_behind(here: u32, there: u32) -> Sum {
    let places = params.interval_count - 1u;
    let up = here < there;
    let differ = firstLeadingBit(here ^ there);
    let own = select(firstTrailingBit(here), 0u, here == 0u);
    let is_half = select(own < differ, own <= differ, up);
    let level = select(own, differ, is_half);
    let end = select(there, (max(here, there) >> differ) << differ, is_half);
    let kept = select(there, here, is_half);
    let word = INTERVAL_WORDS * params.interval_count + SUM_WORDS * (level * places + kept);
    let tilt = table[word + 1u].xyz;
    return Sum(table[word], select(-tilt, tilt, up), end);
}

// Composites the part between two nodes, given as places; changes the present interval.
fn optics_between(here: u32, there: u32, span: f32, length: f32) {
    let up = here < there;
    var at = here;
    while at != there {
        var sum = optics_behind(at, there);
        while max(sum.end, at) - min(sum.end, at) > 1u
            && optics_depth(sum.mean.w / span, length) > SUM_DEPTH
            && optics.transmittance >= PARTIAL_OPAQUE {
            sum = optics_behind(at, (at + sum.end) / 2u);
        }
        if max(sum.end, at) - min(sum.end, at) == 1u {
            // Interval i ends at place i.
            optics_load(max(sum.end, at));
            optics_within(optics_at_end(!up), optics_at_end(up), length_of(optics.range.z, span, length));
        } else {
            let depth = optics_depth(sum.mean.w / span, length);
            if depth > 0.0 {
                optics_sum(sum, depth);
            }
        }
        at = sum.end;
    }
}

// The length of the part of a segment that covers `part` of its scalar range. The length per scalar is not computed: it overflows where
// the scalars are nearly equal.
fn length_of(part: f32, span: f32, length: f32) -> f32 {
    return min(part / span, 1.0) * length;
}

// Sets where the first visible part of a segment begins, for a visible segment that begins in interval `first`.
fn optics_see(first: u32, s0: f32, s1: f32) {
    optics.visible = true;
    // Steps to the first interval with extinction; once per ray.
    var at = first;
    var end = s0;
    while at != optics.interval && table[INTERVAL_WORDS * at + 1u].w == 0.0 && table[INTERVAL_WORDS * at + 2u].w == 0.0 {
        let range = table[INTERVAL_WORDS * at];
        end = select(range.x, range.y, s1 > s0);
        at = select(at - 1u, at + 1u, s1 > s0);
    }
    optics.visible_share = select(clamp((end - s0) / (s1 - s0), 0.0, 1.0), 0.0, at == first);
}

// Composites a segment along which the scalar goes linearly from s0 to s1.
fn optics_segment(s0: f32, s1: f32, length: f32) {
    let up = s1 >= s0;
    let pieces = optics.pieces;
    // At a node the interval in the ray's direction holds; a constant segment takes the upper one.
    optics_find(s0, !up);
    let first = optics.interval;
    let range = optics.range;
    if select(s1 >= range.x, s0 == s1 || s1 <= range.y, up) {
        optics_within(optics_at(s0), optics_at(s1), length);
    } else {
        let span = abs(s1 - s0);
        let leaves = select(range.x, range.y, up);
        // The width is exact even where the ends of a narrow interval are not.
        let crossed = select(abs(leaves - s0), range.z, s0 == select(range.y, range.x, up));
        optics_within(optics_at(s0), optics_at_end(up), length_of(crossed, span, length));
        optics_find(s1, up);
        let last = optics.interval;
        // Interval i ends at place i.
        optics_between(select(first - 1u, first, up), select(last, last - 1u, up), span, length);
        optics_load(last);
        let enters = select(optics.range.y, optics.range.x, up);
        optics_within(optics_at_end(!up), optics_at(s1), length_of(abs(s1 - enters), span, length));
    }
    if optics.pieces > pieces && !optics.visible {
        optics_see(first, s0, s1);
    }
}
