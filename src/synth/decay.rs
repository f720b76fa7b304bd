//! Static Gaussians that fade linearly to zero, like the scalars of the SPX and Blunt Fin series in Callahan's dissertation (6.3.1), in a
//! box with a round cavity and a missing corner, so that the mesh is not convex.

use super::kuhn::Domain;
use super::{Model, point_field};
use crate::field::FieldInfo;
use crate::random::SplitMix64;
use glam::DVec3;
use std::f64::consts::PI;

/// Centre and radius of the cavity.
const CAVITY: (DVec3, f64) = (DVec3::new(-0.25, -0.25, -0.2), 0.45);
/// Number of Gaussians.
const BUMPS: usize = 24;
/// Time at which the field reaches zero, in seconds.
pub const DURATION: f64 = 12.8;

/// One Gaussian: `height * exp(-|p - centre|^2 / (2 sigma^2))`.
struct Bump {
    centre: DVec3,
    sigma: f64,
    height: f64,
}

/// The sum of Gaussians.
pub struct Decay {
    bumps: Vec<Bump>,
}

impl Decay {
    /// Places the Gaussians: positive heights, a few wide ones and many narrow ones.
    pub fn new(seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        let mut bump = |i: usize| Bump {
            centre: DVec3::from_array(std::array::from_fn(|_| random.between(-0.9, 0.9))),
            sigma: random.between(0.1, 0.2) * if i < 4 { 2.0 } else { 1.0 },
            height: random.between(0.3, 1.0),
        };
        Self { bumps: (0..BUMPS).map(&mut bump).collect() }
    }

    /// Value at time 0.
    pub fn initial(&self, p: DVec3) -> f64 {
        let value = |b: &Bump| b.height * (-0.5 * p.distance_squared(b.centre) / (b.sigma * b.sigma)).exp();
        self.bumps.iter().map(value).sum()
    }
}

impl Model for Decay {
    fn domain(&self) -> Domain {
        let cavity = 4.0 / 3.0 * PI * CAVITY.1.powi(3);
        Domain {
            lo: DVec3::splat(-1.0),
            hi: DVec3::splat(1.0),
            fraction: (8.0 - 1.0 - cavity) / 8.0,
            keep: |p| p.distance(CAVITY.0) > CAVITY.1 && p.min_element() < 0.0,
        }
    }

    fn fields(&self) -> Vec<FieldInfo> {
        vec![point_field("density", 1)]
    }

    /// Steps are denser at first, as usual for a decay.
    fn time(&self, part: f64) -> f64 {
        DURATION * part.powf(1.5)
    }

    fn at(&self, _field: usize, time: f64) -> Box<dyn Fn(DVec3) -> [f64; 3] + Sync + '_> {
        let left = 1.0 - time / DURATION;
        Box::new(move |p| [left * self.initial(p), 0.0, 0.0])
    }
}
