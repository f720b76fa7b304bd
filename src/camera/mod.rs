//! Cameras with VTK's fields, and the view-space ray of each pixel.
//!
//! World: right-handed, +Z up. View: x right, y up, w forward (depth along the viewing direction); the eye is the origin.

mod framing;
mod lattice;
mod motion;
mod path;
mod samples;
mod text;
mod view;

pub use lattice::Lattice;
pub use motion::Axis;
pub use samples::{PixelSet, PixelSetError, Samples};
pub use view::View;
pub(crate) use view::check_size;

use crate::short::Short;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Projection of a camera.
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
///
/// As text (`--camera`): `pos=x,y,z focal=x,y,z up=x,y,z angle=30 near=0`, or `parallel=SCALE` in place of `angle`; see
/// [`Camera::parse`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// The eye.
    pub position: DVec3,
    /// The point that the camera looks at.
    pub focal_point: DVec3,
    /// Up; need not be orthogonal to the viewing direction.
    pub view_up: DVec3,
    /// Perspective or parallel.
    pub projection: Projection,
    /// Near distance: nothing nearer to the eye is drawn (world units along the viewing direction; perspective only).
    pub near: f64,
}

/// Why a camera has no view, or its text cannot be parsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// A field is NaN, infinite, or so large that distances overflow.
    #[error("camera {0} is not finite")]
    NotFinite(&'static str),
    /// Position and focal point coincide.
    #[error("camera position and focal point coincide; move one of them")]
    NoDirection,
    /// The view angle is outside (0, 180) degrees.
    #[error("view angle {} is outside 0..180 degrees; 30 is usual", Short(.0))]
    BadAngle(f64),
    /// The parallel scale is not positive.
    #[error("parallel scale {} is not positive; half the height of what is seen is one", Short(.0))]
    BadScale(f64),
    /// The near distance is negative.
    #[error("near distance {} is negative; 0 leaves nothing out", Short(.0))]
    BadNear(f64),
    /// The image has no pixels.
    #[error("an image of {0} x {1} pixels has no pixels")]
    NoPixels(usize, usize),
    /// The image has more pixels than u32 can number.
    #[error("an image of {0} x {1} pixels is too large: {max} pixels are the most", max = u32::MAX)]
    TooManyPixels(usize, usize),
    /// A part of the camera's text cannot be read.
    #[error("camera '{part}': {problem}")]
    BadText {
        /// The invalid part.
        part: String,
        /// What is wrong with it, and a valid form.
        problem: String,
    },
}

/// `v` at length 1, also where the square of its length under- or overflows; `None` for zero and non-finite vectors.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && v.is_finite()).then(|| (v / largest).normalize())
}

/// Length of `v`, also where its square under- or overflows.
fn length(v: DVec3) -> f64 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).length() * largest } else { largest }
}

#[cfg(test)]
mod tests;
