//! Sorts faces, or cells, front to back.
//!
//! The key of a face is the depth of its centroid along the view direction, in the mesh's local frame (dissertation 6.1.3: faces
//! are "sorted approximately by their centroids"): dot(direction, centroid - origin). It does not depend on the eye, so panning, dollying
//! and a change of projection need no new order, nor does the direction's length matter. Since a common factor does not change the order,
//! the key is the sum over the three corners (of a cell four), not their mean. Vertices are projected once, in f64, and rounded to f32; a face takes two
//! additions.
//!
//! # What is sorted, and when
//! A set of faces is sorted for a direction; the faces that a frame draws are filtered from it by one bit per face. While mesh and
//! direction stay and the faces to draw are among the sorted ones, nothing is sorted:
//!
//! | | sorted |
//! |---|---|
//! | new direction | the faces to draw: the time is linear in their number |
//! | same direction, new faces (another step has other active cells) | all faces: this direction needs no third sort |
//!
//! # Which sort
//! Of 2.02 million faces (a million cells, two threads of a Xeon, median of 15, runs differ by a fifth), keys included:
//!
//! | | ms | |
//! |---|---|---|
//! | by depth first (`radix`) | 18 | stable |
//! | lowest digit first, 11 bits | 31 | stable |
//! | lowest digit first, 8 bits | 40 | stable |
//! | `par_sort_unstable` of words of key and id | 41 | as good as stable |
//! | crate `rdst` 0.20, words of key and id | 57 | as good as stable |
//! | the same, keys only, usual tuner | 23 to 41 | not stable |
//! | the same, keys only, tuner for little memory | 16 to 21 | not stable |
//!
//! The crate is as fast only where equal depths may come in any order; those are common in regular meshes, and their order must not depend
//! on threads. `benches/face_order.rs` measures our sort and the standard library's.

use super::parts::{CHUNK, fill_parts};
use super::radix::RadixSort;
use super::{Drawn, IdSet, Pool, Selection};
use crate::mesh::Mesh;
use crate::slowdown::{Slow, waste};
use crate::task::Cancel;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Vertices per task when projecting.
const VERTICES_AT_ONCE: usize = 8192;

/// What is sorted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Elements {
    /// The faces of a mesh.
    #[default]
    Faces,
    /// Its cells.
    Cells,
}

impl Elements {
    /// Their number in a mesh.
    fn count(self, mesh: &Mesh) -> usize {
        match self {
            Self::Faces => mesh.topology.connectivity().faces.len(),
            Self::Cells => mesh.topology.tets.len(),
        }
    }

    /// Corners of each.
    fn corners(self) -> f32 {
        match self {
            Self::Faces => 3.0,
            Self::Cells => 4.0,
        }
    }
}

/// Sorts faces or cells by depth, and keeps the last sort. Keeps its memory: 20 bytes per face of the largest sort, 4 per vertex, and the lists
/// handed out.
#[derive(Debug, Default)]
pub struct DepthOrder {
    elements: Elements,
    /// Mesh and direction that `sorted` belongs to.
    state: Option<(Arc<Mesh>, DVec3)>,
    /// What is sorted of them.
    pub(super) scope: IdSet,
    scope_count: usize,
    projections: Vec<f32>,
    /// The faces of `scope`, ascending by id, if they are not all faces.
    ids: Vec<u32>,
    radix: RadixSort,
    /// End of each chunk's remaining faces in a filtered list.
    ends: Vec<u32>,
    /// The last request and its answer.
    last: Option<(Arc<Selection>, Arc<Drawn>)>,
    pool: Pool<Drawn>,
    sorts: u64,
    skipped: u64,
}

impl DepthOrder {
    /// An order of faces or of cells.
    pub fn of(elements: Elements) -> Self {
        Self { elements, ..Self::default() }
    }

    /// Number of sorts.
    pub fn sorts(&self) -> u64 {
        self.sorts
    }

    /// Number of requests answered without a sort.
    pub fn sorts_skipped(&self) -> u64 {
        self.skipped
    }

    /// The faces or cells of `selection`, front to back along `direction` (world or local: the frames are parallel; any length; finite). Those of
    /// equal depth are ascending by id. `None` if `cancel` was raised before the end.
    ///
    /// # Panics
    /// If `selection` belongs to another mesh.
    pub fn order(
        &mut self,
        mesh: &Arc<Mesh>,
        direction: DVec3,
        selection: &Arc<Selection>,
        cancel: &Cancel,
    ) -> Option<Arc<Drawn>> {
        assert_eq!(selection.ids.universe(), self.elements.count(mesh), "a selection of this mesh");
        let is_known = self.state.as_ref().is_some_and(|(of, along)| Arc::ptr_eq(of, mesh) && *along == direction);
        if let Some((of, drawn)) = &self.last
            && is_known
            && (Arc::ptr_eq(of, selection) || of == selection)
        {
            self.skipped += 1;
            return Some(drawn.clone());
        }
        self.last = None;
        if is_known && selection.ids.is_within(&self.scope) {
            self.skipped += 1;
        } else {
            self.state = None;
            if is_known {
                self.scope = IdSet::all(selection.ids.universe());
            } else {
                self.scope.copy_from(&selection.ids);
            }
            self.sort(mesh, direction, cancel)?;
            self.state = Some((mesh.clone(), direction));
            self.sorts += 1;
        }
        let Self { radix, ends, scope_count, .. } = self;
        let sorted = radix.sorted();
        let is_all = selection.ids.count() == *scope_count;
        let drawn = self.pool.make(|drawn| {
            drawn.is_complete = selection.is_complete;
            if is_all {
                copy(sorted, &mut drawn.ids);
            } else {
                filter(sorted, &selection.ids, ends, &mut drawn.ids);
            }
        });
        self.last = Some((selection.clone(), drawn.clone()));
        Some(drawn)
    }

