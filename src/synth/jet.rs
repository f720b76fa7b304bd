//! A starting turbulent jet: dye that enters calm surroundings through a round nozzle, rolls up into rings, breaks into
//! eddies and ends in a sharp front with a mushroom head, which crosses the domain and leaves it.
//!
//! The flow is not solved. Every value is traced back through three displacements, each a smooth function of position and time, to a plain
//! round jet with a front:
//!
//! 1. **eddies**: gradient noise of three scales, each advected at its own speed, growing with the jet's width,
//! 2. **rings**: vortices of the shear layer, shed at intervals and advected; each turns its surroundings in the
//!    (x, r) half-plane by an angle that grows with its age, which rolls up the dye's edge,
//! 3. **head**: the starting vortex behind the front, in the same way.
//!
//! Dye is exactly 0 away from the jet.

use super::kuhn::Domain;
use super::noise::vector_noise;
use super::{Model, point_field};
use crate::field::FieldInfo;
use crate::random::{hash, unit};
use glam::{DVec2, DVec3, Vec3Swizzles as _};

/// Length and half width of the domain in nozzle diameters; the jet runs along x.
const LENGTH: f64 = 8.0;
const HALF_WIDTH: f64 = 2.0;
/// Time at the last step, in nozzle diameters over advection speed; the front leaves the domain at three quarters of it.
const DURATION: f64 = 24.0;
/// Seconds between two rings.
const SHEDDING: f64 = 1.1;
/// Time in which a ring forms.
const RING_GROWTH: f64 = 2.5;
/// Angle in radians by which a grown ring has turned its core.
const RING_TURN: f64 = 2.9;
/// Angle in radians by which the head has turned its core.
const HEAD_TURN: f64 = 3.4;
/// Thickness of the front.
const FRONT: f64 = 0.08;
/// The eddies: size, share of the jet's half width by which they displace, speed.
const EDDIES: [(f64, f64, DVec3); 3] = [
    (1.3, 0.55, DVec3::new(0.85, 0.10, -0.07)),
    (0.65, 0.26, DVec3::new(0.95, -0.12, 0.10)),
    (0.34, 0.11, DVec3::new(1.05, 0.08, 0.14)),
];

/// The jet.
pub struct Jet {
    seed: u64,
}

/// One vortex ring at one time.
#[derive(Clone, Copy, Debug)]
struct Ring {
    /// Core in the (x, r) half-plane.
    core: DVec2,
    /// Slope of the ring's plane against y and z.
    tilt: DVec2,
    /// Radius within which it turns the fluid.
    size: f64,
    /// Angle by which its core has turned.
    turn: f64,
}

/// Half width of the jet.
fn half_width(x: f64) -> f64 {
    0.45 + 0.085 * x.max(0.0)
}

/// Position of the front along x.
fn front(time: f64) -> f64 {
    4.0 * ((1.0 + 0.47 * time).sqrt() - 1.0)
}

