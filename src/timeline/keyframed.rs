//! [`Keyframed`]: values at times.

use super::{TimelineError, Transition};
use serde::{Deserialize, Serialize};

/// A value at a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key<T> {
    /// Time, in the unit of the series; finite.
    pub time: f64,
    /// Interpolation to the value of the next key.
    #[serde(default)]
    pub transition: Transition,
    /// The value.
    pub value: T,
}

/// Values at distinct times, sorted. Before the first key and behind the last one their values continue.
///
/// Serialized as the list of its keys.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Key<T>>", into = "Vec<Key<T>>", bound(serialize = "T: Clone + Serialize"))]
pub struct Keyframed<T> {
    keys: Vec<Key<T>>,
}

/// Value of a [`Keyframed`] at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At<'a, T> {
    /// The value of one key.
    One(&'a T),
    /// A blend of two keys.
    Between {
        /// The value of the key before.
        a: &'a T,
        /// The value of the next key.
        b: &'a T,
        /// The weight of `b`, above 0 and below 1.
        weight: f64,
    },
}

impl<'a, T> At<'a, T> {
    /// The value that weighs more, of equal ones the first.
    pub fn nearer(self) -> &'a T {
        match self {
            Self::Between { b, weight, .. } if weight > 0.5 => b,
            Self::One(value) | Self::Between { a: value, .. } => value,
        }
    }
}

impl<T> Default for Keyframed<T> {
    fn default() -> Self {
        Self { keys: Vec::new() }
    }
}

impl<T> TryFrom<Vec<Key<T>>> for Keyframed<T> {
    type Error = TimelineError;

    fn try_from(keys: Vec<Key<T>>) -> Result<Self, TimelineError> {
        for key in &keys {
            check(key)?;
        }
        match keys.windows(2).find(|k| k[0].time >= k[1].time) {
            None => Ok(Self { keys }),
            Some(k) if k[0].time == k[1].time => Err(TimelineError::TimeTaken(k[1].time)),
            Some(k) => Err(TimelineError::NotSorted(k[1].time)),
        }
    }
}

impl<T> From<Keyframed<T>> for Vec<Key<T>> {
    fn from(keyframed: Keyframed<T>) -> Self {
        keyframed.keys
    }
}

fn check<T>(key: &Key<T>) -> Result<(), TimelineError> {
    if !key.time.is_finite() {
        return Err(TimelineError::BadTime(key.time));
    }
    key.transition.checked().map(|_| ())
}

/// The share of the interval from `a` to `b` (different times) that lies before `time`, between them.
fn share(a: f64, b: f64, time: f64) -> f64 {
    let whole = b - a;
    if whole.is_finite() {
        return (time - a) / whole;
    }
    // The difference of two finite times may overflow; times whose halves round to one number are not that far apart.
    (0.5 * time - 0.5 * a) / (0.5 * b - 0.5 * a)
}

impl<T> Keyframed<T> {
    /// The keys, sorted by time.
    pub fn keys(&self) -> &[Key<T>] {
        &self.keys
    }

    /// Mutable values of all keys; times cannot be changed.
    pub fn values_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.keys.iter_mut().map(|key| &mut key.value)
    }

    /// The value at a time; `None` without keys. Between two keys of equal values it is that value, so that nothing is computed.
    pub fn at(&self, time: f64) -> Option<At<'_, T>>
    where
        T: PartialEq,
    {
        let after = self.keys.partition_point(|k| k.time <= time);
        let (a, b) = match (after.checked_sub(1).and_then(|i| self.keys.get(i)), self.keys.get(after)) {
            (Some(a), Some(b)) => (a, b),
            (Some(end), None) | (None, Some(end)) => return Some(At::One(&end.value)),
            (None, None) => return None,
        };
        if a.value == b.value {
            return Some(At::One(&a.value));
        }
        let weight = a.transition.weight(share(a.time, b.time, time));
        Some(match weight {
            0.0 => At::One(&a.value),
            1.0 => At::One(&b.value),
            _ => At::Between { a: &a.value, b: &b.value, weight },
        })
    }

    /// Index of the key at exactly this time, or where one would be inserted.
    fn search(&self, time: f64) -> Result<usize, usize> {
        let at = self.keys.partition_point(|k| k.time < time);
        if self.keys.get(at).is_some_and(|k| k.time == time) { Ok(at) } else { Err(at) }
    }

    /// Adds a key, replacing the one at the same time, if any. Returns its index and the replaced key.
    ///
    /// # Errors
    /// If its time is not finite or its transition leaves the unit square.
    pub fn insert(&mut self, key: Key<T>) -> Result<(usize, Option<Key<T>>), TimelineError> {
        check(&key)?;
        match self.search(key.time) {
            Err(at) => {
                self.keys.insert(at, key);
                Ok((at, None))
            }
            Ok(at) => {
                let replaced = self.keys.get_mut(at).map(|old| std::mem::replace(old, key));
                Ok((at, replaced))
            }
        }
    }

    /// Removes a key; `None` if there is none of that index.
    pub fn remove(&mut self, index: usize) -> Option<Key<T>> {
        (index < self.keys.len()).then(|| self.keys.remove(index))
    }

    /// Moves a key to another time, past others if need be; returns its new index.
    ///
    /// # Errors
    /// If there is no such key, the time is not finite, or another key is there. Nothing has then changed.
    pub fn move_to(&mut self, index: usize, time: f64) -> Result<usize, TimelineError> {
        if !time.is_finite() {
            return Err(TimelineError::BadTime(time));
        }
        match self.search(time) {
            Ok(at) if at != index => return Err(TimelineError::TimeTaken(time)),
            _ => {}
        }
        let mut key = self.remove(index).ok_or(TimelineError::NoKey(index))?;
        key.time = time;
        let at = self.keys.partition_point(|k| k.time < time);
        self.keys.insert(at, key);
        Ok(at)
    }
}

