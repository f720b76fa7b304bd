//! Finds the active cells, from step to step and from table to table.
//!
//! ```text
//! scalars, table -> labels of vertices (where the table is transparent)   each cluster: one label, or several? changed since last update?
//! labels -> cells                                                   each cluster: nothing changed: as before
//!                                                                                 one label: none, or all, of its cells
//!                                                                                 else cell by cell
//! the same scalars -> scalar range per word (64 cells)              each word: no interval differs within its range: as before
//! ```
//! So a step in which few scalars change, or a table edited in one place, costs little, and a cluster in a transparent part of the mesh
//! only costs a test of its labels.

use super::id_set::fill_words;
use super::moved::{Differences, WordRanges};
use super::transparent::{HOLE, Label, TransparentIntervals, VISIBLE};
use super::{CellSet, Clusters, Pool};
use crate::field::Scalars;
use crate::mesh::{Mesh, Topology};
use crate::slowdown::{Slow, waste};
use crate::task::Cancel;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};

/// The visible cells of a mesh at one step.
#[derive(Clone, Debug)]
pub struct Activity {
    /// The cells with finite scalars.
    pub finite: Arc<CellSet>,
    /// The finite cells in which the table has extinction; the same [`Arc`] if these are all of them.
    pub active: Arc<CellSet>,
    /// Number of cells classified one by one.
    pub classified: u64,
}

/// State of a cluster of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ClusterState {
    /// The label of all of its vertices, if they agree.
    label: Option<Label>,
    has_holes: bool,
    /// Whether any label has changed since the last update.
    changed: bool,
}

/// Finds the active cells of successive frames incrementally. Keeps its memory: two bytes per vertex, and the sets in use.
#[derive(Debug, Default)]
pub struct ActiveCells {
    of: Weak<Mesh>,
    clusters: Arc<Clusters>,
    all: Arc<CellSet>,
    labels: Vec<Label>,
    before: Vec<Label>,
    states: Vec<ClusterState>,
    last: Option<Last>,
    ranges: WordRanges,
    pool: Pool<CellSet>,
}

#[derive(Debug)]
struct Last {
    /// Compared by pointer: while a weak reference exists, no other scalars get the same address.
    scalars: Weak<Vec<f32>>,
    transparent: Arc<TransparentIntervals>,
    activity: Activity,
}

impl ActiveCells {
    /// Finds the cells that are visible where the table is not `transparent`; `None` if `cancel` was raised meanwhile. `clusters`: those of
    /// the mesh. `known` goes with the transparent intervals: the label of each chunk of [`Clusters::SCALARS`] whose scalars must
    /// not be read, as [`TransparentIntervals::label_of_range`] gives it, for a range that holds all of its scalars; empty for none.
    ///
    /// With `forget`, nothing is reused from before.
    ///
    /// # Panics
    /// If there is not one scalar per vertex or cell.
    pub fn update(
        &mut self,
        mesh: &Arc<Mesh>,
        clusters: &Arc<Clusters>,
        scalars: &Scalars,
        (transparent, known): (&Arc<TransparentIntervals>, &[Option<Label>]),
        forget: bool,
        cancel: &Cancel,
    ) -> Option<Activity> {
        let expected = match scalars {
            Scalars::Vertices(_) => mesh.positions.local.len(),
            Scalars::Cells(_) => mesh.topology.tets.len(),
        };
        let values = scalars.values();
        assert_eq!(values.len(), expected, "one scalar per vertex or cell");
        if forget {
            self.last = None;
        }
        if self.of.as_ptr() != Arc::as_ptr(mesh) {
            let (all, clusters) = (Arc::new(CellSet::all(mesh.topology.tets.len())), clusters.clone());
            *self = Self { of: Arc::downgrade(mesh), clusters, all, ..Self::default() };
        }
        let of_these = self.last.as_ref().filter(|last| last.scalars.as_ptr() == Arc::as_ptr(values));
        if let Some(last) = of_these
            && (Arc::ptr_eq(&last.transparent, transparent) || last.transparent == *transparent)
        {
            return Some(Activity { classified: 0, ..last.activity.clone() });
        }
        let activity = match scalars {
            Scalars::Vertices(scalars) => {
                let differences = of_these.and_then(|last| Differences::between(&last.transparent, transparent));
                self.label(scalars, transparent, known);
                self.find(&mesh.topology, differences.map(|differences| (scalars, differences)), cancel)
            }
            Scalars::Cells(scalars) => Some(self.find_by_cell(scalars, transparent, known)),
        };
        waste(Slow::ActiveCells, mesh.topology.tets.len());
        // The labels have changed: sets found for the previous ones no longer match.
        self.last = activity.clone().map(|activity| Last {
            scalars: Arc::downgrade(values),
            transparent: transparent.clone(),
            activity,
        });
        activity
    }

