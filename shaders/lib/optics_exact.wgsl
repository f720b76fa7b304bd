// The exact integrator: segments are split at the nodes of the transfer function. CPU twin: optics/exact.rs and
// optics/weights.rs, where the formulas and their error bounds are derived.

// The table: three vectors an interval: (lo, hi, width, 1 / width or 0), colour and extinction at lo, their rise to hi.
// The first and the last interval are constant and reach beyond all scalars.
const INTERVAL_WORDS: u32 = 3u;

struct Optics {
    interval: u32,
    range: vec4<f32>,
    at_lo: vec4<f32>,
    rise: vec4<f32>,
    // Colour and extinction where the ray is.
    here: vec4<f32>,
    // What has been gathered: premultiplied colour, opacity; and what still shines through.
    light: vec4<f32>,
    transmittance: f32,
    pieces: u32,
    // Whether a piece had extinction, and before which share of its segment the first of them began.
    visible: bool,
    visible_share: f32,
}

// The ray's place in the table, and its light.
var<private> optics: Optics;

// Before the ray has met anything.
fn optics_clear() {
    optics = Optics(0u, vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), 1.0, 0u, false, 0.0);
}

fn optics_load(interval: u32) {
    optics.interval = interval;
    optics.range = table[INTERVAL_WORDS * interval];
    optics.at_lo = table[INTERVAL_WORDS * interval + 1u];
    optics.rise = table[INTERVAL_WORDS * interval + 2u];
}

fn optics_at(scalar: f32) -> vec4<f32> {
    return optics.at_lo + optics.rise * ((scalar - optics.range.x) * optics.range.w);
}

// The ray is at a place with this scalar, after a gap.
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

// Weights of the colours at both ends of a piece; together its opacity.
fn piece_weights(a0: f32, a1: f32) -> vec2<f32> {
    let depth = 0.5 * (a0 + a1);
    if depth <= 0.25 {
        return weights_series(a0, a1, depth);
    }
    return weights_quadrature(a0, a1, depth);
}

fn weights_series(a0: f32, a1: f32, x: f32) -> vec2<f32> {
    let c5 = vec4(-1.0 / 720.0, -1.0 / 5040.0, -1.0 / 6720.0, -1.0 / 43200.0);
    let c4 = vec4(1.0 / 120.0, 1.0 / 720.0, 1.0 / 1008.0, 1.0 / 6048.0);
    let c3 = vec4(-1.0 / 24.0, -1.0 / 120.0, -1.0 / 180.0, -1.0 / 1008.0);
    let c2 = vec4(1.0 / 6.0, 1.0 / 24.0, 1.0 / 40.0, 1.0 / 210.0);
    let c1 = vec4(-1.0 / 2.0, -1.0 / 6.0, -1.0 / 12.0, -1.0 / 60.0);
    let c0 = vec4(1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 30.0);
    let sums = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))));
    let p3 = 1.0 / 840.0 - x * (1.0 / 1680.0 - x * (1.0 / 6048.0));
    let h = 0.5 * (a1 - a0);
    let bend = h * (sums.z + h * (0.5 * sums.w + h * (p3 + h * (1.0 / (24.0 * 630.0)))));
    let alpha = x * sums.x;
    let near = x * sums.y - bend;
    return vec2(near, alpha - near);
}

const QUADRATURE_DEPTH: f32 = 1.5;
const DEPTH_MAX: f32 = 18.0;

// Where the optical depth u (a0 + b u) reaches x, in the form that does not cancel.
fn place_of_depth(a0: f32, b: f32, x: f32) -> f32 {
    return 2.0 * x / (a0 + sqrt(max(a0 * a0 + 4.0 * b * x, 0.0)));
}

fn weights_quadrature(a0: f32, a1: f32, depth: f32) -> vec2<f32> {
    let b = 0.5 * (a1 - a0);
    let reached = min(depth, DEPTH_MAX);
    let pieces = max(ceil(reached / QUADRATURE_DEPTH), 1.0);
    var end = 1.0;
    if depth > DEPTH_MAX {
        end = min(place_of_depth(a0, b, DEPTH_MAX), 1.0);
    }
    var mean_transmittance = 0.0;
    var begin = 0.0;
    for (var i = 1.0; i <= pieces; i += 1.0) {
        var next = end;
        if i < pieces {
            next = clamp(place_of_depth(a0, b, reached * i / pieces), begin, end);
        }
        let width = next - begin;
        // Five-point Gauss-Legendre.
        let u = begin + width * vec4(0.046910077, 0.23076534, 0.76923466, 0.9530899);
        let middle = begin + 0.5 * width;
        let theta = u * (a0 + b * u);
        let outer = exp_neg(max(theta.x, 0.0)) + exp_neg(max(theta.w, 0.0));
        let inner = exp_neg(max(theta.y, 0.0)) + exp_neg(max(theta.z, 0.0));
        let at_middle = exp_neg(max(middle * (a0 + b * middle), 0.0));
        mean_transmittance += width * (0.11846344 * outer + 0.23931434 * inner + 0.28444445 * at_middle);
        begin = next;
    }
    let alpha = 1.0 - exp_neg(depth);
    let near = clamp(1.0 - mean_transmittance, 0.0, alpha);
    return vec2(near, alpha - near);
}

// Composites a piece in the present interval, over which colour and extinction go linearly to `far`.
fn optics_piece(far: vec4<f32>, length: f32, share: f32) {
    let near = optics.here;
    optics.here = far;
    if optics.at_lo.w == 0.0 && optics.rise.w == 0.0 {
        return;
    }
    if !optics.visible {
        optics.visible = true;
        optics.visible_share = share;
    }
    // Beyond 1e9 nothing shines through; larger products would overflow. Rounding may leave a tiny negative extinction
    // where a ramp reaches zero.
    let weights = piece_weights(clamp(near.w * length, 0.0, 1e9), clamp(far.w * length, 0.0, 1e9));
    let transmittance = optics.transmittance;
    let of_near = transmittance * weights.x;
    let of_far = transmittance * weights.y;
    optics.light += vec4(near.xyz, 1.0) * of_near + vec4(far.xyz, 1.0) * of_far;
    // Not the product with what the piece lets through: of many equal pieces that is rounded alike each time.
    optics.transmittance = transmittance - (of_near + of_far);
    optics.pieces += 1u;
}

// A part of a segment's scalars as a share of it. Not its length over its scalars times the part: where these are all but equal that
// overflows.
fn share_of(part: f32, span: f32) -> f32 {
    return select(1.0, min(part / span, 1.0), span > 0.0);
}

// Composites a segment along which the scalar goes linearly from s0 to s1: piece by piece, from node to node. One loop for
// all, though most segments meet no node: a path of their own made the walk 1.6 times slower (lavapipe, 1M cells), since the
// lanes of a vector that do meet one hold up the others, and all the longer the more code there is.
fn optics_segment(s0: f32, s1: f32, length: f32) {
    let up = s1 >= s0;
    var s = s0;
    var rest = length;
    loop {
        let end = select(optics.range.x, optics.range.y, up);
        let next = select(optics.interval - 1u, optics.interval + 1u, up);
        // At a node the side that the ray goes to holds; a constant segment takes the upper one.
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
        optics_piece(far, piece, 1.0 - rest / length);
        if !goes_on {
            break;
        }
        s = end;
        rest = share_of(abs(s1 - s), span) * length;
        optics_load(next);
        optics.here = optics.at_lo + select(optics.rise, vec4(0.0), up);
    }
}
