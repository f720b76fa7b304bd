// The faces of the mesh, the list of those drawn, and behind it the cells at the eye.

fn face_word(face: u32, word: u32) -> u32 {
    let part = list_params.face_part;
    if face < part {
        return faces_0[FACE_WORDS * face + word];
    }
    if face < 2u * part {
        return faces_1[FACE_WORDS * (face - part) + word];
    }
    return faces_2[FACE_WORDS * (face - 2u * part) + word];
}

fn load_face(face: u32) -> Element {
    let ids = vec3(face_word(face, 0u), face_word(face, 1u), face_word(face, 2u));
    return Element(ids, vec2(face_word(face, 3u), face_word(face, 4u)));
}

// A face of the list.
fn listed_element(rank: u32) -> Element {
    return load_face(drawn[rank]);
}

fn eye_word(index: u32, word: u32) -> u32 {
    return drawn[list_params.drawn_count + EYE_WORDS * index + word];
}

// Whether a face of a cell at the eye is hit in front of the eye. For faces with one active cell that is decided exactly, by the
// eye's side of the face's plane: an eye in the boundary sees what is in front of it. For others any decision will do on which
// all cells agree.
fn is_before_eye(found: FaceHit, bits: u32, face: u32) -> bool {
    if ((bits >> (8u + face)) & 1u) == 0u {
        return found.in_front;
    }
    let enters = (((bits >> (12u + face)) & 1u) != 0u) != found.turned;
    return ((bits >> select(4u + face, face, enters)) & 1u) != 0u;
}

// Whether a face that reaches the eye is hit in front of it.
fn is_seen(found: FaceHit, face: Element) -> bool {
    for (var i = 0u; i < list_params.eye_count; i++) {
        if any(face.cells == vec2(eye_word(i, 0u))) {
            let bits = eye_word(i, 1u);
            for (var corner = 0u; corner < 4u; corner++) {
                let is_open = ((bits >> (8u + corner)) & 1u) != 0u;
                if is_open && all(face.ids != vec3(eye_word(i, 2u + corner))) {
                    return is_before_eye(found, bits, corner);
                }
            }
        }
    }
    return found.in_front;
}
