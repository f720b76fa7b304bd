//! Planes that cut meshes.

use crate::mesh::Positions;
use crate::short::Short;
use glam::DVec3;
use rayon::prelude::*;
use std::fmt;
use std::str::FromStr;

/// A plane: a point in it and its normal, in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    point: DVec3,
    /// Of length 1.
    normal: DVec3,
}

/// Why there is no such plane.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}; write point=x,y,z normal=x,y,z")]
pub struct PlaneError(String);

impl Plane {
    /// The plane through a point across a normal of any length.
    ///
    /// # Errors
    /// If a number is not finite, or the normal is zero.
    pub fn new(point: DVec3, normal: DVec3) -> Result<Self, PlaneError> {
        if !(point.is_finite() && normal.is_finite()) {
            return Err(PlaneError("a plane has finite numbers".to_owned()));
        }
        if normal == DVec3::ZERO {
            return Err(PlaneError("the normal of a plane is not 0,0,0".to_owned()));
        }
        // Neither squares nor quotients leave the range of f64.
        let normal = normal / normal.abs().max_element();
        Ok(Self { point, normal: normal.normalize() })
    }

    /// How far each of `points` lies on the side to which the normal points, below 0 on the other side. The unit of length is twice the
    /// scale of `positions`, the frame of the points: no number is too large as long as the plane is anywhere near.
    pub fn distances(&self, points: &[DVec3], positions: &Positions) -> Vec<f64> {
        // Differences come first, so that a mesh far from the origin keeps its digits. They are those of halves: the whole may exceed
        // the largest number.
        let distance = |p: &DVec3| ((0.5 * p - 0.5 * self.point) / positions.scale).dot(self.normal);
        points.par_iter().map(distance).collect()
    }
}

impl FromStr for Plane {
    type Err = PlaneError;

    fn from_str(text: &str) -> Result<Self, PlaneError> {
        let mut parts: [Option<DVec3>; 2] = [None; 2];
        for part in text.split_whitespace() {
            let Some((key, value)) = part.split_once('=') else {
                return Err(PlaneError(format!("'{part}' has no '='")));
            };
            let Some(slot) = ["point", "normal"].iter().position(|name| *name == key) else {
                return Err(PlaneError(format!("a plane has no {key}")));
            };
            let numbers: Option<Vec<f64>> = value.split(',').map(|number| number.trim().parse().ok()).collect();
            let Some(numbers) = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok()) else {
                return Err(PlaneError(format!("'{value}' is not three numbers")));
            };
            if parts[slot].replace(DVec3::from_array(numbers)).is_some() {
                return Err(PlaneError(format!("the plane has a {key} already")));
            }
        }
        match parts {
            [Some(point), Some(normal)] => Self::new(point, normal),
            [None, _] => Err(PlaneError("the plane has no point".to_owned())),
            [_, None] => Err(PlaneError("the plane has no normal".to_owned())),
        }
    }
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [p, n] = [self.point, self.normal];
        let text = |v: DVec3| format!("{},{},{}", Short(v.x), Short(v.y), Short(v.z));
        write!(f, "point={} normal={}", text(p), text(n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_read_from_text() {
        let plane: Plane = " point=1,2,-3e9  normal=0,0,-1e-300".parse().unwrap();
        assert_eq!(plane, Plane { point: DVec3::new(1.0, 2.0, -3e9), normal: -DVec3::Z });
        let scaled: Plane = "normal=0,3e300,4e300 point=0,0,0".parse().unwrap();
        assert!((scaled.normal - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15);
        for (text, part) in [
            ("", "no point"),
            ("point=0,0,0", "no normal"),
            ("normal=0,0,1", "no point"),
            ("point=0,0,0 normal=0,0,0", "not 0,0,0"),
            ("point=0,0,0 normal=0,0,nan", "finite"),
            ("point=inf,0,0 normal=0,0,1", "finite"),
            ("point=0,0 normal=0,0,1", "'0,0' is not three numbers"),
            ("point=0,0,x normal=0,0,1", "three numbers"),
            ("point=0,0,0 normal=0,0,1 normal=0,1,0", "already"),
            ("point=0,0,0 up=0,0,1", "no up"),
            ("0,0,0", "no '='"),
        ] {
            let error = text.parse::<Plane>().unwrap_err().to_string();
            assert!(error.contains(part) && error.ends_with("normal=x,y,z"), "{text}: {error}");
        }
    }

    #[test]
    fn distances_keep_the_digits_of_meshes_far_away() {
        let offset = DVec3::splat(1e9);
        let points = [DVec3::ZERO, DVec3::X, DVec3::new(0.25, 7.0, 0.0)].map(|p| p + offset);
        let positions = Positions { origin: offset, scale: 8.0, local: Vec::new() };
        let plane = Plane::new(offset + 0.5 * DVec3::X, 2.0 * DVec3::X).unwrap();
        assert_eq!(plane.distances(&points, &positions), [-0.5, 0.5, -0.25].map(|d| d / 16.0));
    }
}
