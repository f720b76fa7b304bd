//! Planes in the local frame of a mesh.

use super::Positions;
use glam::DVec3;

/// A plane in the local coordinates of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: DVec3,
    /// Distance of the plane from the local origin along the normal.
    pub offset: f64,
}

impl Plane {
    /// The plane through a point with this normal of any nonzero length, both in world coordinates; `None` if the normal has no direction.
    pub fn new(positions: &Positions, point: DVec3, normal: DVec3) -> Option<Self> {
        // Squares of very long and very short vectors overflow or underflow.
        let normal = (normal / normal.abs().max_element()).try_normalize()?;
        let offset = normal.dot((point - positions.origin) / positions.scale);
        offset.is_finite().then_some(Self { normal, offset })
    }

    /// Signed distance of a point (local coordinates), positive on the side that the normal points to.
    #[inline(always)]
    pub fn distance(&self, local: DVec3) -> f64 {
        self.normal.dot(local) - self.offset
    }
}
