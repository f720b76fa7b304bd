// Fragments of other layers on the ray. CPU twins: `FragmentsAhead` in render/layers.rs, `RayLight::go_on` in render/cpu/light.rs.
//
// They lie in a texture, since stages have no storage buffer left: for each pixel where its fragments begin and how many they are, in two
// numbers each, which f32 has exactly; then the fragments, of two texels each.

const COUNT_BASE: u32 = 65536u;

// The next fragment's first texel, the number of fragments from it on, and its depth as `Params` counts, as a sum of two.
struct Ahead {
    next: u32,
    left: u32,
    depth: vec2<f32>,
}
var<private> ahead: Ahead;

fn texel_of_fragments(at: u32) -> vec4<f32> {
    let width = textureDimensions(layer_fragments).x;
    return textureLoad(layer_fragments, vec2(at % width, at / width), 0);
}

// Begins a ray, at a place in the plane that is rendered.
fn ahead_begin(place: vec2<u32>) {
    let numbers = vec4<u32>(texel_of_fragments(place.y * params.size_px.x + place.x));
    ahead = Ahead(numbers.x * COUNT_BASE + numbers.y, numbers.z * COUNT_BASE + numbers.w, vec2(NOWHERE, 0.0));
    look_ahead();
}

fn look_ahead() {
    ahead.depth = vec2(NOWHERE, 0.0);
    if ahead.left > 0u {
        ahead.depth = texel_of_fragments(ahead.next).xy;
    }
}

// Depth of the next fragment, counted from the start of the path.
fn depth_ahead() -> real {
    return (real(ahead.depth.x) - light.behind) + real(ahead.depth.y);
}

// Composites the next fragment, unless the ray is opaque.
fn meet_next() {
    let rgba = vec4(texel_of_fragments(ahead.next).zw, texel_of_fragments(ahead.next + 1u).xy);
    if optics.transmittance >= OPAQUE && any(rgba != vec4(0.0)) {
        let depth = depth_ahead();
        optics.light += rgba * optics.transmittance;
        optics_dim(optics.transmittance * rgba.w);
        if !optics.visible {
            optics.visible = true;
            light.visible_from = f32(depth + light.behind);
        }
        light.front = max(light.front, depth);
        light.composited = true;
    }
    ahead.next += 2u;
    ahead.left -= 1u;
    look_ahead();
}

// Composites the fragments in front of a place, and the part of the segment through a cell to it that lies in front of them.
fn pass_ahead(cell: u32, to: real2) {
    if !(depth_ahead() < to.x) {
        return;
    }
    let ends = medium_ends();
    let begin = light.last;
    var passed = 0.0;
    while depth_ahead() < to.x {
        let depth = depth_ahead();
        if depth > light.last.x {
            let share = (depth - begin.x) / (to.x - begin.x);
            let here = real2(depth, begin.y + share * (to.y - begin.y));
            medium_part(ends, vec2(passed, f32(share)));
            _ = composite_part(cell, here);
            light.last = here;
            passed = f32(share);
        }
        meet_next();
    }
    medium_part(ends, vec2(passed, 1.0));
}

// Composites the fragments behind all cells.
fn meet_rest() {
    while ahead.left > 0u && optics.transmittance >= OPAQUE {
        meet_next();
    }
}
