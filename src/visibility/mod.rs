//! What a scene does not need, and the order of what it does: active cells, faces by depth.

mod cell_set;
mod depth_order;
mod drawn_faces;
mod face_selection;
#[cfg(test)]
mod order_tests;
mod parts;
mod pool;
mod radix;

pub use cell_set::CellSet;
pub use depth_order::DepthOrder;
pub use drawn_faces::DrawnFaces;
pub use face_selection::FaceSelection;
pub use pool::Pool;
pub use radix::ascending_bits;

use crate::mesh::Topology;
use crate::task::Cancel;
use rayon::prelude::*;

/// Scalars that a thread looks at between two looks at the flag that cancels.
const SCALARS_AT_ONCE: usize = 64 * 1024;

/// The cells whose four scalars are finite: NaN and infinity are holes in the field (`scalars`: one per vertex).
pub fn finite_cells(topology: &Topology, scalars: &[f32]) -> CellSet {
    // Nobody cancels this one.
    finite_cells_unless(topology, scalars, &Cancel::new()).unwrap_or_else(|| CellSet::none(topology.tets.len()))
}

/// The same, unless `cancel` is raised before it is done.
pub fn finite_cells_unless(topology: &Topology, scalars: &[f32], cancel: &Cancel) -> Option<CellSet> {
    let is_finite = |values: &[f32]| !cancel.is_cancelled() && values.iter().all(|s| s.is_finite());
    let set = if scalars.par_chunks(SCALARS_AT_ONCE).all(is_finite) {
        CellSet::all(topology.tets.len())
    } else {
        CellSet::of(topology.tets.len(), |cell| {
            !cancel.is_cancelled() && topology.tets[cell].iter().all(|&v| scalars[v as usize].is_finite())
        })
    };
    (!cancel.is_cancelled()).then_some(set)
}
