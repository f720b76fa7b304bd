//! The image error of omitting a face.
//!
//! Between two drawn faces, a ray gets linearly interpolated scalars. Without the face between cells A and B the interpolation goes from
//! faces of A to faces of B and misses the kink at the face. The error is estimated where the segment between the two vertices opposite the
//! face meets its plane:
//!
//! ```text
//! e = | interpolated over the face - interpolated between the two vertices |
//! ```
//!
//! It is 0 where scalars are linear across both cells. Where only a share p of the faces is drawn, gaps are 1 / p cells long, and the error
//! of linear interpolation grows with the square of that: with A for the area of the face, which is proportional to its pixels, the squared
//! error of the image is about the sum of A e^2 / p^4 over the faces. For a given number of faces, the sum of p, it is least at p ~ (A
//! e^2)^(1/5) (by a Lagrange multiplier). Because of the fifth root, the most important faces alone make bad images, and a sample of all
//! faces that is only a little denser where it matters makes good ones.

use crate::mesh::{Connectivity, Mesh, NONE, Topology};
use glam::DVec3;
use rayon::prelude::*;

/// Faces per task.
const FACES_AT_ONCE: usize = 1 << 13;
/// Smaller errors are raised to this share of their mean: where the sampled steps show no change, others may, or a transfer function may
/// amplify a small one.
const ERROR_FLOOR: f64 = 0.05;
/// Smaller areas are raised to this share of their mean.
const AREA_FLOOR: f64 = 1e-3;

/// Sampling density of each face relative to the others: (A e^2)^(1/5) with e^2 the mean over steps; 0 for faces of the surface, which are
/// always drawn.
///
/// `scalars` holds `steps` values per vertex, vertex by vertex; for each face, only steps with finite scalars at all three vertices and
/// both opposite ones count.
///
/// # Panics
/// If there are not `steps` scalars for each vertex.
pub fn sampling_density(mesh: &Mesh, scalars: &[f32], steps: usize) -> Vec<f32> {
    let topology = &mesh.topology;
    assert_eq!(scalars.len(), topology.vertex_count as usize * steps, "{steps} scalars per vertex");
    let of_face = |face: usize| match Stencil::of(mesh, face) {
        Some(stencil) => [stencil.area, stencil.mean_square(scalars, steps)],
        None => [f64::NAN; 2],
    };
    let faces = (0..topology.connectivity().faces.len()).into_par_iter().with_min_len(FACES_AT_ONCE);
    let found: Vec<[f64; 2]> = faces.map(of_face).collect();
    let inner = || found.iter().filter(|face| !face[0].is_nan());
    // Sequential, so that the sum is the same for any number of threads.
    let count = inner().count().max(1) as f64;
    let mean_area = inner().map(|face| face[0]).sum::<f64>() / count;
    let mean_error = inner().map(|face| face[1].sqrt()).sum::<f64>() / count;
    let share = |x: f64, mean: f64| if mean > 0.0 { x / mean } else { 1.0 };
    let density = |&[area, square]: &[f64; 2]| {
        if area.is_nan() {
            return 0.0;
        }
        let error = share(square.sqrt(), mean_error);
        let area = share(area, mean_area).max(AREA_FLOOR);
        (area * (error * error + ERROR_FLOOR * ERROR_FLOOR)).powf(0.2) as f32
    };
    found.par_iter().with_min_len(FACES_AT_ONCE).map(density).collect()
}

/// The error of a face as a sum over five vertices.
struct Stencil {
    vertices: [u32; 5],
    weights: [f64; 5],
    area: f64,
}

impl Stencil {
    /// `None` for faces of the surface.
    fn of(mesh: &Mesh, face: usize) -> Option<Self> {
        let topology = &mesh.topology;
        let [a, b] = opposite(topology, face)?;
        let corners = topology.connectivity().faces[face];
        let at = |v: u32| mesh.positions.local[v as usize].as_dvec3();
        let [p, q, r] = corners.map(at);
        let normal = (q - p).cross(r - p);
        let [above, below] = [a, b].map(|v| normal.dot(at(v) - p));
        // Flat cells: the midpoint.
        let toward_b = if above == below { 0.5 } else { (above / (above - below)).clamp(0.0, 1.0) };
        let crossing = at(a).lerp(at(b), toward_b);
        let [x, y, z] = barycentric(crossing, [p, q, r], normal);
        let [i, j, k] = corners;
        Some(Self {
            vertices: [i, j, k, a, b],
            weights: [x, y, z, toward_b - 1.0, -toward_b],
            area: 0.5 * normal.length(),
        })
    }

    /// The mean of the squared errors over the steps with finite scalars; 0 if there are none.
    fn mean_square(&self, scalars: &[f32], steps: usize) -> f64 {
        let of = self.vertices.map(|v| &scalars[v as usize * steps..][..steps]);
        let error = |step| (0..5).map(|i| self.weights[i] * f64::from(of[i][step])).sum::<f64>();
        let finite = (0..steps).map(error).filter(|e| e.is_finite());
        let (sum, count) = finite.fold((0.0, 0u32), |(sum, count), e| (sum + e * e, count + 1));
        if count == 0 { 0.0 } else { sum / f64::from(count) }
    }
}

/// The vertices opposite a face in its two cells; `None` if it has only one cell.
fn opposite(topology: &Topology, face: usize) -> Option<[u32; 2]> {
    let Connectivity { faces, face_cells, .. } = topology.connectivity();
    let (corners, cells) = (&faces[face], face_cells[face]);
    if cells.contains(&NONE) {
        return None;
    }
    let of = |cell: u32| topology.tets[cell as usize].into_iter().find(|v| !corners.contains(v));
    Some([of(cells[0])?, of(cells[1])?])
}

/// Barycentric coordinates in a triangle of the projection of `at` to its plane. The point may lie outside if the two cells are not convex
/// together: up to one size of the triangle counts. A triangle without area gives its centroid.
fn barycentric(at: DVec3, [p, q, r]: [DVec3; 3], normal: DVec3) -> [f64; 3] {
    let square = normal.length_squared();
    let x = (r - q).cross(at - q).dot(normal) / square;
    let y = (p - r).cross(at - r).dot(normal) / square;
    if !(x.is_finite() && y.is_finite()) {
        return [1.0 / 3.0; 3];
    }
    let [x, y] = [x, y].map(|w| w.clamp(-1.0, 2.0));
    [x, y, 1.0 - x - y]
}
