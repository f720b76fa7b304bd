//! Cameras: VTK's fields, and the view-space ray of each pixel.
//!
//! World: right-handed, +Z up. View: x right, y up, w forward (depth along the viewing direction); the eye is the origin.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How the image plane sees the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// Rays meet in the eye; `view_angle` is the full vertical angle in degrees, in (0, 180).
    Perspective {
        /// Full vertical angle in degrees.
        view_angle: f64,
    },
    /// Rays are parallel and start before the bounds; `scale` is half the height of the view in world units.
    Parallel {
        /// Half the height of the view in world units.
        scale: f64,
    },
}

/// A camera with the fields of VTK's (`vtkCamera`), world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// The eye.
    pub position: DVec3,
    /// The point looked at.
    pub focal_point: DVec3,
    /// Up; need not be orthogonal to the viewing direction.
    pub view_up: DVec3,
    /// Perspective or parallel.
    pub projection: Projection,
    /// Nothing nearer to the eye than this is drawn (world units along the viewing direction; perspective only).
    pub near: f64,
}

/// An orthonormal view frame and the image plane of a given size in pixels.
///
/// The ray of image-plane point (px, py) is, in view coordinates, `(px * w, py * w, w)` (perspective) or `(px, py, w)`
/// (parallel) over depth w; a step dw in depth is a length of [`View::length_per_depth`] * dw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The eye, world.
    pub eye: DVec3,
    /// Unit vector to the right, world.
    pub right: DVec3,
    /// Unit vector upwards in the image, world.
    pub up: DVec3,
    /// Unit vector of the viewing direction, world.
    pub forward: DVec3,
    /// Whether rays meet in the eye.
    pub perspective: bool,
    /// Near distance, world; negative infinity for parallel projection.
    pub near: f64,
    /// Half width of the image plane: at depth 1 (perspective) or in world units (parallel).
    pub half_width: f64,
    /// Half height, as `half_width`.
    pub half_height: f64,
    /// Pixels per row.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
}
