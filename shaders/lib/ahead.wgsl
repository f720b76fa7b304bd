// Other layers on the ray, composited between its segments, from fragments_ahead.wgsl or flow_ahead.wgsl. CPU twin: `RayLight::go_on` in
// render/cpu/light.rs.

// Depth of the next place, counted from the start of the path.
fn depth_ahead() -> real {
    let depth = place_ahead();
    return (real(depth.x) - light.behind) + real(depth.y);
}

// Composites the next place, unless the ray is opaque.
fn meet_next() {
    let rgba = light_ahead();
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
    step_ahead();
}

// Composites what lies in front of a place, and the part of the segment through a cell to it that lies in front of that.
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

// Composites what lies behind all cells.
fn meet_rest() {
    while is_some_ahead() && optics.transmittance >= OPAQUE {
        meet_next();
    }
    count_ahead();
}
