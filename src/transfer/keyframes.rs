//! Range maps between keys of a timeline (dissertation 7.4). Ensembles are blended by their curves ([`Curve::mix`](super::Curve::mix)).

use super::range_map::RangeMap;
use crate::timeline::{At, Keyframed};

impl Keyframed<RangeMap> {
    /// The map at a time: [`RangeMap::mix`] between two keys. `None` without keys.
    pub fn map(&self, time: f64) -> Option<RangeMap> {
        Some(match self.at(time)? {
            At::One(map) => map.clone(),
            At::Between { a, b, weight } => RangeMap::mix(a, b, weight),
        })
    }
}

#[cfg(test)]
#[path = "keyframes_tests.rs"]
mod tests;
