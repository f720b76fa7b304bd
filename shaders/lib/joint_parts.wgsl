// Parts of a segment through a medium of optics_joint.wgsl.

// The quantity of vertices at both ends of the segment.
fn medium_ends() -> vec2<f32> {
    return values;
}

// Of the segment with this quantity at its ends, the part between two shares of it comes next.
fn medium_part(ends: vec2<f32>, shares: vec2<f32>) {
    values = select(ends.x + shares * (ends.y - ends.x), ends.yy, shares == vec2(1.0));
}
