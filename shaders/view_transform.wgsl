// View transform: transforms vertices to view coordinates and maps scalars, once per frame. CPU twins: render/cpu/ray.rs,
// `transform`; `ScalarMap::seen`.
//
// The CPU works in f64. Here coordinates are unevaluated sums of two f32: the eye is subtracted without error, products of
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

// Clamped to stay finite: a cell that reaches beyond 1e30 times the table's range is drawn as if it ended there.
fn seen(scalar: f32) -> f32 {
    return clamp((scalar - params.scalar_offset) * params.scalar_scale, -1e30, 1e30);
}

// The mapped scalars of four cells; behind the last cell its scalar again.
fn seen_from(first: u32) -> vec4<f32> {
    let at = min(vec4(first) + vec4(0u, 1u, 2u, 3u), vec4(params.cell_count - 1u));
    return vec4(seen(scalars[at.x]), seen(scalars[at.y]), seen(scalars[at.z]), seen(scalars[at.w]));
}

@compute @workgroup_size(256)
fn view_transform(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let v = id.x + id.y * groups.x * 256u;
    if v >= params.vertex_count {
        // Behind the vertices a thread is eight cells, whose scalars lie as behind_vertices.wgsl reads them.
        let first = 8u * (v - params.vertex_count);
        if first < params.cell_count {
            vertices[v] = ViewVertex(seen_from(first), seen_from(first + 4u));
        }
        return;
    }
    let p = vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]);
    let dx = two_sum(p.x, -params.eye_hi.x);
    let dy = two_sum(p.y, -params.eye_hi.y);
    let dz = two_sum(p.z, -params.eye_hi.z);
    let d_hi = vec3(dx.x, dy.x, dz.x);
    let d_lo = vec3(dx.y, dy.y, dz.y) - params.eye_lo.xyz;
    let x = along(d_hi, d_lo, 0u) * PLANE_SCALE;
    let y = along(d_hi, d_lo, 1u) * PLANE_SCALE;
    let w = along(d_hi, d_lo, 2u);
    let from_origin = two_sum(w.x, -params.depth_origin.x);
    let rest = from_origin.y + (w.y - params.depth_origin.y);
    let w1 = leading(from_origin.x);
    let w23 = two_sum(from_origin.x - w1, rest);
    vertices[v] = ViewVertex(vec4(x, y), vec4(w1, w23, seen(scalars[v])));
}
