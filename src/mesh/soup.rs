//! Whether cells fit together, told by the faces that have no partner: two cells on both sides of it make a face an inner one.
//!
//! ```text
//! sample   every so many stretches of cells along the curve; all cells of a small mesh
//! faces    of the sampled cells, sorted; their vertices are marked
//! partners one pass over all cells: faces whose vertices are all marked are looked up and counted, each on its side
//! ```
//! 1. A cell has four faces, and is the partner of four others in the middle of a mesh. A soup, in which each cell has its own vertices, has
//!    none: all 4 n faces are alone.
//! 2. The shares of the stretches lie in 0..1, so that by Hoeffding the mean of m stretches drawn at random is off by more than 1/4 with a
//!    probability of at most 2 exp(-m / 8), which is 2.3e-7 for the [`LEAST`] there are. A share beyond 1/4 or 3/4 therefore decides whether
//!    more than half are alone; between, all faces are counted by deriving them.
//! 3. The same pass with vertices named by their positions tells cells that touch from those that do not: a face that is alone then is at
//!    the surface, at a gap or at a hanging node, and one of more than two cells, or of two on one side, belongs to cells that overlap.

use super::curve::{CurveKey, ascending};
use super::faces::{ascending_face, is_even};
use super::{FACE_VERTICES, Topology};
use crate::words::words;
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Whether an import derives and stores faces and neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ConnectivityChoice {
    /// No: the cells are drawn as points.
    None,
    /// Unless more than half of the cells' faces have no partner.
    #[default]
    Auto,
    /// Yes, whatever the cells are.
    Full,
}

words!(ConnectivityChoice, "there is no connectivity", ["none" = None, "auto" = Auto, "full" = Full]);

/// Cells of a stretch.
const STRETCH: usize = 4;
/// One of so many stretches is in the sample.
const EVERY: usize = 1000;
/// Least number of stretches in a sample that is not the whole.
const LEAST: usize = 128;
/// Meshes of fewer cells may be mostly surface, and connectivity costs them nothing: they are no soup.
const FEW: usize = 64;
/// Cells per task.
const CELLS_AT_ONCE: usize = 1 << 12;

/// What is known of the faces of cells that were imported without connectivity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Unconnected {
    /// Faces of cells that were looked at, each once for each of its cells: of all, or of a sample.
    pub faces: u64,
    /// Those of them without a partner: no other cell, or several, or one on the same side has the same three vertices.
    pub alone: u64,
    /// Those without a cell behind them even where vertices of one position are one: at the surface, at gaps and hanging nodes.
    pub open: u64,
    /// Those that lie, by positions, in more than two cells or twice on one side: of cells that overlap or are duplicates.
    pub overlapping: u64,
    /// Cells of all that have the corners of an earlier one, by positions.
    pub duplicates: u64,
}

impl Unconnected {
    /// What is known of the faces of a mesh that is to be without connectivity; `None`: it is to have it. The vertices are at `local`;
    /// `vertex_order` and `cell_order` have the curve keys of both.
    pub(super) fn find(
        choice: ConnectivityChoice,
        topology: &Topology,
        local: &[Vec3],
        [vertex_order, cell_order]: [&[CurveKey]; 2],
    ) -> Option<Self> {
        if choice == ConnectivityChoice::Full {
            return None;
        }
        let tets = &topology.tets[..];
        let sample = Sample::of(tets.len());
        let by_vertex = sample.count(tets, local.len(), |v| v);
        if choice == ConnectivityChoice::Auto && !by_vertex.are_of_soup(topology) {
            return None;
        }
        let place = places(local, vertex_order);
        let by_place = sample.count(tets, local.len(), |v| place[v as usize]);
        Some(Self {
            faces: by_vertex.faces,
            alone: by_vertex.alone(),
            open: by_place.single,
            overlapping: by_place.crowded,
            duplicates: duplicates(tets, &place, cell_order),
        })
    }
}

/// The cells of a sample, in runs.
struct Sample(Vec<Range<usize>>);

/// The faces of a sample's cells: all, those without another cell, and those of more than two cells or of two on one side.
struct Sides {
    faces: u64,
    single: u64,
    crowded: u64,
}

impl Sides {
    /// Number of faces without a partner.
    fn alone(&self) -> u64 {
        self.single + self.crowded
    }

