//! What a scene does not need: the set of active cells.

mod cell_set;

pub use cell_set::CellSet;

use crate::mesh::Topology;

/// The cells whose four scalars are finite: NaN and infinity are holes in the field (`scalars`: one per vertex).
pub fn finite_cells(topology: &Topology, scalars: &[f32]) -> CellSet {
    let cells = topology.tets.len();
    if scalars.iter().all(|s| s.is_finite()) {
        return CellSet::all(cells);
    }
    let mut set = CellSet::none(cells);
    for (cell, tet) in (0u32..).zip(&topology.tets) {
        set.set(cell, tet.iter().all(|&v| scalars[v as usize].is_finite()));
    }
    set
}
