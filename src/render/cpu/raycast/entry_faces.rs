//! The entry faces of a mesh and its active cells, kept from frame to frame.
//!
//! ```text
//! the same cells                    the faces are those of before
//! few cells have come or gone       these cells and those beside them are touched: their faces are found, others copied
//! else                              the faces of all active cells are found
//! ```
//! Finding reads neighbours and corners of cells scattered in memory; copying reads lists of faces sequentially.

use super::super::raster::lists::ListedFace;
use super::entries::{CLUSTER_WORDS, cluster_count, each_open_face, face_of, open_faces};
use crate::mesh::{Mesh, Topology};
use crate::task::Cancel;
use crate::visibility::CellSet;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Only touched cells are searched if there are at least this many active cells per changed cell. A changed cell touches five.
const FEW: usize = 8;

/// The faces, cluster by cluster. The two cell numbers of a listed face are its local face index and its cell.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct EntryFaces {
    of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    pub(in crate::render::cpu) clusters: Vec<Vec<ListedFace>>,
    /// Memory of [`Self::find_touched`]: the previous faces, and a bit per cell.
    before: Vec<Vec<ListedFace>>,
    touched: Vec<AtomicU64>,
}

/// Faces reused from the previous update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::render::cpu) struct Kept {
    /// Whether all were reused, as the cells are the same.
    pub(in crate::render::cpu) all: bool,
    /// Number of reused faces.
    pub(in crate::render::cpu) faces: u64,
}

impl EntryFaces {
    /// Finds the faces, reusing previous ones if it `may_keep` them; only some of them if `cancel` is raised.
    pub(in crate::render::cpu) fn update(
        &mut self,
        mesh: &Arc<Mesh>,
        active: &Arc<CellSet>,
        may_keep: bool,
        cancel: &Cancel,
    ) -> Kept {
        let before = self.of.take().filter(|(of, _)| may_keep && Arc::ptr_eq(of, mesh)).map(|(_, cells)| cells);
        let kept = match before {
            Some(before) if Arc::ptr_eq(&before, active) => Kept { all: true, faces: self.count() as u64 },
            Some(before) if are_few(&before, active) => {
                Kept { all: false, faces: self.find_touched(&mesh.topology, &before, active) }
            }
            _ => {
                self.find(&mesh.topology, active, cancel);
                Kept::default()
            }
        };
        self.of = (!cancel.is_cancelled()).then(|| (mesh.clone(), active.clone()));
        kept
    }

    pub(super) fn count(&self) -> usize {
        self.clusters.iter().map(Vec::len).sum()
    }

    fn find(&mut self, topology: &Topology, active: &CellSet, cancel: &Cancel) {
        self.clusters.resize_with(cluster_count(active), Vec::new);
        self.clusters.par_iter_mut().enumerate().for_each(|(cluster, faces)| {
            faces.clear();
            if !cancel.is_cancelled() {
                each_open_face(topology, active, cluster, |cell, i| faces.push(listed(topology, cell, i)));
            }
        });
    }

    /// Finds the faces of cells touched by a change from `before` to `active`, and keeps the others, whose number it returns.
    fn find_touched(&mut self, topology: &Topology, before: &CellSet, active: &CellSet) -> u64 {
        self.touch(topology, before, active);
        std::mem::swap(&mut self.clusters, &mut self.before);
        self.clusters.resize_with(self.before.len(), Vec::new);
        let clusters = self.clusters.par_iter_mut().zip(&mut self.before).enumerate();
        let kept = clusters.map(|(cluster, (faces, before))| {
            let words = words_of(cluster, active);
            if self.touched[words.clone()].iter().all(|word| word.load(Relaxed) == 0) {
                std::mem::swap(faces, before);
                return faces.len();
            }
            let mut merge = Merge { topology, active, before, faces, kept: 0 };
            merge.faces.clear();
            words.for_each(|at| merge.word(at, self.touched[at].load(Relaxed)));
            merge.kept
        });
        kept.sum::<usize>() as u64
    }

    /// Marks the changed cells and their neighbours.
    fn touch(&mut self, topology: &Topology, before: &CellSet, active: &CellSet) {
        self.touched.resize_with(active.words().len(), AtomicU64::default);
        self.touched.iter_mut().for_each(|word| *word.get_mut() = 0);
        let touch = |cell: usize| {
            // A missing neighbour lies beyond the last word.
            if let Some(word) = self.touched.get(cell / 64) {
                word.fetch_or(1 << (cell % 64), Relaxed);
            }
        };
        let neighbours = &topology.connectivity().neighbours;
        let words = before.words().par_iter().zip(active.words()).enumerate().with_min_len(CLUSTER_WORDS);
        words.for_each(|(at, (before, now))| {
            each_bit(before ^ now, |bit| {
                let cell = 64 * at + bit;
                touch(cell);
                neighbours[cell].iter().for_each(|neighbour| touch((neighbour.0 >> 2) as usize));
            });
        });
    }
}

/// Whether few cells have changed.
fn are_few(before: &CellSet, active: &CellSet) -> bool {
    let changed = before.words().iter().zip(active.words()).map(|(a, b)| (a ^ b).count_ones() as usize).sum::<usize>();
    before.universe() == active.universe() && FEW * changed <= active.count()
}

/// The words of a cluster of cells.
fn words_of(cluster: usize, cells: &CellSet) -> Range<usize> {
    let first = cluster * CLUSTER_WORDS;
    first..cells.words().len().min(first + CLUSTER_WORDS)
}

