//! Camera motions by mouse and keys: pan, zoom, views along an axis, change of projection.
//!
//! Positions in the image are *plane coordinates*: (0, 0) is the centre, x to the right, y upwards, +-1 the upper and lower edge; x extends
//! to the aspect ratio. They refer to the plane through the focal point that faces the eye, so that its points stay under the cursor.

use super::framing::DEFAULT_VIEW_ANGLE;
use super::{Camera, CameraError, Projection, length};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A coordinate axis as viewing direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along x; z is up.
    X,
    /// Along y; z is up.
    Y,
    /// Along z; y is up.
    Z,
}

/// Minimum distance of the eye from the focal point, as a share of that point's distance from the world's origin: nearer, rounding would
/// dominate the viewing direction.
const SMALLEST_RELATIVE_DISTANCE: f64 = 1.0 / (1_u64 << 30) as f64;

impl Axis {
    /// Unit vector along the axis, and the up vector of a view along it.
    fn directions(self) -> (DVec3, DVec3) {
        match self {
            Self::X => (DVec3::X, DVec3::Z),
            Self::Y => (DVec3::Y, DVec3::Z),
            Self::Z => (DVec3::Z, DVec3::Y),
        }
    }
}

impl Camera {
    /// World units per plane coordinate at the focal point: half the visible height there.
    ///
    /// # Errors
    /// As [`Camera::view`].
    pub fn half_height_at_focus(&self) -> Result<f64, CameraError> {
        let half = self.view(1, 1)?.half_height;
        Ok(match self.projection {
            Projection::Perspective { .. } => half * length(self.focal_point - self.position),
            Projection::Parallel { .. } => half,
        })
    }

    /// The camera moved in its image plane, so that the scene at the focal point moves by `by` (plane coordinates).
    ///
    /// # Errors
    /// As [`Camera::view`], or if the camera would no longer be finite.
    pub fn pan(&self, by: DVec2) -> Result<Camera, CameraError> {
        let (forward, right) = self.forward_and_right()?;
        let up = right.cross(forward);
        let shift = -(right * by.x + up * by.y) * self.half_height_at_focus()?;
        checked(Camera { position: self.position + shift, focal_point: self.focal_point + shift, ..*self })
    }

    /// World length by which a plane through the focal point moves along its normal (any length) to follow a mouse movement `by` (heights
    /// of the image, x to the right, y upwards). A plane that faces the eye comes nearer when the mouse moves up. 0 without a view.
    pub fn length_along(&self, normal: DVec3, by: DVec2) -> f64 {
        let (Ok((forward, right)), Ok(half_height)) = (self.forward_and_right(), self.half_height_at_focus()) else {
            return 0.0;
        };
        let normal = (normal / normal.abs().max_element()).normalize_or_zero();
        let seen = DVec2::new(normal.dot(right), normal.dot(right.cross(forward)));
        // Seen within 17 degrees of its normal, a small movement of the mouse would move the plane far.
        let faces = seen.length() < 0.3;
        let share = if faces { -by.y * normal.dot(forward).signum() } else { by.dot(seen) / seen.length_squared() };
        2.0 * half_height * share
    }

    /// The camera moved nearer to its focal point (perspective) or with a smaller scale (parallel): the scene there becomes `factor` times
    /// as large.
    ///
    /// # Errors
    /// As [`Camera::view`], or if the factor is not positive or the camera would be too near or too far.
    pub fn zoom(&self, factor: f64) -> Result<Camera, CameraError> {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(CameraError::NotFinite("zoom"));
        }
        let mut camera = *self;
        match &mut camera.projection {
            Projection::Perspective { .. } => {
                let to_eye = (self.position - self.focal_point) / factor;
                if length(to_eye) < SMALLEST_RELATIVE_DISTANCE * length(self.focal_point) {
                    return Err(CameraError::NoDirection);
                }
                camera.position = self.focal_point + to_eye;
            }
            Projection::Parallel { scale } => *scale /= factor,
        }
        checked(camera)
    }

    /// [`Camera::zoom`] around a position in the image (plane coordinates): the point there, as far from the eye as the focal point, stays
    /// there.
    ///
    /// # Errors
    /// As [`Camera::zoom`].
    pub fn zoom_to_cursor(&self, factor: f64, cursor: DVec2) -> Result<Camera, CameraError> {
        // Zooming moves the point at the cursor to `factor` times its distance from the centre.
        self.zoom(factor)?.pan(cursor * (1.0 - factor))
    }

    /// The camera at the same distance from its focal point that looks along an axis, in positive direction or, with `from_positive`, in
    /// negative.
    ///
    /// # Errors
    /// As [`Camera::view`].
    pub fn along(&self, axis: Axis, from_positive: bool) -> Result<Camera, CameraError> {
        let (direction, view_up) = axis.directions();
        let sign = if from_positive { 1.0 } else { -1.0 };
        let distance = length(self.position - self.focal_point);
        checked(Camera { position: self.focal_point + sign * distance * direction, view_up, ..*self })
    }

    /// The camera with parallel projection instead of perspective or the reverse, at a view angle of 30 degrees; the scene at the focal
    /// point keeps its size in the image.
    ///
    /// # Errors
    /// As [`Camera::view`].
    pub fn with_other_projection(&self) -> Result<Camera, CameraError> {
        let half_height = self.half_height_at_focus()?;
        let mut camera = *self;
        match self.projection {
            Projection::Perspective { .. } => camera.projection = Projection::Parallel { scale: half_height },
            Projection::Parallel { .. } => {
                let (forward, _) = self.forward_and_right()?;
                camera.projection = Projection::Perspective { view_angle: DEFAULT_VIEW_ANGLE };
                let distance = half_height / (0.5 * DEFAULT_VIEW_ANGLE.to_radians()).tan();
                camera.position = self.focal_point - distance * forward;
            }
        }
        checked(camera)
    }
}

