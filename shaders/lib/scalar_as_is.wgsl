// Twin of scalar_within_face.wgsl without clamping: a volume tolerates the rounding of a hit's scalar.

fn scalar_on_face(scalar: real, p: real, q: real, r: real) -> real {
    return scalar;
}
