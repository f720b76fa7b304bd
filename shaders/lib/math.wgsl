// exp and 1 - exp to f32's accuracy: WGSL leaves the error of its exp to the driver and has no expm1.

// exp(-x) for 0 <= x; 0 from 87 on. x is split into k ln 2 + r with |r| <= 0.35; the Taylor polynomial of degree 7 leaves
// out 0.35^8 / 40320 = 6e-9, so that rounding (1.5e-7 of the value) is the error.
fn exp_neg(x: f32) -> f32 {
    if x >= 87.0 {
        return 0.0;
    }
    let k = round(x * 1.4426950408889634);
    // ln 2 in two parts, the first of 9 bits: k times it is exact.
    let y = (k * 0.693359375 - x) + k * -2.12194440e-4;
    let p = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0 + y * (1.0 / 720.0 + y * (1.0 / 5040.0)))))));
    return p * bitcast<f32>(u32(127 - i32(k)) << 23u);
}

// 1 - exp(-x) for 0 <= x, to 3e-7 of the value however small: below 1/2 by the Taylor polynomial of degree 8, which leaves
// out 0.5^8 / 362880 = 1e-8 of it; above, nothing cancels.
fn alpha_of_depth(x: f32) -> f32 {
    if x > 0.5 {
        return 1.0 - exp_neg(x);
    }
    return x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0 - x * (1.0 / 5040.0 - x * (1.0 / 40320.0))))))));
}
