// Lists in textures, since stages have no storage buffer left. Integers are in two numbers each, which f32 has exactly.

// Texels of a row.
const TEXELS_WIDE: u32 = 2048u;
const COUNT_BASE: u32 = 65536u;

fn texel_place(at: u32) -> vec2<u32> {
    return vec2(at % TEXELS_WIDE, at / TEXELS_WIDE);
}

// Two integers.
fn integers(digits: vec4<f32>) -> vec2<u32> {
    let numbers = vec4<u32>(digits);
    return numbers.xz * COUNT_BASE + numbers.yw;
}

// The digits of two integers.
fn digits(numbers: vec2<u32>) -> vec4<f32> {
    let high = numbers / COUNT_BASE;
    let low = numbers % COUNT_BASE;
    return vec4<f32>(vec4(high.x, low.x, high.y, low.y));
}
