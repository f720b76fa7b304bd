// The scalar of a hit, clamped to those of the face's corners: rounding takes no ray across an isosurface that the face does not reach.

fn scalar_on_face(scalar: real, p: real, q: real, r: real) -> real {
    return clamp(scalar, min(min(p, q), r), max(max(p, q), r));
}
