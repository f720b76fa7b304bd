//! The steps that are in memory: what the last frames showed, and what they were mixed from.

use super::time::{FrameTime, mix};
use crate::codec::DecodeStats;
use crate::error::FileResult;
use crate::mesh::Mesh;
use crate::stats::FrameStats;
use crate::visibility::{CellSet, finite_cells};
use rayon::prelude::*;
use std::sync::Arc;

/// A step as the store has it.
#[derive(Debug)]
struct DecodedStep {
    step: usize,
    scalars: Arc<Vec<f32>>,
}

/// The scalars of a frame and the cells that have four finite ones.
#[derive(Clone, Debug)]
pub(super) struct Shown {
    time: FrameTime,
    pub(super) scalars: Arc<Vec<f32>>,
    pub(super) active: Arc<CellSet>,
}

/// Steps already decoded. Playing forwards, each step is decoded once, interpolated or not: one step is kept as long as
/// frames show plain steps, two once a frame lies between two.
#[derive(Debug)]
pub(super) struct StepCache {
    all_cells: Arc<CellSet>,
    /// Two at most.
    decoded: Vec<DecodedStep>,
    shown: Option<Shown>,
}

/// Vertices that a thread mixes at once: fewer cost more to hand out than to mix.
const MIX_CHUNK: usize = 16 * 1024;

impl StepCache {
    /// An empty cache for a mesh of so many cells.
    pub(super) fn new(cells: usize) -> Self {
        Self { all_cells: Arc::new(CellSet::all(cells)), decoded: Vec::new(), shown: None }
    }

    /// What a frame shows; `decode` fills a buffer with a step, one scalar per vertex of `mesh`.
    ///
    /// # Errors
    /// That of `decode`.
    pub(super) fn show(
        &mut self,
        time: FrameTime,
        mesh: &Mesh,
        decode: &dyn Fn(usize, &mut [f32]) -> FileResult<DecodeStats>,
        stats: &mut FrameStats,
    ) -> FileResult<Shown> {
        let last = match self.shown.take() {
            Some(shown) if shown.time == time => return Ok(self.shown.insert(shown).clone()),
            last => last,
        };
        let last_active = last.as_ref().map(|shown| shown.active.clone());
        let mut step = |cache: &mut Self, step, keep| cache.step(step, keep, mesh, decode, stats);
        let scalars = match time.toward() {
            None => {
                // Its buffer may be the one that the step is decoded to.
                drop(last);
                step(self, time.step(), None)?
            }
            Some((next, weight)) => {
                let mixed_before = last.filter(|shown| shown.time.toward().is_some());
                let mut mixed = unshared(mixed_before.map(|shown| shown.scalars).unwrap_or_default());
                let from = step(self, time.step(), Some(next))?;
                let to = step(self, next, Some(time.step()))?;
                mix_steps(&from, &to, weight, Arc::make_mut(&mut mixed));
                mixed
            }
        };
        let finite = finite_cells(&mesh.topology, &scalars);
        // The same set in the same place as before: renderers then keep what they have made of it.
        let known = [Some(&self.all_cells), last_active.as_ref()].into_iter().flatten().find(|set| ***set == finite);
        let active = known.cloned().unwrap_or_else(|| Arc::new(finite));
        Ok(self.shown.insert(Shown { time, scalars, active }).clone())
    }

    /// A step, decoded unless it is there; it takes the place of another than `keep`.
    fn step(
        &mut self,
        step: usize,
        keep: Option<usize>,
        mesh: &Mesh,
        decode: &dyn Fn(usize, &mut [f32]) -> FileResult<DecodeStats>,
        stats: &mut FrameStats,
    ) -> FileResult<Arc<Vec<f32>>> {
        if let Some(found) = self.decoded.iter().find(|decoded| decoded.step == step) {
            return Ok(found.scalars.clone());
        }
        let replaced = self.decoded.iter().position(|decoded| Some(decoded.step) != keep);
        let mut scalars = unshared(replaced.map(|i| self.decoded.swap_remove(i).scalars).unwrap_or_default());
        let values = Arc::make_mut(&mut scalars);
        values.resize(mesh.positions.local.len(), 0.0);
        let cost = decode(step, values)?;
        stats.bytes_read += cost.bytes_read;
        stats.vertices_decoded += cost.vertices_decoded;
        self.decoded.push(DecodedStep { step, scalars: scalars.clone() });
        Ok(scalars)
    }
}

