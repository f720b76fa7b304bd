// Numbers as unevaluated sums of two f32, right to 2^-44 of themselves.

// a * b as the rounded product and its rounding error.
fn two_product(a: f32, b: f32) -> vec2<f32> {
    let product = opaque(a * b);
    let a1 = leading(a);
    let a2 = a - a1;
    let b1 = leading(b);
    let b2 = b - b1;
    return vec2(product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2);
}

fn plus(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let sum = two_sum(a.x, b.x);
    return two_sum(sum.x, sum.y + (a.y + b.y));
}

fn times(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let product = two_product(a.x, b.x);
    return two_sum(product.x, product.y + (a.x * b.y + a.y * b.x));
}

fn over(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let first = a.x / b.x;
    let rest = plus(a, -times(vec2(first, 0.0), b));
    return two_sum(first, (rest.x + rest.y) / b.x);
}

fn root_of(a: vec2<f32>) -> vec2<f32> {
    let first = sqrt(a.x);
    let rest = plus(a, -two_product(first, first));
    return two_sum(first, (rest.x + rest.y) / (2.0 * first));
}

// The depth of a vertex.
fn double_depth(v: ViewVertex) -> vec2<f32> {
    return plus(two_sum(v.depth.x, v.depth.y), vec2(v.depth.z, 0.0));
}
