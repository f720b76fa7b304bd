// The boxes of points, and what is noted of them.

// The corners of a cell.
struct Tet {
    a: ViewVertex,
    b: ViewVertex,
    c: ViewVertex,
    d: ViewVertex,
    ids: vec4<u32>,
}

// Depths of the corners from the eye; 1 for parallel rays.
fn depths_of(tet: Tet) -> vec4<f32> {
    let depths = vec4(tet.a.depth.x + tet.a.depth.y, tet.b.depth.x + tet.b.depth.y, tet.c.depth.x + tet.c.depth.y, tet.d.depth.x + tet.d.depth.y);
    return select(vec4(1.0), depths, (params.flags & PERSPECTIVE) != 0u);
}

// The box of the union of two.
fn both_boxes(a: vec4<i32>, b: vec4<i32>) -> vec4<i32> {
    let all_of = vec4(min(a.x, b.x), max(a.y, b.y), min(a.z, b.z), max(a.w, b.w));
    let without_a = select(all_of, b, a.x > a.y || a.z > a.w);
    return select(without_a, a, b.x > b.y || b.z > b.w);
}

// The box of a tet: that of its faces.
fn tet_box(tet: Tet) -> vec4<i32> {
    if (params.flags & PERSPECTIVE) != 0u {
        if is_at_eye(tet.a) || is_at_eye(tet.b) || is_at_eye(tet.c) || is_at_eye(tet.d) {
            return whole_plane();
        }
        let depths = depths_of(tet);
        if max(max(depths.x, depths.y), max(depths.z, depths.w)) - params.pivot <= params.near {
            return NO_BOX;
        }
    }
    let first = both_boxes(face_box(tet.a, tet.b, tet.c), face_box(tet.a, tet.b, tet.d));
    return both_boxes(first, both_boxes(face_box(tet.a, tet.c, tet.d), face_box(tet.b, tet.c, tet.d)));
}

// Points of the workgroup without a pixel, and points that were widened.
var<workgroup> noted: array<atomic<u32>, 2>;

// Notes what became of a point, in the pass that counts.
fn note_point(is_culled: bool, is_enlarged: bool) {
    if !NEEDS_PLACES {
        if is_culled {
            atomicAdd(&noted[0], 1u);
        } else if is_enlarged {
            atomicAdd(&noted[1], 1u);
        }
    }
}

fn end_notes(thread: u32) {
    if !NEEDS_PLACES {
        workgroupBarrier();
        if thread < 2u {
            let count = atomicLoad(&noted[thread]);
            if count > 0u {
                atomicAdd(&lists[CULLED + thread], count);
            }
        }
    }
}