    /// Labels the vertices, and compares with the previous labels.
    fn label(&mut self, scalars: &[f32], transparent: &TransparentIntervals, known: &[Option<Label>]) {
        std::mem::swap(&mut self.labels, &mut self.before);
        self.labels.resize(scalars.len(), VISIBLE);
        let is_new = self.last.is_none() || self.before.len() != scalars.len();
        self.before.resize(scalars.len(), VISIBLE);
        let chunks = self
            .labels
            .par_chunks_mut(Clusters::VERTICES)
            .zip(self.before.par_chunks(Clusters::VERTICES))
            .zip(scalars.par_chunks(Clusters::VERTICES));
        let states = chunks.enumerate().map(|(at, ((labels, before), scalars))| {
            match known.get(at).copied().flatten() {
                Some(label) => labels.fill(label),
                None => transparent.label_all(scalars, labels),
            }
            let first = labels.first().copied().unwrap_or(VISIBLE);
            let is_one = labels.iter().all(|&label| label == first);
            let has_holes = if is_one { first == HOLE } else { labels.contains(&HOLE) };
            ClusterState { label: is_one.then_some(first), has_holes, changed: is_new || labels != before }
        });
        states.collect_into_vec(&mut self.states);
    }

    /// Finds the cells of scalars that cells have: each has a label of its own.
    fn find_by_cell(
        &mut self,
        scalars: &[f32],
        transparent: &TransparentIntervals,
        known: &[Option<Label>],
    ) -> Activity {
        let Self { all, labels, last, pool, .. } = self;
        labels.resize(scalars.len(), VISIBLE);
        let chunks = labels.par_chunks_mut(Clusters::SCALARS).zip(scalars.par_chunks(Clusters::SCALARS));
        let chunks = chunks.enumerate().with_min_len(Clusters::CELLS / Clusters::SCALARS);
        let classified: usize = chunks
            .map(|(at, (labels, scalars))| {
                if let Some(label) = known.get(at).copied().flatten() {
                    labels.fill(label);
                    return 0;
                }
                transparent.label_all(scalars, labels);
                labels.len()
            })
            .sum();
        let mut find = |before: Option<&Arc<CellSet>>, is_member: fn(Label) -> bool| {
            let set = pool.make(|set| {
                set.resize(labels.len());
                let words = set.words_mut().par_iter_mut().zip(labels.par_chunks(64)).with_min_len(64);
                words.for_each(|(word, labels)| {
                    let bits = (0..).zip(labels).map(|(at, &label)| u64::from(is_member(label)) << at);
                    *word = bits.fold(0, |word, bit| word | bit);
                });
            });
            [before, Some(&*all)].into_iter().flatten().find(|known| ***known == *set).cloned().unwrap_or(set)
        };
        let before = last.as_ref().map(|last| &last.activity);
        let finite = find(before.map(|before| &before.finite), |label| label != HOLE);
        let active = find(before.map(|before| &before.active), |label| label == VISIBLE);
        let active = if active == finite { finite.clone() } else { active };
        // They are of no use to a later update by labels of vertices.
        labels.clear();
        Activity { finite, active, classified: classified as u64 }
    }

