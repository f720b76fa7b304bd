//! Why geometry outside of the view may be skipped.
//!
//! A walk only accesses the corners of the cells on its path. Each of these has a face with the ray's origin in its sheared triangle: the
//! ray's line passes it within the rounding of sheared coordinates, a few 2^-53 of the magnitudes that they are summed from.
//! [`Clusters`](crate::visibility::Clusters) skips what lies outside of the lines' directions by far more.
//!
//! In perspective the lines extend behind the eye, where geometry is skipped, too. A path begins in front of the eye, or in a cell at the
//! eye that it leaves in front of it. From cell to cell depths increase, except in cells so thin that rounding inverts them; a path that
//! returns behind the eye does so in a cell at the eye, since rays meet there. Hence: if no cell at the eye is that thin, all cells of a
//! path have a point in front of the eye; otherwise nothing is skipped.

use crate::camera::View;
use crate::mesh::Mesh;

/// Whether paths are certain to stay within the view; `eye_cells` may contain the eye.
///
/// A cell inverts only if its corners move by about its least height, which is at least the determinant of its edges divided by the
/// square of the longest one. Coordinates, at most 2 within the local box, are rounded by less than 2^-48 times the slope of the rays.
pub(super) fn may_be_left_out(mesh: &Mesh, view: &View, eye_cells: &[u32]) -> bool {
    const THIN: f64 = 1.0 / (1u64 << 32) as f64;
    let least_height = THIN * (1.0 + view.half_width + view.half_height);
    eye_cells.iter().all(|&cell| {
        let [a, b, c, d] = mesh.topology.tets[cell as usize].map(|v| mesh.positions.local[v as usize].as_dvec3());
        let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
        let longest = edges.iter().fold(0.0, |most: f64, edge| most.max(edge.length_squared()));
        edges[0].cross(edges[1]).dot(edges[2]).abs() > least_height * longest
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::mesh::RawMesh;
    use glam::DVec3;

    #[test]
    fn beside_a_cell_that_rounding_may_turn_inside_out_nothing_is_left_out() {
        for (height, expected) in [(1.0, true), (1e-6, true), (1e-12, false)] {
            let points = vec![DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::new(0.0, 0.1, height)];
            let mesh = Mesh::build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }).unwrap().0;
            let view = Camera::default_for((DVec3::NEG_ONE, DVec3::ONE)).unwrap().view(8, 8).unwrap();
            assert_eq!(may_be_left_out(&mesh, &view, &[0]), expected, "{height}");
            assert!(may_be_left_out(&mesh, &view, &[]));
        }
    }
}
