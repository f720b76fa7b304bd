//! Which cell of a face a ray enters.

use crate::mesh::{Connectivity, FACE_VERTICES, Mesh, NONE, Topology};
use crate::visibility::{CellSet, IdSet};
use std::sync::Arc;

/// The faces whose first cell a ray enters that sees their ascending corners counter-clockwise. Depends on the mesh alone,
/// and is kept from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Sides {
    of: Option<Arc<Mesh>>,
    outward: IdSet,
}

impl Sides {
    pub(super) fn update(&mut self, mesh: &Arc<Mesh>) {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, mesh)) {
            return;
        }
        let topology = &mesh.topology;
        self.outward = IdSet::of(topology.connectivity().faces.len(), |face| is_outward(topology, face));
        self.of = Some(mesh.clone());
    }

    /// The active cells in front of a face and behind it for a ray that sees its ascending corners counter-clockwise; [`NONE`] where
    /// there is none.
    #[inline(always)]
    pub(super) fn cells(&self, connectivity: &Connectivity, active: &CellSet, face: u32) -> [u32; 2] {
        let cells = connectivity.face_cells[face as usize];
        let [first, second] = cells.map(|cell| if cell != NONE && active.contains(cell) { cell } else { NONE });
        if self.outward.contains(face) { [second, first] } else { [first, second] }
    }
}

/// Whether the ascending corners of a face are counter-clockwise seen from outside of its first cell.
pub(in crate::render) fn is_outward(topology: &Topology, face: usize) -> bool {
    let Connectivity { faces, face_cells, .. } = topology.connectivity();
    let corners = faces[face];
    let tet = topology.tets[face_cells[face][0] as usize];
    let opposite = (0..4).find(|&i| !corners.contains(&tet[i])).unwrap_or(0);
    let [a, b, c] = FACE_VERTICES[opposite].map(|i| tet[i]);
    ((a > b) ^ (b > c)) == (a > c)
}
