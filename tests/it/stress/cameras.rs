//! Where the scenes are seen from.

use super::*;
use glam::DVec3;

pub const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };
/// Not a divisor of the box's size: no ray of an image of about 50 pixels lies in the box's faces.
pub const PARALLEL: Projection = Projection::Parallel { scale: 1.27 };

pub const AXES: [DVec3; 6] = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];

fn both(direction: DVec3) -> [Camera; 2] {
    [PERSPECTIVE, PARALLEL].map(|projection| camera(5.0 * direction.normalize(), projection))
}

/// Along axes and diagonals, from where the rays in the middle of an odd image run in faces and along edges of regular meshes,
/// and obliquely.
pub fn around() -> Vec<Camera> {
    let diagonals = [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [1.0, 0.0, -1.0], [0.0, 1.0, 1.0]];
    let directions = AXES.into_iter().step_by(2).chain(diagonals.map(DVec3::from_array));
    directions.flat_map(both).chain(oblique()).collect()
}

/// Neither along axes nor along diagonals.
pub fn oblique() -> Vec<Camera> {
    [[1.0, -2.0, 0.5], [0.5, 0.3, 4.0], [2.0, 1.0, -3.0], [3.0, 2.0, 0.1]]
        .into_iter()
        .flat_map(|direction| both(DVec3::from_array(direction)))
        .collect()
}

/// Parallel projection along each axis, in both directions.
pub fn along_axes() -> Vec<Camera> {
    AXES.map(|axis| camera(4.0 * axis, PARALLEL)).to_vec()
}

/// A wide view from a place inside.
pub fn within(position: DVec3, view_angle: f64, near: f64) -> Camera {
    let projection = Projection::Perspective { view_angle };
    Camera { position, focal_point: DVec3::new(-0.43, 0.12, -0.21), view_up: DVec3::Z, projection, near }
}

/// The same view of a world that is `scale` times as large and moved by `offset`.
pub fn moved(camera: &Camera, offset: DVec3, scale: f64) -> Camera {
    let projection = match camera.projection {
        Projection::Parallel { scale: half_height } => Projection::Parallel { scale: half_height * scale },
        perspective @ Projection::Perspective { .. } => perspective,
    };
    let place = |p: DVec3| offset + scale * p;
    Camera {
        position: place(camera.position),
        focal_point: place(camera.focal_point),
        near: camera.near * scale,
        projection,
        ..*camera
    }
}
