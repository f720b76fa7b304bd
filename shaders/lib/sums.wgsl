// Error-free sums.

// a + b as the rounded sum and its rounding error.
fn two_sum(a: f32, b: f32) -> vec2<f32> {
    let sum = opaque(a + b);
    let b_seen = opaque(sum - a);
    return vec2(sum, (a - (sum - b_seen)) + (b - b_seen));
}
