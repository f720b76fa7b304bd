// Numbers as unevaluated sums of two f32, right to 2^-44 of themselves. T. J. Dekker, "A Floating-Point Technique for Extending the
// Available Precision", Numerische Mathematik 18 (1971).

fn pair_sum(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let sum = two_sum(a.x, b.x);
    return two_sum(sum.x, sum.y + (a.y + b.y));
}

fn pair_product(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let product = opaque(a.x * b.x);
    // Products of parts of 12 bits are exact.
    let a1 = leading(a.x);
    let a2 = a.x - a1;
    let b1 = leading(b.x);
    let b2 = b.x - b1;
    let rest = ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
    return two_sum(product, rest + (a.x * b.y + a.y * b.x));
}

// `b` is not zero.
fn pair_quotient(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let first = opaque(a.x / b.x);
    let product = pair_product(vec2(first, 0.0), b);
    let rest = ((a.x - product.x) + (a.y - product.y)) / b.x;
    return two_sum(first, rest);
}
