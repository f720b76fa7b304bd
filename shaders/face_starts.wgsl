// Face starts: finds the rays that begin within the active cells. CPU twin: render/cpu/havs/tile.rs, `start_at_eye`.

// Keeps the first fragment of a ray that begins in a cell at the eye: where it enters the cell, behind the eye, if the next
// fragment is sure to be the cell's exit; else at the eye, with the scalar there.
fn start_in(ray: Ray, index: u32, tile: u32, local: u32) {
    let bits = eye_word(index, 1u);
    var entry = NO_HIT;
    var exit = entry;
    var entered_in_front = true;
    var left_in_front = false;
    for (var face = 0u; face < 4u; face++) {
        // All corners except corner `face`, in ascending order.
        let ids = vec3(eye_word(index, select(2u, 3u, face == 0u)), eye_word(index, select(3u, 4u, face <= 1u)), eye_word(index, select(4u, 5u, face <= 2u)));
        let a = vertices[ids.x];
        let b = vertices[ids.y];
        let c = vertices[ids.z];
        let found = hit_face(ray, ids, a, b, c);
        if !found.hit {
            continue;
        }
        let in_front = !reaches_eye(a, b, c) || is_before_eye(found, bits, face);
        if (((bits >> (12u + face)) & 1u) != 0u) != found.turned {
            entry = found;
            entered_in_front = in_front;
        } else {
            exit = found;
            left_in_front = in_front;
        }
    }
    if !entry.hit || !exit.hit || entered_in_front || !left_in_front {
        return;
    }
    let wanted = COMPLETE | EXACT_ORDER;
    let from_ = entry.at.depth.x + entry.at.depth.y;
    let to = exit.at.depth.x + exit.at.depth.y;
    if (list_params.flags & wanted) != wanted && from_ < 0.0 && to > from_ {
        let share = -from_ / (to - from_);
        entry.at.scalar += (exit.at.scalar - entry.at.scalar) * share;
        entry.at.value += (exit.at.value - entry.at.value) * share;
        entry.at.depth = vec2(0.0);
    }
    keep_fragment(tile, local, fragment_of_hit(entry.at, index, vec2(NONE, eye_word(index, 0u))));
}

@compute @workgroup_size(256)
fn face_starts(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = list_params.first + group.x + group.y * groups.x;
    let pixel = pixel_of_thread(tile, local);
    if tile >= list_params.end || any(pixel >= params.size_px) || !is_in_band(tile, local) {
        return;
    }
    let ray = ray_through(pixel);
    for (var i = 0u; i < list_params.eye_count; i++) {
        start_in(ray, i, tile, local);
    }
}
