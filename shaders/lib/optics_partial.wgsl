// Partial pre-integration: the part of a segment between nodes comes from precomputed sums. CPU twin: optics/partial.rs, where
// the method is described. Replaces optics_exact.wgsl, with the same functions.

// Behind the intervals of the table (optics_intervals.wgsl) are two vectors a sum: (mean colour, integral of the extinction over the
// scalar), (tilt, 0).
const SUM_WORDS: u32 = 2u;
// The largest optical depth of a sum that is composited as two colours.
const SUM_DEPTH: f32 = 0.25;

// A sum: mean colour and integral of the extinction; tilt; the place at which it ends.
struct Sum {
    mean: vec4<f32>,
    tilt: vec3<f32>,
    end: u32,
}

// Goes to the interval that holds a scalar; at a node to the one that ends there if `ends`, else to the one that begins.
fn optics_find(scalar: f32, ends: bool) {
    let range = interval.range;
    if !select(range.x <= scalar && scalar < range.y, range.x < scalar && scalar <= range.y, ends) {
        interval_find(scalar, ends);
    }
}

// Enters the table at this scalar, after a gap.
fn optics_enter(scalar: f32) {
    interval_find(scalar, false);
}

// Optical depth: extinction times length. Beyond 1e9 it is opaque; larger products would overflow. Rounding may leave a tiny negative
// extinction where a ramp reaches zero.
fn optics_depth(tau: f32, length: f32) -> f32 {
    return clamp(tau * length, 0.0, 1e9);
}

// Composites a part of a segment without a node: colour and extinction go from near to far in the present interval.
fn optics_within(near: vec4<f32>, far: vec4<f32>, length: f32) {
    if interval_is_transparent() {
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
            && optics.transmittance >= OPAQUE {
            sum = optics_behind(at, (at + sum.end) / 2u);
        }
        if max(sum.end, at) - min(sum.end, at) == 1u {
            // Interval i ends at place i.
            interval_load(max(sum.end, at));
            optics_within(interval_at_end(!up), interval_at_end(up), length_of(interval.range.z, span, length));
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
    while at != interval.number && table[INTERVAL_WORDS * at + 1u].w == 0.0 && table[INTERVAL_WORDS * at + 2u].w == 0.0 {
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
    let first = interval.number;
    let range = interval.range;
    if select(s1 >= range.x, s0 == s1 || s1 <= range.y, up) {
        optics_within(interval_at(s0), interval_at(s1), length);
    } else {
        let span = abs(s1 - s0);
        let leaves = select(range.x, range.y, up);
        // The width is exact even where the ends of a narrow interval are not.
        let crossed = select(abs(leaves - s0), range.z, s0 == select(range.y, range.x, up));
        optics_within(interval_at(s0), interval_at_end(up), length_of(crossed, span, length));
        optics_find(s1, up);
        let last = interval.number;
        // Interval i ends at place i.
        optics_between(select(first - 1u, first, up), select(last, last - 1u, up), span, length);
        interval_load(last);
        let enters = select(interval.range.y, interval.range.x, up);
        optics_within(interval_at_end(!up), interval_at(s1), length_of(abs(s1 - enters), span, length));
    }
    if optics.pieces > pieces && !optics.visible {
        optics_see(first, s0, s1);
    }
}
