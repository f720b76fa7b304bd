//! The choice between f32 and f64 for a frame's geometry on the GPU.
//!
//! In f32 the weights of a hit are right to some 2^-24, and so is its depth, relative to the differences of the depths of a
//! face's corners: at most the longest edge L of its cells. Where cells are nearly as high as they are wide that shifts light
//! a little from one to the next. Where they are thin and yet visible, so that extinction tau times *height* is not small, tau
//! L is large, and such a shift a share of the whole cell. On meshes squashed by 1e-3 to 1e-5, with extinctions raised to match,
//! the root mean square error was 2e-9 to 3e-9 tau L, the largest 2.5e-8 tau L, and 1.7e-7 tau L where rays run along the cells.
//!
//! So meshes with thin cells are computed in f64 if the device has it and tau L is above a bound, or isosurfaces are lit in them: in f32
//! the normal of a cell is right to 2^-24 of its longest edge over its height. View coordinates are sums of two f32 in either case, right
//! to 2^-44.

use super::shaders::Precision;
use crate::mesh::Mesh;
use crate::render::RenderJob;
use crate::render::surfaces::Normals;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::{Arc, Weak};

/// Optical depth along the longest edge of a thin cell above which f32 is not enough: of rays that run along such cells the
/// transmittance is then off by 5e-6, half of the project's bound.
const OPTICAL_DEPTH_MAX: f64 = 32.0;

/// A cell is thin if its least height is below this share of its longest edge. In others tau L = 256 is one optical depth across
/// the cell, and beyond that light comes from so near its entry that a shift of 2^-24 L does not show.
const THIN: f64 = 1.0 / 256.0;

/// Chooses the precision from job to job.
#[derive(Debug, Default)]
pub(super) struct PrecisionChoice {
    /// Longest edge of a mesh's thin cells, local units; the mesh is compared by pointer.
    thin: Option<(Weak<Mesh>, f64)>,
}

impl PrecisionChoice {
    /// The precision that a job needs; `Single` without f64.
    pub(super) fn of(&mut self, has_f64: bool, job: &RenderJob) -> Precision {
        if !has_f64 {
            return Precision::Single;
        }
        let has_normals = has_normals(job);
        let steepest = job.table.nodes().iter().map(|node| node.tau).fold(0.0, f64::max);
        let per_local_unit = steepest * job.mesh.positions.scale;
        // No edge of a mesh within [-1, 1] is longer.
        let longest_possible = 12f64.sqrt();
        if !has_normals && per_local_unit * longest_possible <= OPTICAL_DEPTH_MAX {
            return Precision::Single;
        }
        let longest = self.longest_thin_edge(&job.mesh);
        if (has_normals && longest > 0.0) || per_local_unit * longest > OPTICAL_DEPTH_MAX {
            Precision::Double
        } else {
            Precision::Single
        }
    }

    fn longest_thin_edge(&mut self, mesh: &Arc<Mesh>) -> f64 {
        match &self.thin {
            Some((of, longest)) if of.as_ptr() == Arc::as_ptr(mesh) => *longest,
            _ => {
                let longest = longest_thin_edge(mesh);
                self.thin = Some((Arc::downgrade(mesh), longest));
                longest
            }
        }
    }
}

/// Whether a job has surfaces that are lit by normals.
fn has_normals(job: &RenderJob) -> bool {
    job.surfaces.as_ref().is_some_and(|scene| scene.shading().normals != Normals::None)
}

/// The longest edge of all cells that are thin, local units; 0 if none is.
fn longest_thin_edge(mesh: &Mesh) -> f64 {
    let of_cell = |tet: &[u32; 4]| {
        let corners = mesh.positions.corners(*tet).map(|p| p.as_dvec3());
        let (height, edge) = least_height_and_longest_edge(corners);
        if height < THIN * edge { edge } else { 0.0 }
    };
    mesh.topology.tets.par_iter().with_min_len(4096).map(of_cell).reduce(|| 0.0, f64::max)
}

