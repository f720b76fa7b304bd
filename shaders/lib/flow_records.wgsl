// Splats of flow on the screen. x is to the right and y down; lengths are in local units at the splat's depth, so that neither a near nor a
// far splat loses digits.

struct FlowRecord {
    // The centre in view coordinates.
    center: ViewVertex,
    // Length of a pixel.
    pixel: f32,
    // Widths of the kernel per length to the right. The middle of a row is `slope` to the right per length down; there the distance from the centre in
    // widths is `down` per length.
    root: f32,
    slope: f32,
    down: f32,
    // How far below the centre the splat's end on the right is.
    lean: f32,
    // Periods along and across, per length to the right and down, and what they lack.
    periods: vec4<f32>,
    rests: vec4<f32>,
    // Place in the pattern at the centre.
    phase: vec2<f32>,
    // Half of the width and of the height; below 0 if nothing is seen.
    halves: vec2<f32>,
}

const RECORD_VECTORS: u32 = 6u;

fn record_of(number: u32) -> FlowRecord {
    let at = RECORD_VECTORS * number;
    let depth = flow_records[at + 1u];
    let form = flow_records[at + 2u];
    let periods = flow_records[at + 3u];
    let rests = flow_records[at + 4u];
    let last = flow_records[at + 5u];
    let center = ViewVertex(flow_records[at], vec4(depth.xyz, 0.0));
    return FlowRecord(center, depth.w, form.x, form.y, form.z, form.w, periods, rests, last.xy, last.zw);
}
