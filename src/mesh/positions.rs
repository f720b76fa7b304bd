//! Vertex coordinates, local to an f64 origin and a power-of-two scale.

use glam::{DVec3, Vec3};

use super::MeshError;

/// Vertex coordinates: `world = origin + scale * local`, right-handed, in the file's units.
///
/// The local box lies within [-1, 1]^3 whatever the offset and size of the mesh in the world, so the 24 bits of f32 resolve the mesh and
/// not its offset. The scale is a power of two: multiplying by it is exact.
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
    /// Positions from stored arrays.
    ///
    /// # Errors
    /// If the origin or a coordinate is not finite, a coordinate lies outside [-1, 1], or the scale is not a positive
    /// power of two.
    pub fn from_parts(origin: DVec3, scale: f64, local: Vec<Vec3>) -> Result<Self, MeshError> {
        let is_power_of_two = scale.is_finite() && scale > 0.0 && power_of_two_at_least(scale) == scale;
        if !(origin.is_finite() && is_power_of_two) {
            return Err(MeshError::BadFrame { origin, scale });
        }
        // NaN fails this comparison too.
        if let Some(vertex) = local.iter().position(|p| !p.abs().cmple(Vec3::ONE).all()) {
            return Err(MeshError::bad_entry("points", vertex, format!("{} is not within -1..1", local[vertex])));
        }
        Ok(Self { origin, scale, local })
    }

    /// World coordinates of a vertex.
    pub fn world(&self, vertex: usize) -> DVec3 {
        self.origin + self.scale * self.local[vertex].as_dvec3()
    }

    /// Local coordinates of a point in the world.
    pub fn local_from_world(&self, world: DVec3) -> DVec3 {
        (world - self.origin) / self.scale
    }

    /// Local coordinates of the four vertices of a cell.
    pub fn corners(&self, tet: [u32; 4]) -> [Vec3; 4] {
        tet.map(|v| self.local[v as usize])
    }

    /// Corners of the axis-aligned bounding box in world coordinates; both are the origin for an empty mesh.
    pub fn world_bounds(&self) -> (DVec3, DVec3) {
        let mut corners = self.local.iter();
        let Some(&first) = corners.next() else { return (self.origin, self.origin) };
        let (lo, hi) = corners.fold((first, first), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        (self.origin + self.scale * lo.as_dvec3(), self.origin + self.scale * hi.as_dvec3())
    }
}

/// Origin and scale of a mesh before its [`Positions`] are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LocalFrame {
    /// World coordinates of the local origin.
    pub origin: DVec3,
    /// World length of a local unit; a power of two.
    pub scale: f64,
}

impl LocalFrame {
    /// The frame whose origin is the centre of the box from `lo` to `hi` (both finite), with the smallest scale that
    /// puts the box within [-1, 1]^3; 1 for a box without extent.
    ///
    /// # Errors
    /// If that scale exceeds the largest power of two, 2^1023.
    pub fn around(lo: DVec3, hi: DVec3) -> Result<Self, MeshError> {
        // Halved before the sum: neither hi - lo nor hi + lo need be finite.
        let origin = 0.5 * lo + 0.5 * hi;
        // Rounding is monotonic, so no point of the box gets further from the origin than this, computed the same way.
        let half_extent = (hi - origin).max(origin - lo).max_element();
        let scale = if half_extent > 0.0 { power_of_two_at_least(half_extent) } else { 1.0 };
        if scale.is_finite() { Ok(Self { origin, scale }) } else { Err(MeshError::TooLarge(half_extent)) }
    }

    /// Local coordinates of a world point, rounded to f32. Zeros are positive, so that equal positions have equal bits.
    pub fn local(&self, world: DVec3) -> Vec3 {
        // Divided: the reciprocal of a scale below 2^-1023 would not be finite.
        ((world - self.origin) / self.scale).as_vec3() + Vec3::ZERO
    }
}