/// 0 below `lo`, 1 above `hi`, smooth (C1) between.
fn smooth_step(lo: f64, hi: f64, x: f64) -> f64 {
    let t = ((x - lo) / (hi - lo)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl Ring {
    /// Offset from the core in the (x, r) half-plane, and the share of the core's turn there.
    fn offset(&self, p: DVec3) -> (DVec2, f64) {
        let lean = self.tilt.dot(p.yz());
        let d = DVec2::new(p.x - lean, p.yz().length()) - self.core;
        (d, (-d.length_squared() / (self.size * self.size)).exp())
    }

    /// Position of the fluid at `p` before the ring turned it.
    fn undo(&self, p: DVec3) -> DVec3 {
        let (d, share) = self.offset(p);
        let from = DVec2::from_angle(-self.turn * share).rotate(d);
        let r = p.yz().length();
        // On the axis there is no radial direction, and by symmetry no radial displacement.
        let radial = if r > 0.0 { (self.core.y + from.y) / r } else { 1.0 };
        DVec3::new(p.x + from.x - d.x, p.y * radial, p.z * radial)
    }
}

impl Jet {
    /// The jet with the rings and eddies of `seed`.
    pub fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// The rings behind the front and the head itself, in a fixed order.
    fn rings(&self, time: f64) -> Vec<Ring> {
        let head = front(time);
        // A ring may come up to 0.3 intervals early.
        let shed = (0..=(time / SHEDDING) as u64 + 1).filter_map(|n| {
            let random = |k: u64| 2.0 * unit(hash(self.seed, 4 * n + k)) - 1.0;
            let age = time - SHEDDING * (n as f64 + 0.3 * random(0));
            let x = 0.3 + 0.8 * age;
            let fade = smooth_step(0.2, 1.0, head - x) * (1.0 - smooth_step(4.0, LENGTH, x));
            (age > 0.0 && fade > 0.0).then(|| Ring {
                core: DVec2::new(x, 0.95 * half_width(x)),
                tilt: 0.35 * smooth_step(0.0, 4.0, age) * DVec2::new(random(1), random(2)),
                size: 0.30 + 0.05 * x,
                turn: RING_TURN * fade * (1.0 + 0.3 * random(3)) * smooth_step(0.0, RING_GROWTH, age),
            })
        });
        let width = half_width(head);
        let head = Ring {
            core: DVec2::new(head - 0.7 * width, 0.95 * width),
            tilt: DVec2::ZERO,
            size: 0.6 * width,
            turn: HEAD_TURN * smooth_step(0.0, 4.0, time),
        };
        shed.chain([head]).collect()
    }

    /// Displacement of the fluid by the eddies.
    fn eddies(&self, p: DVec3, time: f64) -> DVec3 {
        let amount = half_width(p.x) * smooth_step(0.2, 4.5, p.x);
        let displacement = |(k, &(size, share, speed)): (u64, &(f64, f64, DVec3))| {
            share * vector_noise(hash(self.seed, k), (p - speed * time) / size)
        };
        amount * (0u64..).zip(&EDDIES).map(displacement).sum::<DVec3>()
    }

    /// Dye at `p`.
    fn dye(&self, p: DVec3, time: f64, rings: &[Ring]) -> f64 {
        // Most of the domain is beyond the reach of the jet and its displacements.
        if p.yz().length() > 2.6 * half_width(p.x) || p.x > front(time) + 1.5 {
            return 0.0;
        }
        let mut from = p + self.eddies(p, time);
        for ring in rings.iter().rev() {
            from = ring.undo(from);
        }
        let x = from.x;
        let head = front(time);
        let bulge = 1.0 + 0.15 * (-((x - head + 0.5) / 0.6).powi(2)).exp();
        let rho = from.yz().length() / (half_width(x) * bulge);
        let edge = 1.0 - smooth_step(0.7, 1.15, rho);
        let behind = 1.0 - smooth_step(-FRONT, FRONT, x - head + 0.5 * half_width(head) * rho * rho);
        let mixed = 1.0 / (1.0 + (x.max(0.0) / 9.0).powi(2)).sqrt();
        let streaks = vector_noise(hash(self.seed, 100), (from - DVec3::X * time) * 2.2).x;
        let unmixed = 1.0 + 0.7 * smooth_step(0.5, 4.0, x) * streaks;
        0.85 * edge * behind * mixed * unmixed * (1.0 - 0.25 * rho.min(1.0).powi(2))
    }

    /// Velocity at `p`: the mean jet, the rotation of the rings, and the eddies.
    fn velocity(&self, p: DVec3, time: f64, rings: &[Ring]) -> DVec3 {
        let width = half_width(p.x);
        let rho2 = p.yz().length_squared() / (width * width);
        let jet = (-rho2).exp() * (1.0 - smooth_step(-0.6, 0.6, p.x - front(time)));
        let mean = 1.6 * half_width(0.0) / width * jet;
        let around = rings.iter().map(|ring| {
            let (d, share) = ring.offset(p);
            let turning = ring.turn / RING_GROWTH * share * d.perp();
            let radial = p.yz().try_normalize().unwrap_or(DVec2::ZERO) * turning.y;
            DVec3::new(turning.x, radial.x, radial.y)
        });
        let (size, _, speed) = EDDIES[1];
        let eddies =
            0.5 * jet * smooth_step(0.2, 4.5, p.x) * vector_noise(hash(self.seed, 101), (p - speed * time) / size);
        DVec3::X * mean + around.sum::<DVec3>() + eddies
    }
}

impl Model for Jet {
    fn domain(&self) -> Domain {
        Domain::full(DVec3::new(0.0, -HALF_WIDTH, -HALF_WIDTH), DVec3::new(LENGTH, HALF_WIDTH, HALF_WIDTH))
    }

    fn fields(&self) -> Vec<FieldInfo> {
        vec![point_field("dye", 1), point_field("velocity", 3)]
    }

    /// Steps that grow as the front slows down, as those of a solver do.
    fn time(&self, part: f64) -> f64 {
        DURATION * part * (0.8 + 0.2 * part)
    }

    fn at(&self, field: usize, time: f64) -> Box<dyn Fn(DVec3) -> [f64; 3] + Sync + '_> {
        let rings = self.rings(time);
        match field {
            0 => Box::new(move |p| [self.dye(p, time, &rings), 0.0, 0.0]),
            _ => Box::new(move |p| self.velocity(p, time, &rings).to_array()),
        }
    }
}
