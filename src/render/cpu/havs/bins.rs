//! The faces whose boxes overlap each tile, in list order.
//!
//! The list is cut into chunks that depend on its length alone; each chunk has its own lists for all tiles, filled by one thread (count,
//! scan, fill). A tile reads the chunks one after the other, in list order, however many threads there are.

use super::super::raster::boxes::BoxSource;
use super::super::raster::lists::{ListedFace, Seen, TileFace, TileLists, below};
use super::super::tiles::TileGrid;
use super::sides::Sides;
use crate::mesh::Mesh;
use crate::render::RenderJob;
use crate::visibility::{CellSet, DrawnFaces};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Smallest number of faces per chunk: enough to hide the cost of its lists.
const CHUNK_MIN: usize = 4 * 1024;
/// Largest number of chunks: each has a counter for every tile.
const CHUNKS_MAX: usize = 128;

/// For each tile the faces whose box overlaps it.
#[derive(Debug, Default)]
pub(super) struct FaceBins {
    pub(super) grid: TileGrid,
    chunks: Vec<TileLists>,
    used: usize,
    /// Scratch memory per thread.
    seen: Vec<Mutex<Seen>>,
    /// Least corner depth of all faces from each chunk on, rounded to f32.
    nearest_from: Vec<f32>,
}

/// The faces of a list in its order, copied from scattered memory of the mesh and kept as long as the list is drawn.
#[derive(Debug, Default)]
pub(super) struct FaceList {
    of: Option<(Arc<Mesh>, Arc<DrawnFaces>, Arc<CellSet>)>,
    faces: Vec<ListedFace>,
}

impl FaceBins {
    pub(super) fn chunk_count(&self) -> usize {
        self.used
    }

    /// The faces of a chunk that may cover a tile.
    pub(super) fn faces(&self, chunk: usize, tile: usize) -> &[TileFace] {
        self.chunks[chunk].faces(tile)
    }

    /// Whether a face may cover a tile.
    pub(super) fn has_faces(&self, tile: usize) -> bool {
        self.chunks[..self.used].iter().any(|lists| !lists.faces(tile).is_empty())
    }

    /// Lower bound on the depth of the faces from this chunk on; infinite behind the last chunk.
    pub(super) fn nearest_from(&self, chunk: usize) -> f64 {
        below(self.nearest_from[chunk])
    }

    /// Sorts the faces `drawn` of a job into tiles; only some of them if it is cancelled.
    pub(super) fn fill(
        &mut self,
        source: BoxSource<'_>,
        (list, sides): (&mut FaceList, &Sides),
        job: &RenderJob,
        drawn: &Arc<DrawnFaces>,
    ) {
        self.grid = TileGrid::of(source.view);
        let (grid, count) = (self.grid, drawn.faces.len());
        let length = count.div_ceil(CHUNKS_MAX).max(CHUNK_MIN);
        self.used = count.div_ceil(length);
        if self.chunks.len() < self.used {
            self.chunks.resize_with(self.used, TileLists::default);
        }
        self.seen.resize_with(rayon::current_num_threads(), Mutex::default);
        let seen = &self.seen;
        let find = list.begin(job, drawn).then_some((&job.mesh.topology, &*job.active, sides));
        self.nearest_from.clear();
        self.nearest_from.resize(self.used + 1, f32::INFINITY);
        let chunks = self.chunks[..self.used].par_iter_mut().zip(&mut self.nearest_from);
        let faces = list.faces.par_chunks_mut(length).zip(drawn.faces.par_chunks(length));
        chunks.zip(faces).for_each(|((lists, nearest), (faces, drawn))| {
            if job.cancel.is_cancelled() {
                lists.fill(source, grid, &[], &mut Vec::new());
                return;
            }
            if let Some((topology, active, sides)) = find {
                for (listed, &face) in faces.iter_mut().zip(drawn) {
                    let cells = sides.cells(topology, active, face);
                    *listed = ListedFace { ids: topology.faces[face as usize], cells };
                }
            }
            // Each thread of the pool has its own: the lock is never contended.
            let seen = &seen[rayon::current_thread_index().unwrap_or(0) % seen.len()];
            *nearest = lists.fill(source, grid, faces, &mut seen.lock().unwrap_or_else(PoisonError::into_inner));
        });
        if job.cancel.is_cancelled() {
            // Cancelled, perhaps before all faces were found.
            list.of = None;
        }
        for chunk in (0..self.used).rev() {
            self.nearest_from[chunk] = self.nearest_from[chunk + 1].min(self.nearest_from[chunk]);
        }
    }
}

impl FaceList {
    /// Makes room for the faces `drawn` of a job; true if they are still to be found.
    fn begin(&mut self, job: &RenderJob, drawn: &Arc<DrawnFaces>) -> bool {
        let is_kept = self.of.as_ref().is_some_and(|(mesh, faces, active)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(faces, drawn) && Arc::ptr_eq(active, &job.active)
        });
        self.faces.resize(drawn.faces.len(), ListedFace::default());
        self.of = Some((job.mesh.clone(), drawn.clone(), job.active.clone()));
        !is_kept
    }
}