/// The smallest power of two that is at least `x` (positive, finite); infinite beyond 2^1023.
fn power_of_two_at_least(x: f64) -> f64 {
    const MANTISSA_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    let bits = x.to_bits();
    if x < f64::MIN_POSITIVE {
        // Subnormal numbers are multiples of 2^-1074, counted by their bits.
        return f64::from_bits(bits.next_power_of_two());
    }
    let exponent = bits >> MANTISSA_BITS;
    let has_mantissa = bits & ((1 << MANTISSA_BITS) - 1) != 0;
    f64::from_bits((exponent + u64::from(has_mantissa)) << MANTISSA_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_the_smallest_power_of_two_that_is_enough() {
        for (x, expected) in [
            (1.0, 1.0),
            (1.0 + f64::EPSILON, 2.0),
            (0.75, 1.0),
            (3.0, 4.0),
            (f64::MIN_POSITIVE, f64::MIN_POSITIVE),
            (f64::MIN_POSITIVE.next_down(), f64::MIN_POSITIVE),
            (5e-324, 5e-324),
            (1.5e-323, 2e-323),
            (2f64.powi(1023), 2f64.powi(1023)),
            (f64::MAX, f64::INFINITY),
        ] {
            assert_eq!(power_of_two_at_least(x), expected, "{x:e}");
        }
    }

    #[test]
    fn a_box_fills_at_least_half_of_the_local_cube_at_every_size_and_offset() {
        for (lo, size) in [(0.0, 1.0), (1e9, 1.0), (-1e300, 2e300), (1e-300, 3e-300), (0.0, 1e-320), (-8e307, 1.7e308)]
        {
            let (lo, hi) = (DVec3::splat(lo), DVec3::new(lo + size, lo + 0.5 * size, lo));
            let frame = LocalFrame::around(lo, hi).unwrap();
            let ends = [frame.local(lo), frame.local(hi)];
            assert!(ends.iter().all(|p| p.abs().max_element() <= 1.0), "{lo} {hi}: {ends:?}");
            assert!(ends[1].x > 0.5, "{lo} {hi}: {ends:?}");
        }
    }

    #[test]
    fn an_extent_that_no_power_of_two_covers_is_an_error() {
        let result = LocalFrame::around(DVec3::splat(f64::MIN), DVec3::splat(f64::MAX));
        assert_eq!(result, Err(MeshError::TooLarge(f64::MAX)));
    }

    #[test]
    fn a_box_without_extent_has_scale_one() {
        let p = DVec3::new(1e9, -3.0, 0.0);
        assert_eq!(LocalFrame::around(p, p), Ok(LocalFrame { origin: p, scale: 1.0 }));
    }

    #[test]
    fn zeros_are_positive() {
        let frame = LocalFrame { origin: DVec3::ZERO, scale: 1.0 };
        assert_eq!(frame.local(DVec3::splat(-1e-60)).to_array().map(f32::to_bits), [0; 3]);
    }

    #[test]
    fn stored_positions_are_checked() {
        let local = vec![Vec3::ZERO, Vec3::ONE];
        assert!(Positions::from_parts(DVec3::ONE, 0.25, local.clone()).is_ok());
        for scale in [0.3, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Positions::from_parts(DVec3::ONE, scale, local.clone()).is_err(), "{scale}");
        }
        assert!(Positions::from_parts(DVec3::new(0.0, f64::NAN, 0.0), 1.0, local).is_err());
        for bad in [f32::NAN, f32::INFINITY, 1.0f32.next_up()] {
            let error =
                Positions::from_parts(DVec3::ZERO, 1.0, vec![Vec3::ZERO, Vec3::new(0.0, 0.0, bad)]).unwrap_err();
            assert!(matches!(error, MeshError::BadEntry { array: "points", entry: 1, .. }), "{error}");
        }
    }

    #[test]
    fn local_and_world_coordinates_are_inverse() {
        let positions =
            Positions::from_parts(DVec3::new(1e9, 2.0, -3.0), 4.0, vec![Vec3::new(0.5, -1.0, 0.25)]).unwrap();
        assert_eq!(positions.local_from_world(positions.world(0)), positions.local[0].as_dvec3());
    }
}
