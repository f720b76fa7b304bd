// View coordinates. The CPU works in f64. Here they are unevaluated sums of two f32: the eye is subtracted without error, products of
// 12-bit parts are exact, and their sums keep their rounding errors. The remaining error is 2^-44 of the distance to the eye.

fn add(sum: vec2<f32>, term: f32) -> vec2<f32> {
    let next = two_sum(sum.x, term);
    return vec2(next.x, sum.y + next.y);
}

// Component of the place (d_hi + d_lo) along an axis.
fn along(d_hi: vec3<f32>, d_lo: vec3<f32>, axis: u32) -> vec2<f32> {
    let a1 = params.axes[3u * axis].xyz;
    let a2 = params.axes[3u * axis + 1u].xyz;
    let a3 = params.axes[3u * axis + 2u].xyz;
    let d1 = vec3(leading(d_hi.x), leading(d_hi.y), leading(d_hi.z));
    let d2 = d_hi - d1;
    var sum = vec2(0.0);
    for (var i = 0u; i < 3u; i++) {
        sum = add(sum, d1[i] * a1[i]);
        sum = add(sum, d1[i] * a2[i]);
        sum = add(sum, d2[i] * a1[i]);
        sum = add(sum, d2[i] * a2[i]);
    }
    let small = dot(d_hi, a3) + dot(d_lo, a1 + a2);
    return two_sum(sum.x, sum.y + small);
}

// The place that is the sum of p_hi and p_lo in view coordinates, with a scalar.
fn in_view(p_hi: vec3<f32>, p_lo: vec3<f32>, scalar: f32) -> ViewVertex {
    let dx = two_sum(p_hi.x, -params.eye_hi.x);
    let dy = two_sum(p_hi.y, -params.eye_hi.y);
    let dz = two_sum(p_hi.z, -params.eye_hi.z);
    let d_hi = vec3(dx.x, dy.x, dz.x);
    let d_lo = (vec3(dx.y, dy.y, dz.y) - params.eye_lo.xyz) + p_lo;
    let x = along(d_hi, d_lo, 0u) * PLANE_SCALE;
    let y = along(d_hi, d_lo, 1u) * PLANE_SCALE;
    let w = along(d_hi, d_lo, 2u);
    let from_origin = two_sum(w.x, -params.depth_origin.x);
    let rest = from_origin.y + (w.y - params.depth_origin.y);
    let w1 = leading(from_origin.x);
    let w23 = two_sum(from_origin.x - w1, rest);
    return ViewVertex(vec4(x, y), vec4(w1, w23, scalar));
}