impl Keyframed<f64> {
    /// The number at a time, linear in the weight between two keys; `None` without keys.
    pub fn number(&self, time: f64) -> Option<f64> {
        Some(match self.at(time)? {
            At::One(number) => *number,
            At::Between { a, b, weight } => a * (1.0 - weight) + b * weight,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(time: f64, value: i32) -> Key<i32> {
        Key { time, transition: Transition::Linear, value }
    }

    fn three() -> Keyframed<i32> {
        vec![key(0.0, 10), key(1.0, 20), key(4.0, 30)].try_into().unwrap()
    }

    #[test]
    fn keys_hold_before_the_first_at_each_and_behind_the_last() {
        let keys = three();
        for (time, value) in
            [(f64::NEG_INFINITY, 10), (-1.0, 10), (0.0, 10), (1.0, 20), (4.0, 30), (9.0, 30), (f64::INFINITY, 30)]
        {
            assert_eq!(keys.at(time), Some(At::One(&value)), "{time}");
        }
        assert_eq!(keys.at(1.75), Some(At::Between { a: &20, b: &30, weight: 0.25 }));
        assert_eq!(keys.at(f64::NAN), Some(At::One(&10)));
        assert_eq!(Keyframed::<i32>::default().at(0.0), None);
    }

    #[test]
    fn a_step_has_only_one_value_at_any_time() {
        let mut keys = three();
        keys.insert(Key { time: 1.0, transition: Transition::Step { at: 0.5 }, value: 20 }).unwrap();
        assert_eq!(keys.at(2.4), Some(At::One(&20)));
        assert_eq!(keys.at(2.5), Some(At::One(&30)));
    }

    #[test]
    fn times_from_one_end_of_doubles_to_the_other_have_weights_in_between() {
        let keys: Keyframed<i32> = vec![key(-f64::MAX, 1), key(f64::MAX, 2)].try_into().unwrap();
        assert_eq!(keys.at(0.0), Some(At::Between { a: &1, b: &2, weight: 0.5 }));
    }

    #[test]
    fn times_as_near_as_doubles_are_have_weights_that_are_numbers() {
        for (a, b) in [(0.0, 5e-324), (-5e-324, 0.0), (5e-324, 1e-323), (1.0, 1.0 + f64::EPSILON)] {
            let keys: Keyframed<i32> = vec![key(a, 1), key(b, 2)].try_into().unwrap();
            assert_eq!([a, b].map(|time| keys.at(time)), [Some(At::One(&1)), Some(At::One(&2))], "{a:e}, {b:e}");
        }
        let keys: Keyframed<i32> = vec![key(0.0, 1), key(1e-323, 2)].try_into().unwrap();
        assert_eq!(keys.at(5e-324), Some(At::Between { a: &1, b: &2, weight: 0.5 }));
    }

    #[test]
    fn between_two_equal_keys_their_value_holds() {
        let keys: Keyframed<i32> = vec![key(0.0, 1), key(1.0, 1), key(2.0, 3)].try_into().unwrap();
        assert_eq!([0.25, 0.5].map(|time| keys.at(time)), [Some(At::One(&1)); 2]);
        assert_eq!(keys.at(1.5), Some(At::Between { a: &1, b: &3, weight: 0.5 }));
    }

    #[test]
    fn keys_are_inserted_replaced_moved_and_removed() {
        let mut keys = three();
        assert_eq!(keys.insert(key(2.0, 25)), Ok((2, None)));
        assert_eq!(keys.insert(key(1.0, 21)), Ok((1, Some(key(1.0, 20)))));
        assert_eq!(keys.move_to(0, 3.0), Ok(2));
        assert_eq!(keys.move_to(2, 3.0), Ok(2), "where it is already");
        let values: Vec<_> = keys.keys().iter().map(|k| (k.time, k.value)).collect();
        assert_eq!(values, [(1.0, 21), (2.0, 25), (3.0, 10), (4.0, 30)]);
        let before = keys.clone();
        assert_eq!(keys.move_to(0, 4.0), Err(TimelineError::TimeTaken(4.0)));
        assert_eq!(keys.move_to(7, 5.0), Err(TimelineError::NoKey(7)));
        assert!(keys.move_to(0, f64::INFINITY).is_err() && keys.insert(key(f64::NEG_INFINITY, 0)).is_err());
        assert_eq!(keys, before);
        assert_eq!((keys.remove(3), keys.remove(3)), (Some(key(4.0, 30)), None));
    }

    #[test]
    fn data_comes_back_as_it_went_in_and_bad_data_is_refused() {
        let mut keys = three();
        let transition = Transition::Cubic { handles: [[0.1, 0.2], [0.3, 1.0 / 3.0]] };
        keys.insert(Key { time: 0.1 + 0.2, transition, value: 5 }).unwrap();
        let text = serde_json::to_string(&keys).unwrap();
        assert_eq!(serde_json::from_str::<Keyframed<i32>>(&text).unwrap(), keys);
        for bad in [
            r#"[{"time": 1, "value": 1}, {"time": 1, "value": 2}]"#,
            r#"[{"time": 1, "value": 1}, {"time": 0, "value": 2}]"#,
            r#"[{"time": 1, "value": 1, "other": 2}]"#,
            r#"[{"time": 1, "value": 1, "transition": {"step": {"at": 2}}}]"#,
            r#"[{"time": 1, "value": 1, "transition": {"step": {"at": 0.2, "to": 1}}}]"#,
        ] {
            assert!(serde_json::from_str::<Keyframed<i32>>(bad).is_err(), "{bad}");
        }
    }
}
