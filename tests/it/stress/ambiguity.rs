//! Which rays lie in a face of the boundary: neither inside nor outside, whatever arithmetic decides.

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use tetreel::camera::View;
use tetreel::mesh::NONE;
use tetreel::render::RenderJob;

/// Above what f64 rounds the coordinates of a sheared face to (2^-53 of the eye's distance, up to 100 sizes of the mesh), below
/// what moves a ray out of a face in an image.
const TOLERANCE: f64 = 1e-12;

/// Of each pixel, whether its ray runs along a face at which active cells end.
pub fn rays_in_boundary_faces(job: &RenderJob) -> Vec<bool> {
    let view = job.local_view();
    let topology = &job.mesh.topology;
    let is_active = |cell: u32| cell != NONE && job.active.contains(cell);
    let to_view = |v: u32| view.to_view(job.mesh.positions.local[v as usize].as_dvec3());
    let boundary =
        topology.connectivity().face_cells.iter().zip(&topology.connectivity().faces).filter(|(cells, _)| {
            let [first, second] = cells.map(is_active);
            first != second
        });
    let faces: Vec<[DVec3; 3]> = boundary.map(|(_, face)| face.map(to_view)).collect();
    let pixels = (0..view.width_px * view.height_px).into_par_iter();
    let ray = |pixel: usize| view.ray(pixel % view.width_px, pixel / view.width_px);
    pixels.map(|pixel| faces.iter().any(|face| lies_in(&view, face, ray(pixel)))).collect()
}

/// Whether the ray of image-plane point (px, py) lies in the face's plane and meets it. With the ray as origin of a plane, such a
/// face is a line through the origin.
fn lies_in(view: &View, face: &[DVec3; 3], (px, py): (f64, f64)) -> bool {
    if view.perspective && face.iter().all(|corner| corner.z <= 0.0) {
        return false;
    }
    let size = (face[1] - face[0]).length().max((face[2] - face[0]).length());
    let [a, b, c] = face.map(|corner| {
        let depth = if view.perspective { corner.z } else { 1.0 };
        DVec2::new(corner.x - px * depth, corner.y - py * depth)
    });
    if (b - a).perp_dot(c - a).abs() > TOLERANCE * size * size {
        return false;
    }
    let near_origin = |(p, q): (DVec2, DVec2)| {
        let along = q - p;
        let share = if along == DVec2::ZERO { 0.0 } else { (-p.dot(along) / along.length_squared()).clamp(0.0, 1.0) };
        (p + share * along).length() <= TOLERANCE * size
    };
    [(a, b), (b, c), (c, a)].into_iter().any(near_origin)
}
