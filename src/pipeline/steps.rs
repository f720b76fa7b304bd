//! Decoded scalars in memory, by time: those of the last frames, and the steps that they were mixed from.

use super::series::Series;
use super::time::{FrameTime, mix};
use crate::codec::{DecodeStats, StepRequest, Wanted};
use crate::error::FileResult;
use crate::stats::FrameStats;
use crate::task::Cancel;
use crate::visibility::Clusters;
use rayon::prelude::*;
use std::sync::{Arc, Weak};

/// The scalars at one time.
#[derive(Debug)]
struct Held {
    time: FrameTime,
    scalars: Arc<Vec<f32>>,
    /// The chunks that are filled; `None`: all.
    chunks: Option<Vec<bool>>,
    /// Count of uses at the last use.
    used: u64,
}

impl Held {
    /// Whether all needed chunks are filled.
    fn has(&self, needed: Option<&[bool]>) -> bool {
        match (&self.chunks, needed) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(chunks), Some(needed)) => {
                chunks.iter().zip(needed).all(|(is_there, is_needed)| *is_there || !is_needed)
            }
        }
    }
}

/// Most times that are held, in use or not: two that are prepared, one that is rendered, and two steps to mix the next one from. If more
/// are in use, memory of the released ones returns when their frames are done.
const HELD_MAX: usize = 5;

/// Vertices that a thread mixes at once: fewer cost more to hand out than to mix.
const MIX_CHUNK: usize = 16 * 1024;

/// Scalars by time, decoded or mixed, in a pool of buffers. Playing forwards, each step is decoded once, interpolated or not. A buffer is
/// reused as soon as no frame holds it: there are as many as frames on their way, and one or two more.
#[derive(Debug, Default)]
pub(super) struct StepCache {
    /// The series of `held`.
    of: Weak<Series>,
    held: Vec<Held>,
    /// A buffer whose filling failed or was cancelled.
    spare: Option<Arc<Vec<f32>>>,
    uses: u64,
}

/// The caches of several fields, by their names.
#[derive(Debug, Default)]
pub(super) struct StepCaches {
    by_field: Vec<(String, StepCache)>,
}

impl StepCaches {
    /// Drops those of other fields.
    pub(super) fn keep(&mut self, is_needed: impl Fn(&str) -> bool) {
        self.by_field.retain(|(field, _)| is_needed(field));
    }

    /// The cache of a field, which is made if there is none.
    pub(super) fn of(&mut self, field: &str) -> &mut StepCache {
        let known = self.by_field.iter().position(|(known, _)| known == field);
        let place = known.unwrap_or_else(|| {
            self.by_field.push((field.to_owned(), StepCache::default()));
            self.by_field.len() - 1
        });
        &mut self.by_field[place].1
    }
}

