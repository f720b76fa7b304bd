// Compositing along a ray, segment by segment. CPU twins: render/cpu/raycast/walk.rs and render/cpu/havs/light.rs.

// Transmittance below which a ray counts as opaque (optics::OPAQUE_TRANSMITTANCE).
const OPAQUE: f32 = 1.0 / 131072.0;
// Infinite depth; negated, it is before all depths.
const NOWHERE: f32 = 3.0e38;

// Depths are counted from the start of a path, so that they keep their digits there.
struct Light {
    // Length of the ray per unit of depth.
    length_per_depth: f32,
    // Depth of the path's start, as `Params` counts.
    behind: real,
    // Depth and scalar of the last place on the ray.
    last: real2,
    // Whether the optics are at `last`.
    placed: bool,
    // Depth up to which the ray has been composited, or the near distance.
    front: real,
    composited: bool,
    // Depth of the first visible place, as `Params` counts.
    visible_from: f32,
}
var<private> light: Light;

// What segments have gathered so far, whatever integrates them.
struct Optics {
    // Accumulated premultiplied colour and opacity; remaining transmittance.
    light: vec4<f32>,
    transmittance: f32,
    // Rounding error of the transmittance, carried.
    carried: f32,
    pieces: u32,
    // Whether a piece had extinction, and before which share of its segment the first of them began.
    visible: bool,
    visible_share: f32,
}
var<private> optics: Optics;

// Resets the state of a ray before its first segment.
fn light_transparent(ray: Ray) {
    light = Light(ray.length_per_depth, real(0.0), real2(0.0), false, real(params.near), false, NOWHERE);
    medium_ray(ray);
    optics = Optics(vec4(0.0), 1.0, 0.0, 0u, false, 0.0);
}

// Reduces the transmittance by the opacity gathered; the rounding error is carried into the next reduction. CPU twin:
// Accumulator::dim.
fn optics_dim(gathered: f32) {
    let left = two_sum(optics.transmittance, optics.carried - gathered);
    optics.transmittance = left.x;
    optics.carried = left.y;
}

// Composites premultiplied colour and opacity behind the accumulated light.
fn optics_add(rgb: vec3<f32>, alpha: f32) {
    optics.light += vec4(rgb, alpha) * optics.transmittance;
    optics_dim(optics.transmittance * alpha);
    optics.pieces += 1u;
}

// Composites a visible piece with these weights of the colours at its ends; it begins before this share of its segment.
fn optics_add_piece(near: vec3<f32>, far: vec3<f32>, weights: vec2<f32>, share: f32) {
    if !optics.visible {
        optics.visible = true;
        optics.visible_share = share;
    }
    let of_near = optics.transmittance * weights.x;
    let of_far = optics.transmittance * weights.y;
    optics.light += vec4(near, 1.0) * of_near + vec4(far, 1.0) * of_far;
    // Not the product with the piece's transmittance: over many equal pieces that is rounded the same way each time.
    optics_dim(optics.transmittance * (weights.x + weights.y));
    optics.pieces += 1u;
}

// Composites the segment from the last place through a cell to the next, with the fragments of other layers in front of its end, or the
// part of it behind `front`; false if there is none.
fn composite(cell: u32, to: real2) -> bool {
    pass_ahead(cell, to);
    return composite_part(cell, to);
}

// Composites the segment from the last place to another, in front of which no fragments of other layers are left.
fn composite_part(cell: u32, to: real2) -> bool {
    var from_ = light.last;
    if from_.x < light.front {
        light.placed = false;
        if to.x <= light.front {
            return false;
        }
        let share = (light.front - from_.x) / (to.x - from_.x);
        from_ = real2(light.front, from_.y + share * (to.y - from_.y));
        medium_cut(f32(share));
    }
    if to.x <= from_.x {
        // The scalar may have changed.
        light.placed = false;
        return true;
    }
    if optics.transmittance < OPAQUE {
        // Opaque: nothing more is composited, whether the ray goes on or not.
        light.placed = false;
        light.front = to.x;
        return true;
    }
    medium_segment(cell, from_, to);
    light.front = to.x;
    light.composited = true;
    return true;
}

// Composites the volume from one place to another.
fn volume_segment(from_: real2, to: real2) {
    if !light.placed {
        optics_enter(f32(from_.y));
        light.placed = true;
    }
    let was_visible = optics.visible;
    optics_segment(f32(from_.y), f32(to.y), f32(to.x - from_.x) * light.length_per_depth);
    if optics.visible && !was_visible {
        light.visible_from = f32((from_.x + real(optics.visible_share) * (to.x - from_.x)) + light.behind);
    }
}

// Whether the ray stops here: it is opaque, and early termination is on.
fn is_opaque() -> bool {
    return (params.flags & EARLY_TERMINATION) != 0u && optics.transmittance < OPAQUE;
}