    /// Whether more than half of the faces of all cells are alone, of [`FEW`] at least. Where a sample does not decide, connectivity is derived.
    fn are_of_soup(&self, topology: &Topology) -> bool {
        if topology.tets.len() < FEW {
            return false;
        }
        let (faces, alone, all) = (self.faces, self.alone(), 4 * topology.tets.len() as u64);
        if faces == all || 4 * alone < faces || 4 * alone > 3 * faces {
            return 2 * alone > faces;
        }
        2 * topology.connectivity().boundary_faces().count() as u64 > all
    }
}

impl Sample {
    /// Stretches at equal distances of so many cells in curve order.
    fn of(cells: usize) -> Self {
        let stretches = cells / STRETCH;
        let count = (stretches / EVERY).max(LEAST);
        if count >= stretches {
            return Self(std::iter::once(0..cells).collect());
        }
        let first = |n: usize| (n * stretches + stretches / 2) / count * STRETCH;
        Self((0..count).map(|n| first(n)..first(n) + STRETCH).collect())
    }

    /// Counts the faces whose vertices are the same when each is named by `name`, a number below `vertices`.
    fn count(&self, tets: &[[u32; 4]], vertices: usize, name: impl Fn(u32) -> u32 + Sync) -> Sides {
        let named = |tet: &[u32; 4]| tet.map(&name);
        let sampled = || self.0.iter().flat_map(|run| &tets[run.clone()]).map(named);
        let mut keys: Vec<[u32; 3]> = sampled().flat_map(|tet| (0..4).map(move |i| ascending_face(tet, i))).collect();
        let faces = keys.len() as u64;
        keys.par_sort_unstable();
        keys.dedup();
        let mut marks = vec![0u64; vertices.div_ceil(64)];
        keys.as_flattened().iter().for_each(|&v| marks[v as usize / 64] |= 1 << (v % 64));
        let is_marked = |v: u32| marks[v as usize / 64] >> (v % 64) & 1 == 1;
        // Cells on either side of each face.
        let counts: Vec<[AtomicU32; 2]> = keys.iter().map(|_| Default::default()).collect();
        tets.par_iter().with_min_len(CELLS_AT_ONCE).for_each(|tet| {
            let tet = named(tet);
            let marked = tet.map(is_marked);
            for i in (0..4).filter(|&i| FACE_VERTICES[i as usize].iter().all(|&v| marked[v])) {
                if let Ok(at) = keys.binary_search(&ascending_face(tet, i)) {
                    counts[at][usize::from(is_even(tet, i))].fetch_add(1, Relaxed);
                }
            }
        });
        let (mut single, mut crowded) = (0, 0);
        for tet in sampled() {
            for face in (0..4).map(|i| ascending_face(tet, i)) {
                let Ok(at) = keys.binary_search(&face) else { continue };
                match counts[at].each_ref().map(|count| count.load(Relaxed)) {
                    [1, 1] => {}
                    [1, 0] | [0, 1] => single += 1,
                    _ => crowded += 1,
                }
            }
        }
        Sides { faces, single, crowded }
    }
}

/// The first vertex at the position of each, in curve order with these keys.
fn places(local: &[Vec3], vertex_order: &[CurveKey]) -> Vec<u32> {
    // Adding zero turns -0 into +0.
    let bits = |v: u32| local[v as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut place: Vec<u32> = (0..local.len() as u32).collect();
    let mut first = 0;
    for group in vertex_order.chunk_by(|a, b| a.0 == b.0) {
        if group.len() > 1 {
            let mut vertices: Vec<u32> = (first..first + group.len() as u32).collect();
            vertices.sort_unstable_by_key(|&v| (bits(v), v));
            for of_place in vertices.chunk_by(|&a, &b| bits(a) == bits(b)) {
                of_place.iter().for_each(|&v| place[v as usize] = of_place[0]);
            }
        }
        first += group.len() as u32;
    }
    place
}

/// Number of cells, in curve order with these keys, that have the places of an earlier one: such cells share a key.
fn duplicates(tets: &[[u32; 4]], place: &[u32], cell_order: &[CurveKey]) -> u64 {
    let mut rest = tets;
    let mut found = 0;
    for group in cell_order.chunk_by(|a, b| a.0 == b.0) {
        let (cells, after) = rest.split_at(group.len().min(rest.len()));
        rest = after;
        if cells.len() > 1 {
            let mut corners: Vec<[u32; 4]> =
                cells.iter().map(|tet| ascending(tet.map(|v| place[v as usize]))).collect();
            corners.sort_unstable();
            found += corners.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64;
        }
    }
    found
}

#[cfg(test)]
#[path = "soup_tests.rs"]
mod tests;
