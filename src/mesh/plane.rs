//! Planes through a mesh.

use super::Positions;
use glam::DVec3;

/// A plane in the local coordinates of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Of length 1.
    pub normal: DVec3,
    /// Distance of the plane from the local origin along the normal.
    pub offset: f64,
}

impl Plane {
    /// The plane through a point with this normal, both in world coordinates, of any length but 0; `None` if there is none.
    pub fn new(positions: &Positions, point: DVec3, normal: DVec3) -> Option<Self> {
        // Squares of very long and very short vectors leave the range of numbers.
        let normal = (normal / normal.abs().max_element()).try_normalize()?;
        let offset = normal.dot((point - positions.origin) / positions.scale);
        offset.is_finite().then_some(Self { normal, offset })
    }

    /// How far a point (local coordinates) lies on the side that the normal points to; negative on the other one.
    #[inline(always)]
    pub fn distance(&self, local: DVec3) -> f64 {
        self.normal.dot(local) - self.offset
    }
}
