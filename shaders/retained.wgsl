// Copies the retained picture of a window onto the window, pixel by pixel.

@group(0) @binding(0) var retained: texture_2d<f32>;

// One triangle that covers the window.
@vertex
fn corner_at(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
    let share = vec2(f32(2u * (i & 1u)), f32(i & 2u));
    return vec4(2.0 * share.x - 1.0, 1.0 - 2.0 * share.y, 0.0, 1.0);
}

@fragment
fn pixel(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(retained, vec2<u32>(position.xy), 0);
}
