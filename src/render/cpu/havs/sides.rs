//! Which cell of a face a ray enters.

use crate::mesh::{FACE_VERTICES, Mesh, NONE, Topology};
use crate::visibility::CellSet;
use rayon::prelude::*;
use std::sync::Arc;

/// One bit per face: whether a ray that sees its ascending corners counter-clockwise enters its first cell. Depends on the mesh alone,
/// and is kept from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Sides {
    of: Option<Arc<Mesh>>,
    bits: Vec<u64>,
}

impl Sides {
    pub(super) fn update(&mut self, mesh: &Arc<Mesh>) {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, mesh)) {
            return;
        }
        let topology = &mesh.topology;
        let word = |at: usize| {
            let faces = 64 * at..topology.faces.len().min(64 * at + 64);
            faces.fold(0, |word, face| word | u64::from(is_outward(topology, face)) << (face % 64))
        };
        let words = topology.faces.len().div_ceil(64);
        (0..words).into_par_iter().with_min_len(64).map(word).collect_into_vec(&mut self.bits);
        self.of = Some(mesh.clone());
    }

    /// The active cells in front of a face and behind it for a ray that sees its ascending corners counter-clockwise; [`NONE`] where
    /// there is none.
    #[inline(always)]
    pub(super) fn cells(&self, topology: &Topology, active: &CellSet, face: u32) -> [u32; 2] {
        let cells = topology.face_cells[face as usize];
        let [first, second] = cells.map(|cell| if cell != NONE && active.contains(cell) { cell } else { NONE });
        let enters_first = self.bits[face as usize / 64] >> (face % 64) & 1 == 1;
        if enters_first { [second, first] } else { [first, second] }
    }
}

/// Whether the ascending corners of a face are counter-clockwise seen from outside of its first cell.
pub(in crate::render) fn is_outward(topology: &Topology, face: usize) -> bool {
    let corners = topology.faces[face];
    let tet = topology.tets[topology.face_cells[face][0] as usize];
    let opposite = (0..4).find(|&i| !corners.contains(&tet[i])).unwrap_or(0);
    let [a, b, c] = FACE_VERTICES[opposite].map(|i| tet[i]);
    ((a > b) ^ (b > c)) == (a > c)
}
