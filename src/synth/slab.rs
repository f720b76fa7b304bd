//! A slab with closed-form images: a constant and a linear field between two parallel planes.

use super::kuhn::Domain;
use super::{Model, point_field};
use crate::field::FieldInfo;
use glam::DVec3;

/// Half the size of the slab along x and y; only has to exceed the view.
pub const HALF_WIDTH: f64 = 1.0;
/// Thickness of the slab, along z; centred on the origin.
pub const THICKNESS: f64 = 1.0;
/// Value of the field `constant` everywhere and always.
pub const CONSTANT: f64 = 0.5;

/// Value of the field `linear`: the depth below the upper face as a fraction of the thickness, times 1 + t.
///
/// A ray through the whole slab at angle a to the z axis has the integral `THICKNESS * (1 + t) / (2 cos a)`, and from above the value rises
/// linearly from 0 to 1 + t.
pub fn linear(z: f64, time: f64) -> f64 {
    (0.5 - z / THICKNESS) * (1.0 + time)
}

/// The slab.
pub struct Slab;

impl Model for Slab {
    fn domain(&self) -> Domain {
        let half = DVec3::new(HALF_WIDTH, HALF_WIDTH, THICKNESS / 2.0);
        Domain::full(-half, half)
    }

    fn fields(&self) -> Vec<FieldInfo> {
        vec![point_field("constant", 1), point_field("linear", 1)]
    }

    /// Seconds from 0 to 1, closer together at first.
    fn time(&self, part: f64) -> f64 {
        part * (0.75 + 0.25 * part)
    }

    fn at(&self, field: usize, time: f64) -> Box<dyn Fn(DVec3) -> [f64; 3] + Sync + '_> {
        match field {
            0 => Box::new(|_| [CONSTANT, 0.0, 0.0]),
            _ => Box::new(move |p| [linear(p.z, time), 0.0, 0.0]),
        }
    }
}
