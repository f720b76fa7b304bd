// The pre-integrated table: segments are looked up by the scalars at their ends and their length. CPU twin:
// optics/table3d.rs, where the table is described. Replaces optics_exact.wgsl, with the same functions.
// In `table` the length varies fastest, then s0, then s1; `table3d` are its parameters.

struct Table3dParams {
    // Entries for scalars below and above the range.
    below: vec4<f32>,
    above: vec4<f32>,
    // The ends of the range, each as a sum of two.
    scalar_lo: f32,
    scalar_lo_rest: f32,
    scalar_hi: f32,
    scalar_hi_rest: f32,
    intervals_per_scalar: f32,
    length_max: f32,
    scalars: u32,
    lengths: u32,
}

// Below this mean extinction the colour fades to black.
const MEAN_MIN: f32 = 1e-37;

// Does nothing: the table is looked up by both ends of a segment.
fn optics_enter(scalar: f32) {
}

// Distance of a scalar from the lower and from the upper end of the range, positive inside.
fn table3d_above_lo(scalar: f32) -> f32 {
    return (scalar - table3d.scalar_lo) - table3d.scalar_lo_rest;
}

fn table3d_below_hi(scalar: f32) -> f32 {
    return (table3d.scalar_hi - scalar) + table3d.scalar_hi_rest;
}

fn table3d_along_length(first: u32, k: u32, share: f32) -> vec4<f32> {
    let a = table[first + k];
    return a + (table[first + k + 1u] - a) * share;
}

fn table3d_along_s0(first: u32, k: u32, share: f32, share_s0: f32) -> vec4<f32> {
    let a = table3d_along_length(first, k, share);
    return a + (table3d_along_length(first + table3d.lengths, k, share) - a) * share_s0;
}

// The entry for a segment in the range, its ends as distances above the lower end, at most as long as the table goes.
fn table3d_look_up(above0: f32, above1: f32, length: f32) -> vec4<f32> {
    let at = max(vec2(above0, above1) * table3d.intervals_per_scalar, vec2(0.0));
    let interval = min(vec2<u32>(at), vec2(table3d.scalars - 2u));
    let share = min(at - vec2<f32>(interval), vec2(1.0));
    // Entry k has length length_max (k / (lengths - 1))^2; interpolation is linear in the length.
    let last = f32(table3d.lengths - 1u);
    let at_length = length / table3d.length_max * (last * last);
    let k = min(u32(sqrt(at_length)), table3d.lengths - 2u);
    let share_length = clamp((at_length - f32(k * k)) / f32(2u * k + 1u), 0.0, 1.0);
    let row = table3d.scalars * table3d.lengths;
    let first = interval.y * row + interval.x * table3d.lengths;
    let a = table3d_along_s0(first, k, share_length, share.x);
    return a + (table3d_along_s0(first + row, k, share_length, share.x) - a) * share.y;
}

// Composites a length with this entry.
fn table3d_composite(entry: vec4<f32>, length: f32) {
    // Rounding may leave a tiny negative extinction. Optical depths beyond 1e9 are opaque; a product that overflows has no
    // defined value.
    let mean = max(entry.w, 0.0);
    let depth = min(mean * min(length, 1e9 / max(mean, 1.0)), 1e9);
    let alpha = alpha_of_depth(depth);
    optics.light += entry * (alpha / max(mean, MEAN_MIN)) * optics.transmittance;
    optics_dim(optics.transmittance * alpha);
    if depth > 0.0 {
        optics.pieces += 1u;
        // From the near end of the segment on: a table does not know where in it (the CPU asks the transfer function itself).
        optics.visible = true;
    }
}

// Composites a segment along which the scalar goes linearly from s0 to s1.
fn optics_segment(s0: f32, s1: f32, length: f32) {
    let above = vec2(table3d_above_lo(s0), table3d_above_lo(s1));
    let below = vec2(table3d_below_hi(s0), table3d_below_hi(s1));
    // The usual case; a segment that is constant at the upper end counts as above the range.
    if all(above >= vec2(0.0)) && all(below >= vec2(0.0)) && any(below > vec2(0.0)) && length <= table3d.length_max {
        table3d_composite(table3d_look_up(above.x, above.y, length), length);
        return;
    }
    // The entry is selected: where a uniform alone was composited, Mesa's software driver (22.3) took the optical depth for one that can be
    // inlined, and read a buffer that is not bound.
    let is_below = any(above < vec2(0.0)) && all(above <= vec2(0.0));
    if is_below || all(below <= vec2(0.0)) {
        table3d_composite(select(table3d.above, table3d.below, is_below), length);
        return;
    }
    // Cut at the ends of the range. A constant segment lies inside as a whole.
    let width = table3d_above_lo(table3d.scalar_hi) + table3d.scalar_hi_rest;
    let ends = select(clamp(above, vec2(0.0), vec2(width)), vec2(width), below <= vec2(0.0));
    let up = above.y > above.x;
    var shares = vec3(0.0, 1.0, 0.0);
    if above.x != above.y {
        let rise = above.y - above.x;
        shares = vec3(ends.x - above.x, ends.y - ends.x, above.y - ends.y) / rise;
    }
    if shares.x > 0.0 {
        table3d_composite(select(table3d.above, table3d.below, up), shares.x * length);
    }
    let inside = shares.y * length;
    let parts = max(ceil(inside / table3d.length_max), 1.0);
    let rise = (ends.y - ends.x) / parts;
    for (var done = 0.0; inside > 0.0 && done < parts && optics.transmittance >= OPAQUE; done += 1.0) {
        let next = select(ends.x + rise * (done + 1.0), ends.y, done + 1.0 == parts);
        table3d_composite(table3d_look_up(ends.x + rise * done, next, inside / parts), inside / parts);
    }
    if shares.z > 0.0 {
        table3d_composite(select(table3d.below, table3d.above, up), shares.z * length);
    }
}
