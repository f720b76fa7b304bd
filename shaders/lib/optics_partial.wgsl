// Partial pre-integration: what lies between two scalars comes from sums over the nodes. CPU twin: optics/partial.rs, where the
// method is described. Takes the place of optics_exact.wgsl: same functions, same `optics`.

// The table: three vectors an interval, as in optics_exact.wgsl: (lo, hi, width, 1 / width or 0), colour and extinction at lo,
// their rise to hi. Behind them two vectors a sum: (mean colour, integral of the extinction over the scalar), (tilt, 0).
const INTERVAL_WORDS: u32 = 3u;
const SUM_WORDS: u32 = 2u;
// The largest optical depth of a sum that is seen as two colours.
const SUM_DEPTH: f32 = 0.25;
// Less than this shines through: what lies behind does not matter (optics::OPAQUE_TRANSMITTANCE).
const PARTIAL_OPAQUE: f32 = 1.0 / 131072.0;

struct Optics {
    interval: u32,
    range: vec4<f32>,
    at_lo: vec4<f32>,
    rise: vec4<f32>,
    // What has been gathered: premultiplied colour, opacity; and what still shines through.
    light: vec4<f32>,
    transmittance: f32,
    // What rounding has left out of that.
    carried: f32,
    pieces: u32,
    // Whether a segment had extinction, and before which share of the first such segment it began.
    visible: bool,
    visible_share: f32,
}

// The ray's place in the table (interval to rise), and its light.
var<private> optics: Optics;

// Mean colour and integral of the extinction; tilt; the place at which it ends.
struct Sum {
    mean: vec4<f32>,
    tilt: vec3<f32>,
    end: u32,
}

// Before the ray has met anything.
fn optics_transparent() {
    optics = Optics(0u, vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), 1.0, 0.0, 0u, false, 0.0);
}

fn optics_load(interval: u32) {
    optics.interval = interval;
    optics.range = table[INTERVAL_WORDS * interval];
    optics.at_lo = table[INTERVAL_WORDS * interval + 1u];
    optics.rise = table[INTERVAL_WORDS * interval + 2u];
}

// Colour and extinction of the present interval. The ends of a narrow one are rounded and its width is not: at its end the share
// would be anything.
fn optics_at(scalar: f32) -> vec4<f32> {
    let share = min((scalar - optics.range.x) * optics.range.w, 1.0);
    return optics.at_lo + optics.rise * select(share, 1.0, scalar == optics.range.y);
}

// The same at the upper end of the interval, or at its lower one.
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

// The ray is at a place with this scalar, after a gap.
fn optics_enter(scalar: f32) {
    optics_load(0u);
    optics_find(scalar, false);
}

// Extinction times length. Beyond 1e9 nothing shines through; larger products would overflow. Rounding may leave a tiny negative
// extinction where a ramp reaches zero.
fn optics_depth(tau: f32, length: f32) -> f32 {
    return clamp(tau * length, 0.0, 1e9);
}

// Composites light of an opacity behind what has been gathered.
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
    // The linear function may leave what colours can be.
    let rgb = clamp(sum.mean.xyz * alpha + sum.tilt * (weights.y - weights.x), vec3(0.0), vec3(alpha));
    optics_add(rgb, alpha);
}

// What lies behind a place on the way to another one, and up to which: the middle of the largest block in whose halves they are, or the
// other one if this is the middle of a block that holds it.
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

// Composites what lies between two places with nodes; leaves another interval behind.
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

// A part of a segment's scalars as a share of its length. Not its length over its scalars times the part: where these are all but
// equal that overflows.
fn length_of(part: f32, span: f32, length: f32) -> f32 {
    return min(part / span, 1.0) * length;
}

// Where the first visible part of a segment begins, if it begins in this interval and something is to be seen of it.
fn optics_see(first: u32, s0: f32, s1: f32) {
    optics.visible = true;
    // From interval to interval to the first that has extinction: once for a ray.
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
    // At a node the side that the ray goes to holds; a constant segment takes the upper one.
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
