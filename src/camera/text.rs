//! The text form of a camera, as `--camera` takes it.

use super::{Camera, CameraError, Projection};
use crate::short::Short;
use glam::DVec3;
use std::fmt;

const PARTS: &str = "known parts are pos=x,y,z focal=x,y,z up=x,y,z angle=DEGREES parallel=SCALE near=DISTANCE";

impl Camera {
    /// Parses `pos=x,y,z focal=x,y,z up=x,y,z angle=30 near=0` (any order, `parallel=SCALE` in place of `angle`). Missing parts are taken
    /// from `default`.
    ///
    /// # Errors
    /// [`CameraError::BadText`] names the part that cannot be read; otherwise as [`Camera::view`].
    pub fn parse(text: &str, default: &Camera) -> Result<Camera, CameraError> {
        let mut camera = *default;
        let mut seen: Vec<&str> = Vec::new();
        for part in text.split_whitespace() {
            let (key, value) = part.split_once('=').ok_or_else(|| bad(part, format!("has no '='; {PARTS}")))?;
            // The two projections exclude each other, like repeated parts.
            let slot = if key == "parallel" { "angle" } else { key };
            if seen.contains(&slot) {
                return Err(bad(part, "the camera has this part already"));
            }
            seen.push(slot);
            match key {
                "pos" => camera.position = vector(part, value)?,
                "focal" => camera.focal_point = vector(part, value)?,
                "up" => camera.view_up = vector(part, value)?,
                "angle" => camera.projection = Projection::Perspective { view_angle: number(part, value)? },
                "parallel" => camera.projection = Projection::Parallel { scale: number(part, value)? },
                "near" => camera.near = number(part, value)?,
                _ => return Err(bad(part, PARTS)),
            }
        }
        camera.view(1, 1).map(|_| camera)
    }
}

impl fmt::Display for Camera {
    /// Writes all parts; [`Camera::parse`] gives the same camera back, bit for bit.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, v) in [("pos", self.position), ("focal", self.focal_point), ("up", self.view_up)] {
            write!(f, "{name}={},{},{} ", Short(v.x), Short(v.y), Short(v.z))?;
        }
        match self.projection {
            Projection::Perspective { view_angle } => write!(f, "angle={}", Short(view_angle))?,
            Projection::Parallel { scale } => write!(f, "parallel={}", Short(scale))?,
        }
        write!(f, " near={}", Short(self.near))
    }
}

fn bad(part: &str, problem: impl Into<String>) -> CameraError {
    CameraError::BadText { part: part.to_owned(), problem: problem.into() }
}

fn number(part: &str, value: &str) -> Result<f64, CameraError> {
    let number: f64 = value.trim().parse().map_err(|_| bad(part, format!("'{value}' is not a number")))?;
    if number.is_finite() { Ok(number) } else { Err(bad(part, format!("'{value}' is not finite"))) }
}

fn vector(part: &str, value: &str) -> Result<DVec3, CameraError> {
    let parts: Vec<&str> = value.split(',').collect();
    let [x, y, z] = parts[..] else {
        return Err(bad(part, format!("{} numbers instead of three, as in 1,0.5,-2", parts.len())));
    };
    Ok(DVec3::new(number(part, x)?, number(part, y)?, number(part, z)?))
}
