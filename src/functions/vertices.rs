//! One function at each vertex of a mesh (Neophytou and Mueller 2006, section 5; the ellipsoids are those of Hong et al. 2006).
//!
//! S at a vertex is w^2 times the mean of e e^T over the edges e there: long where cells are long. Its values are the scalars of a step, so
//! there is nothing to fit; what the mesh fixes is made once.
//!
//! 1. S gains 1e-6 of its trace in every direction: vertices of flat cells have functions, too.
//! 2. Every cell must be reached. The sum of phi of a cell's own four functions is asked for at its middle, and at those of its faces and
//!    edges; where it is below [`LEAST_SUM`], the functions of the cell are widened until the nearest of them alone has that.

use super::Kernels;
use super::factor::factor;
use crate::mesh::Mesh;
use glam::DVec3;
use rayon::prelude::*;

/// How functions follow the cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexFunctions {
    /// Widths, in root mean squares of the edges: the paper's sigma is 0.35 mean edges for spheres.
    pub width: f64,
    /// Distance in widths at which functions end.
    pub cut: f64,
}

impl Default for VertexFunctions {
    fn default() -> Self {
        Self { width: 0.7, cut: 3.0 }
    }
}

/// Least sum of phi over a cell's own functions at its samples.
pub const LEAST_SUM: f64 = 0.05;

/// Functions at the vertices of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexKernels {
    /// The functions, in the order of the vertices.
    pub kernels: Kernels,
    /// Vertices whose functions were widened so that they reach into all cells.
    pub widened: usize,
}

impl VertexFunctions {
    /// Checks width and cut.
    ///
    /// # Errors
    /// If one is out of range; says what the range is.
    pub fn check(&self) -> Result<(), String> {
        if !(self.width > 0.0 && self.width <= 4.0) {
            return Err(format!("functions {} times as wide as edges; above 0, and at most 4", self.width));
        }
        Kernels::check_cut(self.cut)
    }

    /// The functions at the vertices of a mesh. The same for any number of threads.
    ///
    /// # Errors
    /// As [`Self::check`], or if the mesh is a cloud, whose points have no edges.
    pub fn of(&self, mesh: &Mesh) -> Result<VertexKernels, String> {
        self.check()?;
        if mesh.is_cloud() {
            return Err("points without cells have no edges that would say how wide their functions are".to_owned());
        }
        let shapes = mesh.vertex_shapes();
        let centers = mesh.positions.local.clone();
        let factors: Vec<_> = shapes.par_iter().map(|shape| factor(shape, self.width)).collect();
        let plain = Kernels::new(centers.clone(), factors.clone(), self.cut)?;
        let wider = widening(mesh, &plain);
        let factors =
            factors.into_iter().zip(&wider).map(|(factor, &by)| factor.map(|l| (f64::from(l) * by) as f32)).collect();
        let kernels = Kernels::new(centers, factors, self.cut)?;
        Ok(VertexKernels { kernels, widened: wider.iter().filter(|by| **by > 1.0).count() })
    }
}

/// Barycentric coordinates of a cell's samples: its middle, those of its faces, those of its edges.
const SAMPLES: [[f64; 4]; 11] = {
    const THIRD: f64 = 1.0 / 3.0;
    [
        [0.25; 4],
        [0.0, THIRD, THIRD, THIRD],
        [THIRD, 0.0, THIRD, THIRD],
        [THIRD, THIRD, 0.0, THIRD],
        [THIRD, THIRD, THIRD, 0.0],
        [0.5, 0.5, 0.0, 0.0],
        [0.5, 0.0, 0.5, 0.0],
        [0.5, 0.0, 0.0, 0.5],
        [0.0, 0.5, 0.5, 0.0],
        [0.0, 0.5, 0.0, 0.5],
        [0.0, 0.0, 0.5, 0.5],
    ]
};

/// How much wider the function of each vertex has to be, at least 1.
fn widening(mesh: &Mesh, kernels: &Kernels) -> Vec<f64> {
    // Squared distance at which one function alone has the least sum.
    let enough = -2.0 * (LEAST_SUM + kernels.height_at_cut()).ln();
    let tets = &mesh.topology.tets;
    let needed: Vec<f64> = tets
        .par_iter()
        .map(|tet| {
            let corners = tet.map(|v| mesh.positions.local[v as usize].as_dvec3());
            let functions = tet.map(|v| kernels.get(v as usize));
            let needed = |weights: &[f64; 4]| {
                let at: DVec3 = corners.iter().zip(weights).map(|(p, &w)| w * *p).sum();
                let distances = functions
                    .map(|function| function.map_or(f64::INFINITY, |of| of.unscaled(at - of.center).length_squared()));
                let sum: f64 = distances.iter().map(|&d| kernels.weight(d)).sum();
                let nearest = distances.into_iter().fold(f64::INFINITY, f64::min);
                if sum >= LEAST_SUM || nearest == f64::INFINITY { 1.0 } else { (nearest / enough).sqrt().max(1.0) }
            };
            SAMPLES.iter().map(needed).fold(1.0, f64::max)
        })
        .collect();
    let mut wider = vec![1.0f64; kernels.len()];
    for (tet, &needed) in tets.iter().zip(&needed).filter(|(_, needed)| **needed > 1.0) {
        for &vertex in tet {
            wider[vertex as usize] = wider[vertex as usize].max(needed);
        }
    }
    wider
}

