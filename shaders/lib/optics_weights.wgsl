// Weights of the two end colours of a piece on which colour and extinction are linear. CPU twin: optics/weights.rs, where the
// formulas and their error bounds are derived.

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

// Weights of a piece along which extinction does not change.
fn homogeneous_weights(depth: f32) -> vec2<f32> {
    if depth <= 0.25 {
        return weights_series(depth, depth, depth);
    }
    let alpha = 1.0 - exp_neg(depth);
    let near = 1.0 - alpha / depth;
    return vec2(near, alpha - near);
}
