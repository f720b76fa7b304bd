//! Clusters of cells and vertices, for decisions about many at once.
//!
//! Cells and vertices are in the order of a space-filling curve, so successive ones are near each other: a cluster has a small box and few
//! neighbours.

use super::Label;
use crate::mesh::Mesh;
use crate::slowdown::{Slow, waste};
use glam::Vec3;
use rayon::prelude::*;

/// The clusters of a mesh: bounding boxes, and which vertex clusters each uses. Made once per mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clusters {
    /// Bounding box of each cluster of cells: least and greatest local coordinates.
    pub(super) boxes: Vec<[Vec3; 2]>,
    /// The clusters of vertices that cluster c of cells uses, ascending: `used[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    used: Vec<u32>,
    /// Pairs of vertex clusters with a cell in common, the lower one first.
    pairs: Vec<[u32; 2]>,
    pub(super) vertices: usize,
}

impl Clusters {
    /// Number of successive cells in a cluster (the last may have fewer); a multiple of 64, the cells in a word of a set.
    pub const CELLS: usize = 4096;
    /// Number of vertices in a cluster; a mesh has five or six times as many cells as vertices.
    pub const VERTICES: usize = 256;
    /// Number of successive scalars that are decoded or left out together: those of a cluster of vertices, or of as many cells.
    pub const SCALARS: usize = Self::VERTICES;

    /// Clusters the cells and vertices of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let local = &mesh.positions.local;
        let of_cluster = |tets: &[[u32; 4]]| {
            let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
            let corners = tets.iter().flatten().map(|&v| local[v as usize]);
            (corners.fold(nothing, |[least, greatest], p| [least.min(p), greatest.max(p)]), of_cells(tets))
        };
        let clusters: Vec<_> = mesh.topology.tets.par_chunks(Self::CELLS).map(of_cluster).collect();
        let mut all = Self { starts: vec![0], vertices: local.len(), ..Self::default() };
        for (bounds, (used, pairs)) in clusters {
            all.boxes.push(bounds);
            all.used.extend(used);
            all.starts.push(all.used.len() as u32);
            all.pairs.extend(pairs);
        }
        all.pairs.sort_unstable();
        all.pairs.dedup();
        all
    }

    /// Number of clusters of cells.
    pub fn count(&self) -> usize {
        self.boxes.len()
    }

    /// Number of clusters of vertices.
    pub fn vertex_clusters(&self) -> usize {
        self.vertices.div_ceil(Self::VERTICES)
    }

    /// Number of vertices in a vertex cluster.
    pub fn vertices_in(&self, cluster: usize) -> usize {
        Self::VERTICES.min(self.vertices - cluster * Self::VERTICES)
    }

    /// The vertex clusters used by the cells of a cluster.
    pub fn of_cluster(&self, cluster: usize) -> &[u32] {
        &self.used[self.starts[cluster] as usize..self.starts[cluster + 1] as usize]
    }

    /// Whether the scalars of each vertex cluster are needed, given the common label of its scalars, if they have one. A visible cell has
    /// vertices in clusters without a label, or in clusters with different labels: these are needed.
    ///
    /// # Panics
    /// If there is not one entry per vertex cluster.
    pub fn needed_scalars(&self, labels: &[Option<Label>]) -> Vec<bool> {
        assert_eq!(labels.len(), self.vertex_clusters(), "one label per cluster");
        let mut needed: Vec<bool> = labels.iter().map(Option::is_none).collect();
        for &[a, b] in &self.pairs {
            if labels[a as usize] != labels[b as usize] {
                (needed[a as usize], needed[b as usize]) = (true, true);
            }
        }
        needed
    }
}

/// The vertex clusters used by some cells, ascending, and the pairs that have a cell in common.
fn of_cells(cells: &[[u32; 4]]) -> (Vec<u32>, Vec<[u32; 2]>) {
    // Each cluster is also paired with itself.
    let (mut pairs, mut recent) = (Vec::new(), [[u32::MAX; 2]; RECENT]);
    let mut push = |pair: [u32; 2]| {
        let slot = &mut recent[(pair[0].wrapping_mul(31) ^ pair[1]) as usize % RECENT];
        if std::mem::replace(slot, pair) != pair {
            pairs.push(pair);
        }
    };
    for tet in cells {
        let mut clusters = tet.map(|v| v / Clusters::VERTICES as u32);
        clusters.sort_unstable();
        for (at, &b) in clusters.iter().enumerate() {
            push([b, b]);
            clusters[..at].iter().for_each(|&a| push([a, b]));
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    let used = pairs.iter().filter(|[a, b]| a == b).map(|[a, _]| *a).collect();
    pairs.retain(|[a, b]| a != b);
    waste(Slow::FirstFrame, cells.len());
    (used, pairs)
}

/// Number of recent pairs to compare with: successive cells share pairs, so few are left to sort.
const RECENT: usize = 256;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_meshes::Random;
    use std::collections::BTreeSet;

    #[test]
    fn clusters_and_pairs_are_those_of_all_cells() {
        let mut random = Random::new(7);
        for spread in [1, 3, 40, 4000] {
            let vertices = spread * Clusters::VERTICES;
            let cells: Vec<[u32; 4]> = (0..3000).map(|_| [0; 4].map(|_: u32| random.below(vertices) as u32)).collect();
            let (used, pairs) = of_cells(&cells);
            let of = |tet: &[u32; 4]| tet.map(|v| v / Clusters::VERTICES as u32);
            let all: BTreeSet<u32> = cells.iter().flat_map(of).collect();
            let both = cells.iter().flat_map(|tet| of(tet).into_iter().flat_map(move |a| of(tet).map(|b| [a, b])));
            let all_pairs: BTreeSet<[u32; 2]> = both.filter(|[a, b]| a < b).collect();
            assert_eq!(used, Vec::from_iter(all), "{spread} clusters");
            assert_eq!(pairs, Vec::from_iter(all_pairs), "{spread} clusters");
        }
    }
}