#[cfg(test)]
mod tests {
    use super::super::value_at;
    use super::*;
    use crate::mesh::RawMesh;
    use crate::mesh::test_meshes::Random;
    use crate::mesh::test_meshes::{jittered, kuhn_grid};

    fn of(raw: RawMesh) -> (Mesh, VertexKernels) {
        let mesh = Mesh::build(raw).unwrap().0;
        let kernels = VertexFunctions::default().of(&mesh).unwrap();
        (mesh, kernels)
    }

    #[test]
    fn a_constant_field_is_constant_and_a_linear_one_nearly_linear_inside() {
        let (mesh, VertexKernels { kernels, widened }) = of(jittered(kuhn_grid([6; 3]), &mut Random::new(1)));
        assert_eq!(widened, 0, "regular cells need no wider functions");
        let constant = vec![0.3f32; kernels.len()];
        let linear: Vec<f32> = mesh.positions.local.iter().map(|p| p.x + 0.5 * p.y).collect();
        let mut random = Random::new(2);
        let (lo, hi) = mesh.positions.local.iter().fold((1.0f32, -1.0f32), |(lo, hi), p| (lo.min(p.x), hi.max(p.x)));
        let middle = 0.5 * f64::from(lo + hi);
        for _ in 0..200 {
            let away = DVec3::new(random.signed(), random.signed(), random.signed());
            let at = DVec3::splat(middle) + 0.2 * f64::from(hi - lo) * away;
            let found = value_at(&kernels, &constant, at).unwrap();
            assert!((found - f64::from(0.3f32)).abs() < 1e-15, "{found}");
            let found = value_at(&kernels, &linear, at).unwrap();
            // Means are pulled towards where vertices are denser, here moved by an eighth of an edge. Measured: 0.24 of an edge's change.
            let edge = f64::from(hi - lo) / 6.0;
            assert!((found - (at.x + 0.5 * at.y)).abs() < 0.3 * edge, "{found} at {at}");
        }
    }

    #[test]
    fn every_sample_of_every_cell_is_reached_by_its_own_functions() {
        let point = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        // A sliver, a needle, and one short edge between long ones.
        for points in [
            [point(0.0, 0.0, 0.0), point(1.0, 0.0, 0.0), point(0.0, 1.0, 0.0), point(1.0, 1.0, 1e-5)],
            [point(0.0, 0.0, 0.0), point(1e-3, 0.0, 0.0), point(0.0, 1e-3, 0.0), point(0.0, 0.0, 1.0)],
            [point(0.0, 0.0, 0.0), point(1e-6, 0.0, 0.0), point(0.3, 1.0, 0.0), point(0.6, 0.1, 1.0)],
        ] {
            let (mesh, VertexKernels { kernels, .. }) =
                of(RawMesh { points: points.into(), cells: vec![[0, 1, 2, 3]].into() });
            let tet = mesh.topology.tets[0];
            for weights in SAMPLES {
                let at: DVec3 =
                    tet.iter().zip(weights).map(|(&v, w)| w * mesh.positions.local[v as usize].as_dvec3()).sum();
                let sum: f64 = (0..4)
                    .map(|i| kernels.get(i).unwrap())
                    .map(|of| kernels.weight(of.unscaled(at - of.center).length_squared()))
                    .sum();
                assert!(sum >= 0.99 * LEAST_SUM, "{points:?}: {sum} at {weights:?}");
                assert!(value_at(&kernels, &[1.0; 4], at) == Some(1.0));
            }
        }
    }

    #[test]
    fn narrow_functions_are_widened_and_counted() {
        let mesh = Mesh::build(kuhn_grid([2; 3])).unwrap().0;
        let narrow = VertexFunctions { width: 0.2, ..VertexFunctions::default() }.of(&mesh).unwrap();
        assert!(narrow.widened > 0);
        assert!(VertexFunctions { width: f64::NAN, cut: 3.0 }.of(&mesh).unwrap_err().contains("at most 4"));
        assert!(VertexFunctions { width: 0.7, cut: 0.0 }.of(&mesh).unwrap_err().contains("0.5"));
    }

    #[test]
    fn a_mesh_scaled_by_a_power_of_two_has_the_same_functions() {
        let raw = jittered(kuhn_grid([3; 3]), &mut Random::new(4));
        let larger = RawMesh { points: raw.points.iter().map(|p| 64.0 * *p).collect(), ..raw.clone() };
        assert_eq!(of(raw).1, of(larger).1);
    }
}
