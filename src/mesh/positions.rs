//! Vertex coordinates, local to an f64 origin and a power-of-two scale.

use glam::{DVec3, Vec3};

/// Vertex coordinates: `world = origin + scale * local`, right-handed, in the file's units.
///
/// The local box lies within [-1, 1]^3 whatever the offset and size of the mesh in the world, so that f32 keeps 24 bits
/// of the mesh and not of its offset. The scale is a power of two: multiplying by it is exact.
#[derive(Clone, Debug, PartialEq)]
pub struct Positions {
    /// World coordinates of the local origin.
    pub origin: DVec3,
    /// World length of a local unit; a power of two.
    pub scale: f64,
    /// Local coordinates of the vertices.
    pub local: Vec<Vec3>,
}

impl Positions {
    /// World coordinates of a vertex.
    pub fn world(&self, vertex: usize) -> DVec3 {
        self.origin + self.scale * self.local[vertex].as_dvec3()
    }

    /// Corners of the axis-aligned bounding box in world coordinates; both are the origin for an empty mesh.
    pub fn world_bounds(&self) -> (DVec3, DVec3) {
        let mut corners = self.local.iter();
        let Some(&first) = corners.next() else { return (self.origin, self.origin) };
        let (lo, hi) = corners.fold((first, first), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        (self.origin + self.scale * lo.as_dvec3(), self.origin + self.scale * hi.as_dvec3())
    }
}
