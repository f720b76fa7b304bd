// Weights of the two end colours of a piece on which colour and extinction are linear. CPU twins: optics/weights.rs and
// optics/thick.rs, where the formulas and their error bounds are derived.

// Weights of the colours at both ends of a piece; together its opacity.
fn piece_weights(a0: f32, a1: f32) -> vec2<f32> {
    let depth = 0.5 * (a0 + a1);
    if depth <= 0.25 {
        return weights_series(a0, a1, depth);
    }
    return weights_thick(a0, a1, depth);
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

// Largest optical depth for which the quadrature rule is used.
const RULE_DEPTH: f32 = 2.5;
// Optical depth beyond which a piece is opaque.
const DEPTH_MAX: f32 = 18.0;

// Weights beyond the series, from the mean transmittance.
fn weights_thick(a0: f32, a1: f32, depth: f32) -> vec2<f32> {
    let through = exp_neg(depth);
    var mean = 0.0;
    if depth <= RULE_DEPTH {
        mean = mean_by_rule(a0, a1);
    } else if a1 > a0 {
        let root = sqrt(0.5 * (a1 - a0));
        mean = behind_rise(root, a0) - through * behind_rise(root, a1);
    } else {
        let slope = 4.0 * (a0 - a1);
        mean = behind_fall(slope, a0) - through * behind_fall(slope, a1);
    }
    let alpha = 1.0 - through;
    let near = clamp(1.0 - mean, 0.0, alpha);
    return vec2(near, alpha - near);
}

// Seven-point Gauss-Legendre.
fn mean_by_rule(a0: f32, a1: f32) -> f32 {
    let b = 0.5 * (a1 - a0);
    let front = vec3(0.025446044, 0.1292344, 0.29707742);
    let back = vec3(0.97455394, 0.87076557, 0.7029226);
    let theta_front = front * (a0 + b * front);
    let theta_back = back * (a0 + b * back);
    return 0.06474248 * (exp_neg(theta_front.x) + exp_neg(theta_back.x))
        + 0.1398527 * (exp_neg(theta_front.y) + exp_neg(theta_back.y))
        + 0.19091502 * (exp_neg(theta_front.z) + exp_neg(theta_back.z))
        + 0.2089796 * exp_neg(0.5 * (a0 + 0.5 * b));
}

// E(z) / root, the mean transmittance if extinction went on to rise from `a`.
fn behind_rise(root: f32, a: f32) -> f32 {
    let per = 1.0 / (root + 0.25 * a);
    let x = 2.0 * (root * per) - 1.0;
    let high = 0.0003816718 + x * (-0.00026532102 + x * (-3.243757e-5 + x * 3.736439e-5));
    let middle = 0.016148534 + x * (-0.009528381 + x * (-0.0028744345 + x * (0.0013551803 + x * high)));
    return (0.45267704 + x * (0.30449012 + x * (0.12383757 + x * middle))) * per;
}

// D(z) / sqrt b, with 8 b as `slope`.
fn behind_fall(slope: f32, a: f32) -> f32 {
    let per = 1.0 / (slope + a * a);
    let v = slope * per;
    let high = 57.154068 + v * (111.84133 + v * (-94.94694 + v * 1638.3917));
    let d = 0.24999997 + v * (-1.437773 + v * (9.257574 + v * (-11.419598 + v * high)));
    let high_per = 296.27512 + v * (-46.030792 + v * (637.1453 + v * (488.14468 + v * 387.5247)));
    let per_d = 1.0 + v * (-7.0011663 + v * (44.104385 + v * (-92.07171 + v * high_per)));
    return 4.0 * a * per * (d / per_d);
}

// Weights of a piece of constant extinction.
fn homogeneous_weights(depth: f32) -> vec2<f32> {
    if depth <= 0.25 {
        return weights_series(depth, depth, depth);
    }
    let alpha = 1.0 - exp_neg(depth);
    let near = 1.0 - alpha / depth;
    return vec2(near, alpha - near);
}
