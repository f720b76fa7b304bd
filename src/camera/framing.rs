//! Cameras that frame a whole box, and orbits around it.

use super::{Camera, CameraError, Projection, length, unit};
use glam::DVec3;

/// View angle of a default camera, degrees; VTK's.
pub(super) const DEFAULT_VIEW_ANGLE: f64 = 30.0;

/// Viewing direction of a default camera: from the front right and above, each axis at another angle, so that no pair of
/// box edges coincides in the image and neither a flat nor an elongated box is seen edge-on.
const DEFAULT_DIRECTION: DVec3 = DVec3::new(-0.52, 0.70, -0.49);

/// A box smaller than this share of its distance from the world's origin is framed as if it had that size: eye and focal point must differ
/// by many rounding units.
const SMALLEST_RELATIVE_RADIUS: f64 = 1.0 / (1_u64 << 40) as f64;

/// Framed radius of a box of size zero at the origin; VTK's.
const RADIUS_OF_A_POINT: f64 = 0.5;

/// Closest approach of an orbit to the poles, degrees: there, up and viewing direction would be parallel.
const POLE_MARGIN: f64 = 0.1;

impl Camera {
    /// A perspective camera that looks along `direction` at the box from `bounds_lo` to `bounds_hi`, at the distance at
    /// which its bounding sphere fits the vertical view angle (degrees), as `vtkRenderer::ResetCamera` does.
    ///
    /// A box of size zero is framed as a small sphere around it.
    ///
    /// # Errors
    /// If bounds are not finite, the direction is zero, or the angle is outside (0, 180).
    pub fn frame(
        bounds_lo: DVec3,
        bounds_hi: DVec3,
        direction: DVec3,
        up: DVec3,
        view_angle: f64,
    ) -> Result<Camera, CameraError> {
        if !(bounds_lo.is_finite() && bounds_hi.is_finite()) {
            return Err(CameraError::NotFinite("bounds"));
        }
        // Halved before the sum and the difference, which could overflow.
        let (lo, hi) = (0.5 * bounds_lo, 0.5 * bounds_hi);
        let focal_point = lo + hi;
        let mut radius = length(hi - lo).max(length(focal_point) * SMALLEST_RELATIVE_RADIUS);
        if radius == 0.0 {
            radius = RADIUS_OF_A_POINT;
        }
        let direction = unit(direction).ok_or(CameraError::NoDirection)?;
        let distance = radius / (0.5 * view_angle.to_radians()).sin();
        let position = focal_point - distance * direction;
        let projection = Projection::Perspective { view_angle };
        let camera = Camera { position, focal_point, view_up: up, projection, near: 0.0 };
        camera.view(1, 1).map(|_| camera)
    }

    /// The default camera for a box: 30 degrees, from the front right and above, +Z up.
    ///
    /// # Errors
    /// If bounds are not finite or so large that distances overflow.
    pub fn default_for((bounds_lo, bounds_hi): (DVec3, DVec3)) -> Result<Camera, CameraError> {
        Self::frame(bounds_lo, bounds_hi, DEFAULT_DIRECTION, DVec3::Z, DEFAULT_VIEW_ANGLE)
    }

    /// The camera moved back (perspective) or zoomed out (parallel), so that a scene that fits the height of an image also fits the width
    /// of a narrow one; unchanged if the image is at least as wide as high.
    #[must_use]
    pub fn fit_to_aspect(&self, width_px: usize, height_px: usize) -> Camera {
        if width_px >= height_px || width_px == 0 {
            return *self;
        }
        let aspect = width_px as f64 / height_px as f64;
        let mut camera = *self;
        match &mut camera.projection {
            Projection::Parallel { scale } => *scale /= aspect,
            Projection::Perspective { view_angle } => {
                let half = 0.5 * view_angle.to_radians();
                let half_across = (half.tan() * aspect).atan();
                camera.position =
                    self.focal_point + (self.position - self.focal_point) * (half.sin() / half_across.sin());
            }
        }
        camera
    }

    /// The camera moved around its focal point like an object on a turntable: `azimuth_deg` around the up axis (the eye
    /// goes to its right), `elevation_deg` towards it. The elevation stops just before the poles; the distance stays.
    ///
    /// # Errors
    /// As [`Camera::view`], or if an angle is not finite.
    pub fn orbit(&self, azimuth_deg: f64, elevation_deg: f64) -> Result<Camera, CameraError> {
        if !(azimuth_deg.is_finite() && elevation_deg.is_finite()) {
            return Err(CameraError::NotFinite("orbit angle"));
        }
        let (forward, right) = self.forward_and_right()?;
        let image_up = right.cross(forward);
        // The axis is the camera's up where that is valid, else the up that the view substitutes.
        let axis = unit(self.view_up).filter(|up| up.dot(image_up) > 0.0 && up.cross(forward).length() > 1e-6);
        let axis = axis.unwrap_or(image_up);
        let ahead = axis.cross(right);
        let (sin_azimuth, cos_azimuth) = azimuth_deg.to_radians().sin_cos();
        let outwards = right * sin_azimuth - ahead * cos_azimuth;
        let limit = (90.0 - POLE_MARGIN).to_radians();
        let now = (-forward.dot(axis)).atan2(forward.dot(ahead));
        let (sin_elevation, cos_elevation) = (now + elevation_deg.to_radians()).clamp(-limit, limit).sin_cos();
        let distance = length(self.position - self.focal_point);
        let position = self.focal_point + (outwards * cos_elevation + axis * sin_elevation) * distance;
        Ok(Camera { position, view_up: axis, ..*self })
    }
}