    /// Finds the cells of the current labels. `moved`: the scalars, if they are unchanged, and the differences of the intervals.
    fn find(
        &mut self,
        topology: &Topology,
        moved: Option<(&Arc<Vec<f32>>, Differences)>,
        cancel: &Cancel,
    ) -> Option<Activity> {
        let before = self.last.as_ref().map(|last| &last.activity);
        if let Some(before) = before
            && self.states.iter().all(|state| !state.changed)
        {
            return Some(Activity { classified: 0, ..before.clone() });
        }
        let Self { clusters, all, labels, states, ranges, pool, .. } = self;
        let classified = AtomicU64::new(0);
        let moved = moved.map(|(scalars, differences)| (ranges.of(topology, scalars), differences));
        let scene = Scene { topology, clusters, labels, states, moved, cancel, classified: &classified };
        let has_holes = states.iter().any(|state| state.has_holes);
        let finite = if let (Some(before), Some(_)) = (before, &scene.moved) {
            before.finite.clone()
        } else if has_holes {
            scene.find(pool, before.map(|before| &before.finite), all, |labels| !labels.contains(&HOLE))
        } else {
            all.clone()
        };
        let last = before.map(|before| &before.active);
        let active = if has_holes {
            scene.find(pool, last, all, |labels| !is_transparent(labels) && !labels.contains(&HOLE))
        } else {
            scene.find(pool, last, all, |labels| !is_transparent(labels))
        };
        let active = if active == finite { finite.clone() } else { active };
        (!cancel.is_cancelled()).then(|| Activity { finite, active, classified: classified.into_inner() })
    }
}

/// Whether a cell with these vertex labels is invisible.
#[inline(always)]
fn is_transparent(labels: [Label; 4]) -> bool {
    // Compares four bytes at once.
    labels[0] != VISIBLE && u32::from_ne_bytes(labels) == u32::from(labels[0]) * 0x0101_0101
}

/// Inputs of a cell search.
struct Scene<'a> {
    topology: &'a Topology,
    clusters: &'a Clusters,
    labels: &'a [Label],
    states: &'a [ClusterState],
    /// Scalar ranges of the words, if the scalars are unchanged, and the differences of the intervals.
    moved: Option<(&'a [[f32; 2]], Differences)>,
    cancel: &'a Cancel,
    classified: &'a AtomicU64,
}

impl Scene<'_> {
    /// The cells whose labels pass `is_member`; `before` is the set for the previous labels. Returns the [`Arc`] of `before` or `all` if
    /// equal: renderers compare sets by pointer, and keep what they derived from them.
    fn find(
        &self,
        pool: &mut Pool<CellSet>,
        before: Option<&Arc<CellSet>>,
        all: &Arc<CellSet>,
        is_member: impl Fn([Label; 4]) -> bool + Sync,
    ) -> Arc<CellSet> {
        let set = pool.make(|set| self.fill(before.map(|set| &**set), is_member, set));
        [before, Some(all)].into_iter().flatten().find(|known| ***known == *set).cloned().unwrap_or(set)
    }

    fn fill(&self, before: Option<&CellSet>, is_member: impl Fn([Label; 4]) -> bool + Sync, set: &mut CellSet) {
        const WORDS: usize = Clusters::CELLS / 64;
        let cells = self.topology.tets.len();
        set.resize(cells);
        set.words_mut().par_chunks_mut(WORDS).enumerate().for_each(|(cluster, words)| {
            let used = self.clusters.of_cluster(cluster).iter().map(|&of| self.states[of as usize]);
            if let Some(before) = before
                && used.clone().all(|state| !state.changed)
            {
                words.copy_from_slice(&before.words()[WORDS * cluster..][..words.len()]);
                return;
            }
            let first = used.clone().next().and_then(|state| state.label);
            let tets = &self.topology.tets[Clusters::CELLS * cluster..cells.min(Clusters::CELLS * (cluster + 1))];
            match first.filter(|_| used.clone().all(|state| state.label == first)) {
                Some(label) => fill_words(words, tets.len(), is_member([label; 4])),
                None if self.cancel.is_cancelled() => {}
                None => {
                    let mut classified = 0;
                    for (at, (word, tets)) in (WORDS * cluster..).zip(words.iter_mut().zip(tets.chunks(64))) {
                        if let (Some(before), Some((ranges, differences))) = (before, &self.moved)
                            && differences.leave(ranges[at])
                        {
                            *word = before.words()[at];
                            continue;
                        }
                        classified += tets.len();
                        let bit = |(at, tet): (usize, &[u32; 4])| {
                            u64::from(is_member(tet.map(|v| self.labels[v as usize]))) << at
                        };
                        *word = tets.iter().enumerate().map(bit).fold(0, |word, bit| word | bit);
                    }
                    self.classified.fetch_add(classified as u64, Ordering::Relaxed);
                }
            }
        });
    }
}

#[cfg(test)]
#[path = "active_tests.rs"]
mod tests;