/// The camera, if it has a view.
fn checked(camera: Camera) -> Result<Camera, CameraError> {
    camera.view(1, 1).map(|_| camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a few dozen operations on numbers of size ten.
    const ROUNDING: f64 = 1e-12;

    fn perspective() -> Camera {
        let (lo, hi) = (DVec3::new(-1.0, 2.0, -3.0), DVec3::new(2.0, 3.0, 1.0));
        Camera::default_for((lo, hi)).unwrap()
    }

    fn cameras() -> [Camera; 2] {
        [perspective(), perspective().with_other_projection().unwrap()]
    }

    /// Plane coordinates of a world point.
    fn place(camera: &Camera, world: DVec3) -> DVec2 {
        let view = camera.view(1, 1).unwrap();
        let p = view.to_view(world);
        let depth = if view.perspective { p.z } else { 1.0 };
        DVec2::new(p.x, p.y) / (depth * view.half_height)
    }

    /// The world point at plane coordinates, as far from the eye as the focal point.
    fn world_at(camera: &Camera, place: DVec2) -> DVec3 {
        let view = camera.view(1, 1).unwrap();
        let half = camera.half_height_at_focus().unwrap();
        camera.focal_point + half * (view.right * place.x + view.up * place.y)
    }

    fn is_close(a: DVec2, b: DVec2) -> bool {
        (a - b).length() < ROUNDING
    }

    #[test]
    fn panning_moves_the_focal_plane_by_as_much() {
        let by = DVec2::new(0.25, -0.5);
        for camera in cameras() {
            let panned = camera.pan(by).unwrap();
            assert!(is_close(place(&panned, camera.focal_point), by));
            assert!(!is_close(place(&camera, camera.focal_point), by), "the test can fail");
        }
    }

    #[test]
    fn zooming_scales_what_is_at_the_focal_point() {
        for camera in cameras() {
            let zoomed = camera.zoom(2.0).unwrap();
            let half = |c: &Camera| c.half_height_at_focus().unwrap();
            assert!((half(&zoomed) * 2.0 - half(&camera)).abs() < ROUNDING);
            assert_eq!(zoomed.focal_point, camera.focal_point);
        }
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(perspective().zoom(bad).is_err());
        }
    }

    #[test]
    fn zooming_to_the_cursor_leaves_what_is_under_it() {
        let cursor = DVec2::new(0.7, -0.3);
        for camera in cameras() {
            let there = world_at(&camera, cursor);
            for factor in [0.3, 1.0, 4.0] {
                assert!(is_close(place(&camera.zoom_to_cursor(factor, cursor).unwrap(), there), cursor));
            }
            assert!(!is_close(place(&camera.zoom(4.0).unwrap(), there), cursor), "the test can fail");
        }
    }

    #[test]
    fn a_camera_cannot_be_zoomed_or_shifted_out_of_the_world() {
        let mut camera = perspective();
        let steps = (0..10_000).take_while(|_| camera.zoom(1.5).map(|c| camera = c).is_ok()).count();
        assert!(steps < 10_000 && camera.view(4, 4).is_ok());
        assert!(perspective().pan(DVec2::new(f64::INFINITY, 0.0)).is_err());
    }

    #[test]
    fn axis_views_look_along_the_axis_from_the_same_distance() {
        for camera in cameras() {
            for (axis, direction, up) in
                [(Axis::X, DVec3::X, DVec3::Z), (Axis::Y, DVec3::Y, DVec3::Z), (Axis::Z, DVec3::Z, DVec3::Y)]
            {
                for (from_positive, sign) in [(false, 1.0), (true, -1.0)] {
                    let along = camera.along(axis, from_positive).unwrap();
                    let view = along.view(4, 4).unwrap();
                    assert!(
                        (view.forward - sign * direction).length() < ROUNDING && (view.up - up).length() < ROUNDING
                    );
                    assert_eq!(along.focal_point, camera.focal_point);
                    assert!(is_close(place(&along, along.focal_point), DVec2::ZERO));
                    let half = |c: &Camera| c.half_height_at_focus().unwrap();
                    assert!((half(&along) - half(&camera)).abs() < ROUNDING);
                }
            }
        }
    }

    #[test]
    fn changing_the_projection_keeps_the_size_and_the_direction() {
        let camera = perspective();
        let parallel = camera.with_other_projection().unwrap();
        assert!(matches!(parallel.projection, Projection::Parallel { .. }));
        let p = DVec2::new(0.5, 0.25);
        assert!(is_close(place(&parallel, world_at(&camera, p)), p));
        let back = parallel.with_other_projection().unwrap();
        assert!(
            (back.position - camera.position).length() < 1e3 * ROUNDING,
            "at the default angle it is the same camera"
        );
    }
}
