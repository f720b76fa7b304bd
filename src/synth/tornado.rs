//! A wandering tornado, similar to the procedural one of R. Crawfis and N. Max for their textured splats (Visualization 1993): a funnel
//! about a core line that sways with time and height.
//!
//! The swirl is a Kaufmann (Scully) vortex in every horizontal plane, so that the balancing pressure has a closed form; there is also an
//! inflow near the ground and an updraft in the core.

use super::kuhn::Domain;
use super::{Model, point_field};
use crate::field::FieldInfo;
use glam::{DVec2, DVec3, Vec3Swizzles as _};
use std::f64::consts::TAU;

/// Height of the domain, and its width, in hundreds of metres.
const SIZE: f64 = 10.0;
/// Circulation in (100 m)^2 per second.
const CIRCULATION: f64 = 8.0;
/// Density of the air, in units that make the pressure hectopascals: 1.2 kg/m^3 times (100 m/s)^2.
const DENSITY: f64 = 120.0;
/// Inflow: rate per second, and height of its layer in hundreds of metres.
const INFLOW: (f64, f64) = (0.4, 1.5);

/// The tornado.
pub struct Tornado;

/// Position of the core line at this height.
pub fn core(z: f64, time: f64) -> DVec2 {
    let h = z / SIZE;
    let sway = 0.3 + 1.2 * h;
    DVec2::new(1.5 * (0.11 * time).sin() + sway * (0.35 * time - 5.0 * h).sin(), sway * (0.27 * time - 3.0 * h).cos())
}

/// Core radius at this height: a funnel that narrows towards the ground.
pub fn radius(z: f64) -> f64 {
    let h = z / SIZE;
    0.35 + 0.25 * h + 1.1 * h * h
}

/// Pressure against the surroundings in hectopascals: balances the swirl, `dp/dr = density * v^2 / r`.
pub fn pressure(p: DVec3, time: f64) -> f64 {
    let (d, r) = (p.xy() - core(p.z, time), radius(p.z));
    let swirl = CIRCULATION / TAU;
    -0.5 * DENSITY * swirl * swirl / (d.length_squared() + r * r)
}

/// Wind in 100 m per second.
pub fn velocity(p: DVec3, time: f64) -> DVec3 {
    let (d, r) = (p.xy() - core(p.z, time), radius(p.z));
    let core_share = r * r / (d.length_squared() + r * r);
    let (rate, layer) = INFLOW;
    let near_ground = (-p.z / layer).exp();
    let swirl = CIRCULATION / TAU / (d.length_squared() + r * r) * d.perp();
    let horizontal = swirl - rate * core_share * near_ground * d;
    // The inflow at the ground goes up: for a straight core of constant radius the divergence is zero.
    let updraft = 2.0 * rate * layer * core_share * core_share * (1.0 - near_ground);
    horizontal.extend(updraft)
}

impl Model for Tornado {
    fn domain(&self) -> Domain {
        let half = SIZE / 2.0;
        Domain::full(DVec3::new(-half, -half, 0.0), DVec3::new(half, half, SIZE))
    }

    fn fields(&self) -> Vec<FieldInfo> {
        vec![point_field("pressure", 1), point_field("velocity", 3)]
    }

    /// One minute, with intervals that vary by a third, as in a weather model.
    fn time(&self, part: f64) -> f64 {
        60.0 * (part + (TAU * 3.0 * part).sin() / (TAU * 9.0))
    }

    fn at(&self, field: usize, time: f64) -> Box<dyn Fn(DVec3) -> [f64; 3] + Sync + '_> {
        match field {
            0 => Box::new(move |p| [pressure(p, time), 0.0, 0.0]),
            _ => Box::new(move |p| velocity(p, time).to_array()),
        }
    }
}