/// Least height and longest edge of a tetrahedron.
fn least_height_and_longest_edge([a, b, c, d]: [DVec3; 4]) -> (f64, f64) {
    let [ab, ac, ad, bc, bd, cd] = [b - a, c - a, d - a, c - b, d - b, d - c];
    // Six times the volume over twice the largest face.
    let volume = ab.dot(ac.cross(ad)).abs();
    let faces = [ab.cross(ac), ab.cross(ad), ac.cross(ad), bc.cross(bd)].map(DVec3::length);
    let largest = faces.into_iter().fold(0.0, f64::max);
    let longest = [ab, ac, ad, bc, bd, cd].map(DVec3::length).into_iter().fold(0.0, f64::max);
    (if largest > 0.0 { volume / largest } else { 0.0 }, longest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};

    #[test]
    fn a_height_is_the_distance_of_a_corner_from_the_face_opposite() {
        for height in [1.0, 1e-3, 1e-6] {
            let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.2, 0.3, height)];
            let (least, longest) = least_height_and_longest_edge(corners);
            // Some roundings of f64 (measured: none) above its height. Above the diagonal x + y = 1 the corner is nearer to the face
            // through it than to the one at z = 0 only if high.
            assert!(least <= height * (1.0 + 4.0 * f64::EPSILON) && least > 0.25 * height, "{least} of {height}");
            assert!(longest >= 2f64.sqrt() && longest < 1.6);
        }
        assert_eq!(least_height_and_longest_edge([DVec3::ONE; 4]), (0.0, 0.0));
    }

    const CAMERA: Camera = Camera {
        position: DVec3::new(9.0, 8.0, 7.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Z,
        projection: Projection::Parallel { scale: 1.0 },
        near: 0.0,
    };

    fn job(squash: f64, tau: f64) -> RenderJob {
        use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};
        use crate::node_table::{Node, NodeTable};
        use crate::render::testing;
        let mut raw = jittered(kuhn_grid([4; 3]), &mut Random::new(1));
        raw.points.iter_mut().for_each(|p| p.z *= squash);
        let mesh = Arc::new(Mesh::build(raw).unwrap().0);
        let scalars = vec![0.0; mesh.positions.local.len()];
        let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau }]).unwrap();
        testing::job(&mesh, scalars, &CAMERA, (8, 8), Arc::new(table))
    }

    #[test]
    fn thin_cells_with_lit_surfaces_are_computed_in_f64() {
        use crate::render::surfaces::{Isosurface, SurfaceScene, SurfaceShading};
        let mut choice = PrecisionChoice::default();
        for (squash, normals, expected) in [
            (1.0, Normals::Cell, Precision::Single),
            (1e-4, Normals::Cell, Precision::Double),
            (1e-4, Normals::Vertex, Precision::Double),
            (1e-4, Normals::None, Precision::Single),
        ] {
            let job = job(squash, 0.0);
            let shading = SurfaceShading { normals, ..SurfaceShading::default() };
            let scene = SurfaceScene::new(&[Isosurface::new(0.0)], shading, &job.table).unwrap();
            let job = RenderJob { surfaces: Some(scene), ..job };
            assert_eq!(choice.of(true, &job), expected, "squash {squash}, {normals:?}");
            assert_eq!(choice.of(false, &job), Precision::Single);
        }
    }

    #[test]
    fn thin_cells_that_are_visible_are_computed_in_f64() {
        let mut choice = PrecisionChoice::default();
        for (squash, tau, expected) in [
            (1.0, 1.0, Precision::Single),
            // Opaque, but no cell is thin.
            (1.0, 1e6, Precision::Single),
            // Thin, but hardly visible.
            (1e-5, 10.0, Precision::Single),
            (1e-5, 1e5, Precision::Double),
            (1e-3, 2e3, Precision::Double),
        ] {
            assert_eq!(choice.of(true, &job(squash, tau)), expected, "squash {squash}, tau {tau}");
            assert_eq!(choice.of(false, &job(squash, tau)), Precision::Single);
        }
    }
}
