// The exact integrator: segments are split at the nodes of the transfer function. CPU twin: optics/exact.rs.

// Colour and extinction at the ray's place.
var<private> optics_here: vec4<f32>;

// Enters the table at this scalar, after a gap.
fn optics_enter(scalar: f32) {
    interval_find(scalar, false);
    optics_here = interval_at(scalar);
}

// Composites a piece in the present interval, over which colour and extinction vary linearly to `far`. Returns whether the piece is not
// opaque.
fn optics_piece(far: vec4<f32>, length: f32, share: f32) -> bool {
    let near = optics_here;
    optics_here = far;
    if interval_is_transparent() {
        return true;
    }
    // Optical depths beyond 1e9 are opaque; larger products would overflow. Rounding may leave a tiny negative extinction
    // where a ramp reaches zero.
    let near_depth = clamp(near.w * length, 0.0, 1e9);
    let far_depth = clamp(far.w * length, 0.0, 1e9);
    let weights = piece_weights(near_depth, far_depth);
    optics_add_piece(near.xyz, far.xyz, weights, share);
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
        let end = select(interval.range.x, interval.range.y, up);
        let next = select(interval.number - 1u, interval.number + 1u, up);
        // At a node the interval in the ray's direction holds; a constant segment takes the upper one.
        if select(s0 <= end, s0 >= end, up) {
            interval_load(next);
            optics_here = interval_at(s0);
            continue;
        }
        let goes_on = select((s1 < end), (s1 > end), up);
        let span = abs(s1 - s0);
        var far = interval_at(s1);
        var piece = rest;
        if goes_on {
            // The width is exact even where the ends of a narrow interval are not.
            let begin = select(interval.range.y, interval.range.x, up);
            let crossed = select(abs(end - s), interval.range.z, s == begin);
            far = interval_at_end(up);
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
        interval_load(next);
        optics_here = interval_at_end(!up);
    }
}