    /// Sorts the faces of the scope.
    fn sort(&mut self, mesh: &Mesh, direction: DVec3, cancel: &Cancel) -> Option<()> {
        let Self { elements, scope, scope_count, projections, ids, radix, ends, .. } = self;
        let elements = *elements;
        projections.resize(mesh.positions.local.len(), 0.0);
        let vertices = projections.par_iter_mut().zip(&mesh.positions.local).with_min_len(VERTICES_AT_ONCE);
        vertices.for_each(|(projection, local)| *projection = direction.dot(local.as_dvec3()) as f32);
        let chunks = projections.par_chunks(VERTICES_AT_ONCE);
        let extent = |part: &[f32]| part.iter().fold(NOTHING, |range, &x| union(range, [x, x]));
        let range = chunks.map(extent).reduce(|| NOTHING, union).map(|end| elements.corners() * end);
        *scope_count = scope.count();
        waste(Slow::RadixSort, *scope_count);
        if cancel.is_cancelled() {
            return None;
        }
        let at = |vertex: u32| projections[vertex as usize];
        let (all, topology) = (elements.count(mesh), &mesh.topology);
        // A list of all need not be built.
        let listed = (*scope_count < all).then(|| {
            list(scope, ends, ids);
            &ids[..]
        });
        let count = listed.map_or(all, <[u32]>::len);
        let id = |at: usize| listed.map_or(at as u32, |ids| ids[at]);
        match elements {
            Elements::Faces => {
                let faces = &topology.connectivity().faces;
                let key = |face: u32| {
                    let [a, b, c] = faces[face as usize].map(at);
                    a + b + c
                };
                radix.sort(count, id, key, range, cancel)
            }
            Elements::Cells => {
                let key = |cell: u32| {
                    let [a, b, c, d] = topology.tets[cell as usize].map(at);
                    (a + b) + (c + d)
                };
                radix.sort(count, id, key, range, cancel)
            }
        }
    }
}

const NOTHING: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

fn union([lo, hi]: [f32; 2], [a, b]: [f32; 2]) -> [f32; 2] {
    [lo.min(a), hi.max(b)]
}

/// The ids of a set, ascending.
pub(super) fn list(set: &IdSet, ends: &mut Vec<u32>, out: &mut Vec<u32>) {
    const WORDS: usize = CHUNK / 64;
    let chunks = set.words().par_chunks(WORDS);
    chunks.map(|words| words.iter().map(|word| word.count_ones()).sum()).collect_into_vec(ends);
    out.resize(accumulate(ends), 0);
    fill_parts(out, ends, &|chunk, part: &mut [u32]| {
        let words = (WORDS * chunk..).zip(set.words()[WORDS * chunk..].iter().take(WORDS));
        let faces = words.flat_map(|(at, &word)| bits(word).map(move |bit| 64 * at as u32 + bit));
        part.iter_mut().zip(faces).for_each(|(slot, face)| *slot = face);
    });
}

/// The indices of the set bits, ascending.
fn bits(mut word: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros();
        word &= word.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

fn copy(sorted: &[u32], out: &mut Vec<u32>) {
    out.resize(sorted.len(), 0);
    let parts = out.par_chunks_mut(CHUNK).zip(sorted.par_chunks(CHUNK));
    parts.for_each(|(out, sorted)| out.copy_from_slice(sorted));
}

/// The faces of `sorted` that are in a set, in their order.
fn filter(sorted: &[u32], set: &IdSet, ends: &mut Vec<u32>, out: &mut Vec<u32>) {
    let is_in = |face: &u32| u32::from(set.contains(*face));
    sorted.par_chunks(CHUNK).map(|faces| faces.iter().map(is_in).sum()).collect_into_vec(ends);
    out.resize(accumulate(ends), 0);
    fill_parts(out, ends, &|chunk, part: &mut [u32]| {
        let faces = sorted[CHUNK * chunk..].iter().take(CHUNK);
        let mut end = 0;
        for &face in faces {
            // Written in any case: a branch would be mispredicted every other time.
            if let Some(slot) = part.get_mut(end) {
                *slot = face;
            }
            end += usize::from(set.contains(face));
        }
    });
}

/// Turns lengths into end offsets; returns the last one.
fn accumulate(lengths: &mut [u32]) -> usize {
    let mut end = 0;
    for length in lengths {
        end += *length;
        *length = end;
    }
    end as usize
}