/// The buffer if nobody else holds it, else an empty one.
fn unshared(mut buffer: Arc<Vec<f32>>) -> Arc<Vec<f32>> {
    if Arc::get_mut(&mut buffer).is_some() { buffer } else { Arc::default() }
}

/// `(1 - weight) * from + weight * to` per vertex, in f64. Not finite where one of both is not: a hole in either step is one
/// in between.
fn mix_steps(from: &[f32], to: &[f32], weight: f64, out: &mut Vec<f32>) {
    out.resize(from.len(), 0.0);
    out.par_chunks_mut(MIX_CHUNK).zip(from.par_chunks(MIX_CHUNK)).zip(to.par_chunks(MIX_CHUNK)).for_each(
        |((out, from), to)| {
            for ((out, &a), &b) in out.iter_mut().zip(from).zip(to) {
                *out = mix(f64::from(a), f64::from(b), weight) as f32;
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::RawMesh;
    use glam::DVec3;
    use std::cell::RefCell;

    fn one_tet() -> Mesh {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        Mesh::build(RawMesh { points, tets: vec![[0, 1, 2, 3]] }).unwrap().0
    }

    /// A cache that is asked for moments; the steps it decoded, in order.
    fn decoded_for(moments: &[FrameTime]) -> Vec<usize> {
        let mesh = one_tet();
        let log = RefCell::new(Vec::new());
        let decode = |step: usize, out: &mut [f32]| {
            log.borrow_mut().push(step);
            out.fill(step as f32);
            Ok(DecodeStats { bytes_read: 1, vertices_decoded: out.len() as u64 })
        };
        let mut cache = StepCache::new(mesh.topology.tets.len());
        for &time in moments {
            let mut stats = FrameStats::default();
            let shown = cache.show(time, &mesh, &decode, &mut stats).unwrap();
            let expected = time.mix(time.step() as f64, |next| next as f64) as f32;
            assert!(shown.scalars.iter().all(|&s| s == expected), "{time:?}");
            assert!(Arc::ptr_eq(&shown.active, &cache.all_cells));
            assert!(cache.decoded.len() <= 2);
        }
        log.into_inner()
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
    fn plain_steps_keep_one_buffer() {
        let mesh = one_tet();
        let mut cache = StepCache::new(mesh.topology.tets.len());
        let decode = |_: usize, _: &mut [f32]| Ok(DecodeStats::default());
        let mut place = |step: usize| {
            let shown = cache.show(step.into(), &mesh, &decode, &mut FrameStats::default()).unwrap();
            shown.scalars.as_ptr()
        };
        assert_eq!(place(0), place(1));
    }

    #[test]
    fn a_mixture_is_the_blend_by_hand() {
        // More than one chunk, values of many magnitudes.
        let value = |i: usize| ((i as f32) * 0.7).sin() * 10f32.powi(i as i32 % 60 - 30);
        let from: Vec<f32> = (0..2 * MIX_CHUNK + 7).map(value).collect();
        let to: Vec<f32> = (0..from.len()).map(|i| value(i + 5)).collect();
        let mut out = Vec::new();
        mix_steps(&from, &to, 0.3, &mut out);
        let mut exact = 0;
        for ((&a, &b), &mixed) in from.iter().zip(&to).zip(&out) {
            let by_hand = f64::from(a) + 0.3 * (f64::from(b) - f64::from(a));
            // Both are one rounding to f32 away from numbers that differ by a few roundings of an f64.
            let scale = f64::from(a.abs().max(b.abs()));
            assert!((f64::from(mixed) - by_hand).abs() <= f64::from(f32::EPSILON) * scale, "{a} {b} {mixed}");
            exact += usize::from(mixed == by_hand as f32);
        }
        // Roundings of an f64 decide a rounding to f32 once in millions.
        assert!(exact + 2 >= out.len() && from != out, "{exact} of {}", out.len());
    }

    #[test]
    fn a_hole_in_either_step_is_a_hole_between_them() {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        let (from, to) = ([1.0, nan, 1.0, inf, inf, 0.5], [3.0, 1.0, -inf, 1.0, -inf, 0.5]);
        let mut out = Vec::new();
        mix_steps(&from, &to, 0.25, &mut out);
        assert_eq!((out[0], out[5]), (1.5, 0.5));
        assert!(out[1..5].iter().all(|s| !s.is_finite()), "{out:?}");
    }
}
