//! The potential of a rotating dipole in an ellipsoid the size of a torso, like the Torso series of Callahan's dissertation (6.3.1): 360
//! steps of one turn, two modes in time, of zero mean at every vertex.

use super::kuhn::Domain;
use super::{Model, point_field};
use crate::field::FieldInfo;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Half axes of the ellipsoid in metres: wide, deep, high.
const HALF_AXES: DVec3 = DVec3::new(0.18, 0.12, 0.28);
/// Position of the dipole in metres.
const SOURCE: DVec3 = DVec3::new(0.03, 0.02, 0.06);
/// Radius within which the potential is smoothed, in metres: half the distance between the poles of a real source.
const CORE: f64 = 0.015;
/// Strength in millivolt square metres.
const MOMENT: f64 = 0.01;
/// Time of one turn in seconds: a heart beat.
pub const PERIOD: f64 = 0.8;

/// The dipole.
pub struct Dipole;

/// The dipole's direction: it turns about an axis that is tilted by 0.6 from z.
fn moment(time: f64) -> DVec3 {
    let (sin, cos) = (TAU * time / PERIOD).sin_cos();
    let (sin_tilt, cos_tilt) = 0.6f64.sin_cos();
    MOMENT * DVec3::new(cos, sin * cos_tilt, sin * sin_tilt)
}

/// Potential in millivolts: that of a point dipole, smoothed within [`CORE`].
pub fn potential(p: DVec3, time: f64) -> f64 {
    let d = p - SOURCE;
    moment(time).dot(d) * (d.length_squared() + CORE * CORE).powf(-1.5)
}

impl Model for Dipole {
    fn domain(&self) -> Domain {
        Domain { lo: -HALF_AXES, hi: HALF_AXES, fraction: PI / 6.0, keep: |p| (p / HALF_AXES).length_squared() < 1.0 }
    }

    fn fields(&self) -> Vec<FieldInfo> {
        vec![point_field("potential", 1)]
    }

    /// Excludes the end of the turn, which equals its beginning: see [`Model::is_periodic`].
    fn time(&self, part: f64) -> f64 {
        PERIOD * part
    }

    fn is_periodic(&self) -> bool {
        true
    }

    fn at(&self, _field: usize, time: f64) -> Box<dyn Fn(DVec3) -> [f64; 3] + Sync + '_> {
        Box::new(move |p| [potential(p, time), 0.0, 0.0])
    }
}
