//! The faces through which rays may enter the active cells, binned into tiles.
//!
//! The faces are found cluster by cluster (cells that are successive along the curve), from the words of the bit set. They are then cut
//! into chunks of clusters that depend on the faces alone; each chunk has its own lists for all tiles, filled by one thread. A tile reads
//! the chunks one after the other, in the order of the cells, however many threads there are.

use super::super::raster::boxes::{Bounds, BoxSource};
use super::super::raster::lists::{ListedFace, Seen, SeenItem, TileFace, TileLists};
use super::super::ray::{Crossing, Ray, ViewVertex, crossing, is_needed};
use super::super::tiles::{TILE_PX, TileGrid};
use super::entry_faces::EntryFaces;
use crate::camera::View;
use crate::mesh::{CellNeighbour, FACE_VERTICES, Mesh, Topology};
use crate::task::Cancel;
use crate::visibility::{CellSet, Clusters};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Words of a cell set per cluster.
pub(super) const CLUSTER_WORDS: usize = Clusters::CELLS / 64;

/// A face of an active cell with no active cell behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) struct EntryFace {
    /// Corner vertices, counter-clockwise as seen from outside the cell.
    pub(in crate::render::cpu) vertices: [u32; 3],
    pub(in crate::render) cell: u32,
    /// The vertex of the cell (0..4) that is not on the face.
    pub(in crate::render) opposite: u32,
}

/// All entry faces, in the order of their cells; only some of them if `cancel` is raised.
pub(in crate::render) fn collect(topology: &Topology, active: &CellSet, cancel: &Cancel, out: &mut Vec<EntryFace>) {
    out.clear();
    out.par_extend((0..cluster_count(active)).into_par_iter().flat_map_iter(|cluster| {
        let mut found = Vec::new();
        if !cancel.is_cancelled() {
            each_open_face(topology, active, cluster, |cell, i| found.push(face_of(topology, cell, i)));
        }
        found
    }));
}

pub(super) fn cluster_count(cells: &CellSet) -> usize {
    cells.words().len().div_ceil(CLUSTER_WORDS)
}

/// Calls `open` with each face (cell and local face index) of a cluster between an active cell and an inactive one or the outside.
#[inline(always)]
pub(super) fn each_open_face(topology: &Topology, active: &CellSet, cluster: usize, mut open: impl FnMut(u32, usize)) {
    let (words, neighbours) = (active.words(), &topology.connectivity().neighbours);
    let first = cluster * CLUSTER_WORDS;
    for (at, &word) in (first..).zip(&words[first..words.len().min(first + CLUSTER_WORDS)]) {
        let mut rest = word;
        while rest != 0 {
            let cell = 64 * at + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            open_faces(neighbours, active, cell, &mut open);
        }
    }
}

/// Calls `open` with each such face of an active cell.
#[inline(always)]
pub(super) fn open_faces(
    neighbours: &[[CellNeighbour; 4]],
    active: &CellSet,
    cell: usize,
    mut open: impl FnMut(u32, usize),
) {
    for (i, neighbour) in neighbours[cell].iter().enumerate() {
        // A missing neighbour lies beyond the last word.
        let other = (neighbour.0 >> 2) as usize;
        let is_active = active.words().get(other / 64).is_some_and(|word| word >> (other % 64) & 1 == 1);
        if !is_active {
            open(cell as u32, i);
        }
    }
}

/// Estimated number of faces between a cell of `active` and one of `finite` that is not active: counted on a sample of the clusters, if
/// there are many.
pub(super) fn count_beside(topology: &Topology, active: &CellSet, finite: &CellSet) -> usize {
    const ENOUGH: usize = 32;
    let every = (cluster_count(active) / ENOUGH).max(1);
    let neighbours = &topology.connectivity().neighbours;
    let in_cluster = |cluster| {
        let mut count = 0;
        each_open_face(topology, active, cluster, |cell, i| {
            let beside = neighbours[cell as usize][i].cell();
            count += usize::from(beside.is_some_and(|n| finite.contains(n)));
        });
        count
    };
    every * (0..cluster_count(active)).into_par_iter().step_by(every).map(in_cluster).sum::<usize>()
}

/// Face `opposite` of a cell.
pub(in crate::render::cpu) fn face_of(topology: &Topology, cell: u32, opposite: usize) -> EntryFace {
    let tet = topology.tets[cell as usize];
    EntryFace { vertices: FACE_VERTICES[opposite].map(|v| tet[v]), cell, opposite: opposite as u32 }
}

/// Active cells that may contain the eye, for rays that start inside the volume. A ray starts in one of them if it is
/// behind the eye where it enters the cell and not where it leaves it; both are computed as for any other face, so that
/// entries in front of the eye and starts around it complement each other. `tolerance`, local units, is more than view
/// coordinates are rounded by: a cell too many only costs time.
pub(in crate::render) fn cells_at_eye(mesh: &Mesh, active: &CellSet, local_view: &View, tolerance: f64) -> Vec<u32> {
    // The local box lies within [-1, 1]: an eye outside needs no search.
    if !local_view.perspective || local_view.eye.abs().max_element() > 1.0 + tolerance {
        return Vec::new();
    }
    mesh.cells_near(local_view.eye, tolerance).into_iter().filter(|&cell| active.contains(cell)).collect()
}