impl StepCache {
    /// The scalars at a time, one per vertex or cell, at least in the `needed` chunks of [`Clusters::SCALARS`] (`None`: all); `None` if `cancel`
    /// was raised. The other chunks are filled with their least scalar. A call that needs further chunks of a held time fills all of them.
    ///
    /// # Errors
    /// If a step cannot be read.
    pub(super) fn show(
        &mut self,
        series: &Arc<Series>,
        time: FrameTime,
        needed: Option<&[bool]>,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> FileResult<Option<Arc<Vec<f32>>>> {
        if self.of.as_ptr() != Arc::as_ptr(series) {
            self.held.clear();
            self.of = Arc::downgrade(series);
        }
        if let Some(found) = self.find(time, needed) {
            stats.decodes_skipped += 1;
            return Ok(Some(found));
        }
        let count = series.scalar_count();
        let needed = needed.filter(|_| self.held.iter().all(|held| held.time != time));
        let Some((next, weight)) = time.toward() else {
            let mut decoded = DecodeStats::default();
            let ranges = needed.and_then(|_| series.ranges_of(time.step()));
            let needed = needed.filter(|_| ranges.is_some());
            let filled = self.fill(time, count, needed, |out| {
                let wanted = needed.map(|chunks| Wanted { length: Clusters::SCALARS, chunks });
                let cost = series.source.decode_step(StepRequest { step: time.step(), wanted, cancel }, out)?;
                decoded = cost.unwrap_or_default();
                if let (Some(chunks), Some(ranges)) = (needed, &ranges) {
                    let parts = out.chunks_mut(Clusters::SCALARS).zip(chunks).zip(ranges.iter());
                    parts.filter(|((_, needed), _)| !**needed).for_each(|((part, _), range)| part.fill(range[0]));
                }
                if cost.is_some() && needed.is_none() {
                    series.learn_ranges(time.step(), out);
                }
                Ok(cost.is_some())
            });
            stats.bytes_read += decoded.bytes_read;
            stats.vertices_decoded += decoded.vertices_decoded;
            return filled;
        };
        // A step that is held must not be overwritten by decoding the other one.
        let known = self.find(next.into(), needed);
        let Some(from) = self.show(series, time.step().into(), needed, cancel, stats)? else { return Ok(None) };
        let to = if known.is_some() { known } else { self.show(series, next.into(), needed, cancel, stats)? };
        let Some(to) = to else { return Ok(None) };
        self.fill(time, count, needed, |out| {
            mix_steps(&from, &to, weight, cancel, out);
            Ok(!cancel.is_cancelled())
        })
    }

    /// Number of buffers, in use or not.
    #[cfg(test)]
    pub(super) fn buffers(&self) -> usize {
        self.held.len() + usize::from(self.spare.is_some())
    }

    fn find(&mut self, time: FrameTime, needed: Option<&[bool]>) -> Option<Arc<Vec<f32>>> {
        self.uses += 1;
        let found = self.held.iter_mut().find(|held| held.time == time && held.has(needed))?;
        found.used = self.uses;
        Some(found.scalars.clone())
    }

    /// Fills the needed chunks of a free buffer with the scalars at a time; `fill` returns whether it finished.
    fn fill(
        &mut self,
        time: FrameTime,
        count: usize,
        needed: Option<&[bool]>,
        fill: impl FnOnce(&mut [f32]) -> FileResult<bool>,
    ) -> FileResult<Option<Arc<Vec<f32>>>> {
        let mut scalars = self.free_buffer();
        // No frame holds the buffer. A renderer may still have a weak reference, to tell whether it has uploaded it; `make_mut` leaves that
        // behind and moves the values.
        let values = Arc::make_mut(&mut scalars);
        values.resize(count, 0.0);
        let filled = fill(values);
        if !matches!(filled, Ok(true)) {
            self.spare = Some(scalars);
            return filled.map(|_| None);
        }
        self.uses += 1;
        if needed.is_none() {
            // The complete buffer replaces partial ones.
            self.held.retain(|held| held.time != time);
        }
        let chunks = needed.map(<[bool]>::to_vec);
        self.held.push(Held { time, scalars: scalars.clone(), chunks, used: self.uses });
        Ok(Some(scalars))
    }

    /// A buffer that no frame holds: the least recently used, or a new one.
    fn free_buffer(&mut self) -> Arc<Vec<f32>> {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let oldest = |held: &[Held], is_free: bool| {
            let candidates = held.iter().enumerate().filter(|(_, h)| !is_free || Arc::strong_count(&h.scalars) == 1);
            candidates.min_by_key(|(_, h)| h.used).map(|(at, _)| at)
        };
        if let Some(at) = oldest(&self.held, true) {
            return self.held.swap_remove(at).scalars;
        }
        if self.held.len() >= HELD_MAX
            && let Some(at) = oldest(&self.held, false)
        {
            self.held.swap_remove(at);
        }
        Arc::default()
    }
}

/// `(1 - weight) * from + weight * to` per vertex, in f64. Not finite if either is not: a hole in either step is one in between. Left
/// incomplete if `cancel` is raised.
fn mix_steps(from: &[f32], to: &[f32], weight: f64, cancel: &Cancel, out: &mut [f32]) {
    out.par_chunks_mut(MIX_CHUNK).zip(from.par_chunks(MIX_CHUNK)).zip(to.par_chunks(MIX_CHUNK)).for_each(
        |((out, from), to)| {
            if cancel.is_cancelled() {
                return;
            }
            for ((out, &a), &b) in out.iter_mut().zip(from).zip(to) {
                *out = mix(f64::from(a), f64::from(b), weight) as f32;
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::super::test_series;
    use super::*;

    /// Steps decoded, in order, by a cache of a fake series.
    fn decoded_for(times: &[FrameTime]) -> Vec<usize> {
        let (series, log) = test_series::logged(8);
        let mut cache = StepCache::default();
        for &time in times {
            let mut stats = FrameStats::default();
            let shown = cache.show(&series, time, None, &Cancel::new(), &mut stats).unwrap().unwrap();
            let expected = time.mix(time.step() as f64, |next| next as f64) as f32;
            assert!(shown.len() == series.scalar_count() && shown.iter().all(|&s| s == expected), "{time:?}");
        }
        log.decoded()
    }

    #[test]
    fn playing_forwards_decodes_each_step_once_interpolated_or_not() {
        let between = FrameTime::between;
        assert_eq!(decoded_for(&[0, 0, 1, 2, 2, 3].map(FrameTime::from)), [0, 1, 2, 3]);
        let forwards =
            [0.into(), between(0, 1, 0.3), between(0, 1, 0.6), between(1, 2, 0.1), 2.into(), between(2, 3, 0.5)];
        assert_eq!(decoded_for(&forwards), [0, 1, 2, 3]);
        assert_eq!(
            decoded_for(&[between(2, 3, 0.5), between(1, 2, 0.5), between(0, 1, 0.5)]),
            [2, 3, 1, 0],
            "backwards"
        );
    }

    #[test]
    fn buffers_are_as_many_as_frames_that_hold_them_and_one_more() {
        let (series, _) = test_series::logged(64);
        for on_their_way in 0..4 {
            let mut cache = StepCache::default();
            let mut frames = std::collections::VecDeque::new();
            let mut places = std::collections::BTreeSet::new();
            for step in 0..40 {
                let shown = cache
                    .show(&series, step.into(), None, &Cancel::new(), &mut FrameStats::default())
                    .unwrap()
                    .unwrap();
                places.insert(shown.as_ptr().addr());
                frames.push_back(shown);
                if frames.len() > on_their_way {
                    frames.pop_front();
                }
            }
            assert_eq!(places.len(), on_their_way + 1, "{on_their_way}");
        }
    }

    #[test]
    fn a_buffer_whose_filling_was_cancelled_or_failed_is_used_again_and_never_shown() {
        let (series, log) = test_series::logged(8);
        let (mut cache, mut stats) = (StepCache::default(), FrameStats::default());
        let cancelled = Cancel::new();
        cancelled.cancel();
        assert!(cache.show(&series, 1.into(), None, &cancelled, &mut stats).unwrap().is_none());
        log.fail_at(2);
        assert!(cache.show(&series, 2.into(), None, &Cancel::new(), &mut stats).is_err());
        assert!(cache.held.is_empty() && cache.spare.is_some());
        let shown =
            cache.show(&series, FrameTime::between(0, 1, 0.5), None, &Cancel::new(), &mut stats).unwrap().unwrap();
        assert!(shown.iter().all(|&s| s == 0.5) && cache.spare.is_none());
    }

    #[test]
    fn a_mixture_is_the_blend_by_hand() {
        // More than one chunk, values of many magnitudes.
        let value = |i: usize| ((i as f32) * 0.7).sin() * 10f32.powi(i as i32 % 60 - 30);
        let from: Vec<f32> = (0..2 * MIX_CHUNK + 7).map(value).collect();
        let to: Vec<f32> = (0..from.len()).map(|i| value(i + 5)).collect();
        let mut out = vec![0.0; from.len()];
        mix_steps(&from, &to, 0.3, &Cancel::new(), &mut out);
        let mut exact = 0;
        for ((&a, &b), &mixed) in from.iter().zip(&to).zip(&out) {
            let by_hand = f64::from(a) + 0.3 * (f64::from(b) - f64::from(a));
            // Both are one rounding to f32 away from numbers that differ by a few roundings of an f64.
            let scale = f64::from(a.abs().max(b.abs()));
            assert!((f64::from(mixed) - by_hand).abs() <= f64::from(f32::EPSILON) * scale, "{a} {b} {mixed}");
            exact += usize::from(mixed == by_hand as f32);
        }
        // Roundings of an f64 decide a rounding to f32 once in millions.
        assert!(exact + 2 >= out.len() && from != *out, "{exact} of {}", out.len());
    }

    #[test]
    fn a_hole_in_either_step_is_a_hole_between_them() {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        let (from, to) = ([1.0, nan, 1.0, inf, inf, 0.5], [3.0, 1.0, -inf, 1.0, -inf, 0.5]);
        let mut out = [0.0; 6];
        mix_steps(&from, &to, 0.25, &Cancel::new(), &mut out);
        assert_eq!((out[0], out[5]), (1.5, 0.5));
        assert!(out[1..5].iter().all(|s| !s.is_finite()), "{out:?}");
    }
}
