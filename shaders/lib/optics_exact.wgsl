// The exact integrator: segments are split at the nodes of the transfer function. CPU twin: optics/exact.rs.

// The table: three vectors an interval: (lo, hi, width, 1 / width or 0), colour and extinction at lo, their rise to hi.
// The first and the last interval are constant and reach beyond all scalars.
const INTERVAL_WORDS: u32 = 3u;

struct Optics {
    interval: u32,
    range: vec4<f32>,
    at_lo: vec4<f32>,
    rise: vec4<f32>,
    // Colour and extinction at the ray's place.
    here: vec4<f32>,
    // Accumulated premultiplied colour and opacity; remaining transmittance.
    light: vec4<f32>,
    transmittance: f32,
    // Rounding error of the transmittance, carried.
    carried: f32,
    pieces: u32,
    // Whether a piece had extinction, and before which share of its segment the first of them began.
    visible: bool,
    visible_share: f32,
}

// The ray's place in the table, and its light.
var<private> optics: Optics;

// Resets the optics before a ray's first segment.
fn optics_transparent() {
    optics = Optics(0u, vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), 1.0, 0.0, 0u, false, 0.0);
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

// Enters the table at this scalar, after a gap.
fn optics_enter(scalar: f32) {
    var low = 0u;
    var high = params.interval_count - 1u;
    // The first interval whose end lies beyond the scalar.
    while low < high {
        let middle = (low + high) / 2u;
        if table[INTERVAL_WORDS * middle].y <= scalar {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    optics_load(low);
    optics.here = optics_at(scalar);
}

// Composites a piece in the present interval, over which colour and extinction vary linearly to `far`. Returns whether the piece is not
// opaque.
fn optics_piece(far: vec4<f32>, length: f32, share: f32) -> bool {
    let near = optics.here;
    optics.here = far;
    if optics.at_lo.w == 0.0 && optics.rise.w == 0.0 {
        return true;
    }
    if !optics.visible {
        optics.visible = true;
        optics.visible_share = share;
    }
    // Optical depths beyond 1e9 are opaque; larger products would overflow. Rounding may leave a tiny negative extinction
    // where a ramp reaches zero.
    let near_depth = clamp(near.w * length, 0.0, 1e9);
    let far_depth = clamp(far.w * length, 0.0, 1e9);
    let weights = piece_weights(near_depth, far_depth);
    let transmittance = optics.transmittance;
    let of_near = transmittance * weights.x;
    let of_far = transmittance * weights.y;
    optics.light += vec4(near.xyz, 1.0) * of_near + vec4(far.xyz, 1.0) * of_far;
    // Not the product with the piece's transmittance: over many equal pieces that is rounded the same way each time.
    optics_dim(transmittance * (weights.x + weights.y));
    optics.pieces += 1u;
    return near_depth + far_depth <= 2.0 * DEPTH_MAX;
}

// The share of a segment that a part of its scalar range covers. The length per scalar is not computed: it overflows where the scalars
// are nearly equal.
fn share_of(part: f32, span: f32) -> f32 {
    return select(1.0, min(part / span, 1.0), span > 0.0);
}

// Composites a segment along which the scalar goes linearly from s0 to s1: piece by piece, from node to node. One loop for
// all, though most segments meet no node: a branch of their own made the walk 1.6 times slower (lavapipe, 1M cells), since the
// lanes of a vector that do meet one hold up the others, the longer the more code there is.
fn optics_segment(s0: f32, s1: f32, length: f32) {
    let up = s1 >= s0;
    var s = s0;
    var rest = length;
    loop {
        let end = select(optics.range.x, optics.range.y, up);
        let next = select(optics.interval - 1u, optics.interval + 1u, up);
        // At a node the interval in the ray's direction holds; a constant segment takes the upper one.
        if select(s0 <= end, s0 >= end, up) {
            optics_load(next);
            optics.here = optics_at(s0);
            continue;
        }
        let goes_on = select((s1 < end), (s1 > end), up);
        let span = abs(s1 - s0);
        var far = optics_at(s1);
        var piece = rest;
        if goes_on {
            // The width is exact even where the ends of a narrow interval are not.
            let begin = select(optics.range.y, optics.range.x, up);
            let crossed = select(abs(end - s), optics.range.z, s == begin);
            far = optics.at_lo + select(vec4(0.0), optics.rise, up);
            piece = share_of(crossed, span) * length;
        }
        let shines_through = optics_piece(far, piece, 1.0 - rest / length);
        if !goes_on {
            break;
        }
        if !shines_through {
            optics_enter(s1);
            break;
        }
        s = end;
        rest = share_of(abs(s1 - s), span) * length;
        optics_load(next);
        optics.here = optics.at_lo + select(optics.rise, vec4(0.0), up);
    }
}
