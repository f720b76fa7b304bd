// Parts of a segment through the medium of optics_joint.wgsl.

// The values at both ends of the segment.
fn medium_ends() -> vec2<f32> {
    return values;
}

// Sets the next part: that between two shares of the segment with these values at its ends.
fn medium_part(ends: vec2<f32>, shares: vec2<f32>) {
    values = select(ends.x + shares * (ends.y - ends.x), ends.yy, shares == vec2(1.0));
}