fn listed(topology: &Topology, cell: u32, i: usize) -> ListedFace {
    ListedFace { ids: face_of(topology, cell, i).vertices, cells: [i as u32, cell] }
}

/// Calls `each` with the index of each set bit, from the lowest on.
#[inline(always)]
fn each_bit(word: u64, mut each: impl FnMut(usize)) {
    let mut rest = word;
    while rest != 0 {
        each(rest.trailing_zeros() as usize);
        rest &= rest - 1;
    }
}

/// Merges previous faces of a cluster with found ones.
struct Merge<'a> {
    topology: &'a Topology,
    active: &'a CellSet,
    /// Previous faces of this word's cells and later ones.
    before: &'a [ListedFace],
    faces: &'a mut Vec<ListedFace>,
    kept: usize,
}

impl Merge<'_> {
    /// Adds the faces of a word's cells.
    fn word(&mut self, at: usize, touched: u64) {
        let Self { topology, active, .. } = *self;
        let neighbours = &topology.connectivity().neighbours;
        each_bit(touched, |bit| {
            let cell = 64 * at + bit;
            self.keep(cell);
            self.leave_out(cell + 1);
            if active.words()[at] >> bit & 1 == 1 {
                open_faces(neighbours, active, cell, |cell, i| self.faces.push(listed(topology, cell, i)));
            }
        });
        self.keep(64 * at + 64);
    }

    /// Copies the previous faces of the cells up to `end`.
    fn keep(&mut self, end: usize) {
        let kept = self.leave_out(end);
        self.kept += kept.len();
        self.faces.extend_from_slice(kept);
    }
}

impl<'a> Merge<'a> {
    /// Removes the previous faces of the cells up to `end` and returns them.
    fn leave_out(&mut self, end: usize) -> &'a [ListedFace] {
        let count = self.before.iter().take_while(|face| (face.cells[1] as usize) < end).count();
        let (out, rest) = self.before.split_at(count);
        self.before = rest;
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::SeriesSource;
    use crate::random::SplitMix64;
    use crate::synth::{SeriesName, SynthSpec, generate};

    fn jet() -> Arc<Mesh> {
        let jet = generate(&SynthSpec { cells: 20_000, steps: 1, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        Arc::new(Mesh::build(jet.mesh().unwrap()).unwrap().0)
    }

    /// The faces of a set by a full [`EntryFaces::find`].
    fn found(mesh: &Arc<Mesh>, active: &Arc<CellSet>) -> EntryFaces {
        let mut faces = EntryFaces::default();
        assert_eq!(faces.update(mesh, active, true, &Cancel::new()), Kept::default(), "nothing was known");
        faces
    }

    fn same(a: &EntryFaces, b: &EntryFaces) -> bool {
        let plain = |faces: &EntryFaces| {
            let face = |face: &ListedFace| (face.ids, face.cells);
            faces.clusters.iter().map(|faces| faces.iter().map(face).collect::<Vec<_>>()).collect::<Vec<_>>()
        };
        plain(a) == plain(b)
    }

    #[test]
    fn faces_of_cells_that_a_change_touches_are_found_and_others_kept() {
        let mesh = jet();
        let cells = mesh.topology.tets.len();
        let mut random = SplitMix64::new(5);
        let (mut faces, never) = (EntryFaces::default(), Cancel::new());
        let mut active = CellSet::of(cells, |cell| cell % 1000 < 600);
        let (mut kept_some, mut kept_none) = (0, 0);
        for round in 0..60 {
            // Some cells change one by one, some in random stretches.
            let mut next = active.clone();
            for _ in 0..[0, 1, 40, 300, 2000][round % 5] {
                let (first, member) = (random.below(cells), random.below(2) == 0);
                let end = first + if round % 3 == 0 { 20 } else { 1 };
                (first..end.min(cells)).for_each(|cell| next.set(cell as u32, member));
            }
            active = next;
            let now = Arc::new(active.clone());
            let kept = faces.update(&mesh, &now, true, &never);
            let afresh = found(&mesh, &now);
            assert!(same(&faces, &afresh), "round {round}");
            assert!(!kept.all && kept.faces <= afresh.count() as u64);
            match kept.faces {
                0 => kept_none += 1,
                _ => kept_some += 1,
            }
            assert_eq!(faces.update(&mesh, &now, true, &never), Kept { all: true, faces: afresh.count() as u64 });
        }
        assert!(kept_some > 20 && kept_none > 5, "both ways were taken: {kept_some}, {kept_none}");
    }

    #[test]
    fn nothing_is_kept_of_another_mesh_or_if_that_is_not_wanted() {
        let (mesh, other, never) = (jet(), jet(), Cancel::new());
        let active = Arc::new(CellSet::of(mesh.topology.tets.len(), |cell| cell % 7 < 4));
        let mut faces = found(&mesh, &active);
        assert_eq!(faces.update(&other, &active, true, &never), Kept::default());
        assert_eq!(faces.update(&other, &active, false, &never), Kept::default());
        let cancelled = Cancel::new();
        cancelled.cancel();
        faces.update(&mesh, &active, true, &cancelled);
        assert_eq!(faces.update(&mesh, &active, true, &never), Kept::default(), "what was given up is not known");
        assert!(same(&faces, &found(&mesh, &active)));
    }
}
