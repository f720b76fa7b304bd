// The list of faces holds the boundary's: the corners of each, ascending.

fn listed_element(rank: u32) -> Element {
    let at = 3u * rank;
    return Element(vec3(drawn[at], drawn[at + 1u], drawn[at + 2u]), vec2(NONE));
}

// Whether a face that reaches the eye is hit in front of it.
fn is_seen(found: FaceHit, face: Element) -> bool {
    return found.in_front;
}
