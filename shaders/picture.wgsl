// Paints the picture of a step and the background around it in the viewport. The picture is premultiplied and composited over
// the background.

// Colours are display-referred. `viewport` has the upper left and the lower right corner in coordinates of the picture, 0 to 1.
struct Place {
    background: vec4<f32>,
    viewport: vec4<f32>,
}

// Whether the target encodes linear colours as display-referred ones.
override LINEAR: bool = false;

@group(0) @binding(0) var<uniform> place: Place;
@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var smooth_sampler: sampler;

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) at: vec2<f32>,
}

// One triangle that covers the viewport.
@vertex
fn corner_at(@builtin(vertex_index) i: u32) -> Corner {
    let share = vec2(f32(2u * (i & 1u)), f32(i & 2u));
    return Corner(
        vec4(2.0 * share.x - 1.0, 1.0 - 2.0 * share.y, 0.0, 1.0),
        mix(place.viewport.xy, place.viewport.zw, share),
    );
}

fn linear(c: vec3<f32>) -> vec3<f32> {
    return select(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, c <= vec3(0.04045));
}

@fragment
fn picture(corner: Corner) -> @location(0) vec4<f32> {
    let light = textureSampleLevel(color, smooth_sampler, corner.at, 0.0);
    let over = light.rgb + (1.0 - light.a) * place.background.rgb;
    let in_picture = all(corner.at >= vec2(0.0)) && all(corner.at <= vec2(1.0));
    let shown = select(place.background.rgb, over, in_picture);
    if LINEAR {
        return vec4(linear(clamp(shown, vec3(0.0), vec3(1.0))), 1.0);
    }
    return vec4(shown, 1.0);
}
