// Fragments of other layers, by pixels. They lie in a texture: for each pixel where its fragments begin and how many they are; then the
// fragments, of two texels each.

struct Listed {
    // The next fragment's first texel, the number of fragments from it on, and its depth as `Params` counts, as a sum of two.
    next: u32,
    left: u32,
    depth: vec2<f32>,
}
var<private> listed: Listed;

fn texel_of_fragments(at: u32) -> vec4<f32> {
    return textureLoad(layer_fragments, texel_place(at), 0);
}

// Begins a ray, at a place in the plane that is rendered.
fn listed_begin(place: vec2<u32>) {
    let span = integers(texel_of_fragments(place.y * params.size_px.x + place.x));
    listed = Listed(span.x, span.y, vec2(NOWHERE, 0.0));
    look_at_listed();
}

fn look_at_listed() {
    listed.depth = vec2(NOWHERE, 0.0);
    if listed.left > 0u {
        listed.depth = texel_of_fragments(listed.next).xy;
    }
}

// Premultiplied colour, and opacity, of the next fragment.
fn light_of_listed() -> vec4<f32> {
    return vec4(texel_of_fragments(listed.next).zw, texel_of_fragments(listed.next + 1u).xy);
}

// Goes on behind the next fragment.
fn step_listed() {
    listed.next += 2u;
    listed.left -= 1u;
    look_at_listed();
}