/// The entry and exit of a ray in a cell with the eye in it.
pub(in crate::render::cpu) struct EyeCell {
    /// Crossing behind the eye, or at it.
    pub(in crate::render::cpu) entry: Crossing,
    /// The vertex of the cell (0..4) that is not on the face of the entry.
    pub(in crate::render::cpu) opposite: u32,
    /// Crossing in front of the eye.
    pub(in crate::render::cpu) exit: Crossing,
}

impl EyeCell {
    /// `None` if the ray does not enter the cell behind (or at) the eye and leave it in front.
    pub(in crate::render::cpu) fn new(
        topology: &Topology,
        vertices: &[ViewVertex],
        ray: &Ray,
        cell: u32,
    ) -> Option<Self> {
        let (mut start, mut end) = (None, None);
        for opposite in 0..4 {
            let face = face_of(topology, cell, opposite);
            let [p, q, r] = face.vertices;
            if let Some(c) = crossing(ray, vertices, [p, q, r]) {
                start = (!c.is_in_front([p, q, r])).then_some((c, face.opposite));
            } else if let Some(c) = crossing(ray, vertices, [p, r, q]) {
                end = c.is_in_front([p, r, q]).then_some(c);
            }
        }
        let ((entry, opposite), exit) = (start?, end?);
        Some(Self { entry, opposite, exit })
    }
}

/// Smallest number of faces per chunk: enough to hide the cost of its lists.
const CHUNK_MIN: usize = 4 * 1024;
/// Largest number of chunks: each has a counter for every tile.
const CHUNKS_MAX: usize = 128;

/// For each tile the entry faces whose pixel box overlaps it.
#[derive(Debug, Default)]
pub(super) struct EntryBins {
    pub(super) grid: TileGrid,
    /// The clusters of each chunk.
    parts: Vec<Range<usize>>,
    /// Tile lists per chunk; may be more than `parts`.
    chunks: Vec<TileLists<ListedFace>>,
    /// Scratch memory per thread.
    seen: Vec<Mutex<Seen<ListedFace>>>,
}

impl EntryBins {
    /// The list of a chunk for a tile; `None` if there is no such chunk.
    #[inline]
    pub(super) fn list(&self, chunk: usize, tile: usize) -> Option<&[TileFace]> {
        (chunk < self.parts.len()).then(|| self.chunks[chunk].items(tile))
    }

    /// Whether the box of an entry face that may be seen from its front overlaps some columns and rows of pixels.
    ///
    /// Faces so small in the image that f32 leaves their side uncertain are listed from behind, too; decisions that must equal the GPU's
    /// ignore these. Twin: `shaders/lib/close_boxes.wgsl`.
    pub(super) fn reach(
        &self,
        columns: Range<usize>,
        rows: Range<usize>,
        is_back_facing: impl Fn([u32; 3]) -> bool,
    ) -> bool {
        let tiles = |pixels: &Range<usize>| pixels.start / TILE_PX..(pixels.end - 1) / TILE_PX + 1;
        let meet = |face: &TileFace, [x, y]: [usize; 2]| {
            let Bounds { x0, x1, y0, y1 } = face.bounds();
            x + x0 < columns.end && columns.start < x + x1 && y + y0 < rows.end && rows.start < y + y1
        };
        tiles(&rows).any(|row| {
            tiles(&columns).any(|column| {
                let tile = row * self.grid.columns + column;
                let mut faces = self.chunks[..self.parts.len()].iter().flat_map(|chunk| chunk.items(tile));
                faces.any(|face| meet(face, [column * TILE_PX, row * TILE_PX]) && !is_back_facing(face.item.ids))
            })
        })
    }

    /// Sorts the entry faces of `needed` clusters of cells, or of all, into the tiles of a view; only some of them if `cancel` is raised.
    pub(super) fn fill(&mut self, source: BoxSource<'_>, faces: &EntryFaces, needed: Option<&[bool]>, cancel: &Cancel) {
        self.grid = TileGrid::of(source.view);
        let least = faces.count().div_ceil(CHUNKS_MAX).max(CHUNK_MIN);
        self.parts.clear();
        let (mut begin, mut count) = (0, 0);
        for (end, cluster) in (1..).zip(&faces.clusters) {
            count += if is_needed(needed, end - 1) { cluster.len() } else { 0 };
            if count >= least || end == faces.clusters.len() {
                self.parts.push(begin..end);
                (begin, count) = (end, 0);
            }
        }
        if self.chunks.len() < self.parts.len() {
            self.chunks.resize_with(self.parts.len(), TileLists::default);
        }
        self.seen.resize_with(rayon::current_num_threads(), Mutex::default);
        let (grid, seen) = (self.grid, &self.seen);
        self.chunks.par_iter_mut().zip(&self.parts).for_each(|(lists, part)| {
            // Each thread of the pool has its own: the lock is never contended.
            let seen = &seen[rayon::current_thread_index().unwrap_or(0) % seen.len()];
            let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
            lists.begin(grid);
            seen.clear();
            if !cancel.is_cancelled() {
                let needed = part.clone().filter(|&cluster| is_needed(needed, cluster));
                for face in needed.flat_map(|cluster| &faces.clusters[cluster]) {
                    if let Some(bounds) = source.bounds_from_front(face.ids) {
                        seen.push(SeenItem { item: *face, bounds, nearest: source.nearest(face.ids) });
                        lists.count(bounds);
                    }
                }
            }
            lists.store(&seen);
        });
    }
}
