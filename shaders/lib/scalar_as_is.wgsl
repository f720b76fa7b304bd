// Twin of scalar_within_face.wgsl: what rounding makes of the scalar of a hit does not matter to a volume.

fn scalar_on_face(scalar: real, p: real, q: real, r: real) -> real {
    return scalar;
}
