//! Culling and order: which cells and faces a frame needs, and faces by depth.

mod active;
mod clusters;
mod cut_cells;
mod depth_order;
mod drawn;
mod id_set;
mod moved;
#[cfg(test)]
mod order_tests;
mod outside;
mod part_cells;
mod parts;
mod pool;
mod radix;
mod restricted;
mod selection;
mod skip;
mod transparent;

pub use active::{ActiveCells, Activity};
pub use clusters::Clusters;
pub use cut_cells::{CutCells, CutPlanes};
pub use depth_order::{DepthOrder, Elements};
pub use drawn::Drawn;
pub use id_set::{CellSet, IdSet};
pub use outside::NeededClusters;
pub use part_cells::PartCells;
pub use pool::Pool;
pub use radix::ascending_bits;
pub use restricted::Restricted;
pub use selection::Selection;
pub use skip::Skip;
pub use transparent::{HOLE, Label, TransparentIntervals, VISIBLE};

use crate::mesh::Topology;

/// The cells whose four scalars are finite: NaN and infinity are holes in the field (`scalars`: one per vertex).
pub fn finite_cells(topology: &Topology, scalars: &[f32]) -> CellSet {
    CellSet::of(topology.tets.len(), |cell| topology.tets[cell].iter().all(|&v| scalars[v as usize].is_finite()))
}
