//! The faces of a mesh, and the cells at the eye, on the GPU.

use crate::camera::View;
use crate::mesh::{Connectivity, FACE_VERTICES, Mesh};
use crate::render::cpu::havs::is_outward;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::eye;
use crate::render::gpu::layout::{EYE_WORDS, FACE_WORDS};
use crate::render::gpu::resources::Resource;
use crate::render::{RenderError, RenderJob};
use std::sync::Arc;

/// Bindings for faces in the shaders.
const PARTS: usize = 3;
/// Bytes of a face.
const FACE_BYTES: u64 = 4 * FACE_WORDS as u64;

/// The faces of a mesh.
pub(super) struct FaceBuffers {
    of: Option<Arc<Mesh>>,
    pub(super) parts: [GrowingBuffer; PARTS],
    /// Faces per part.
    pub(super) part: usize,
}

impl FaceBuffers {
    pub(super) fn new() -> Self {
        Self { of: None, parts: Resource::FACES.map(GrowingBuffer::new), part: 0 }
    }

    /// Uploads the faces of a mesh unless they are there. Returns whether a buffer was made, and the bytes sent.
    pub(super) fn upload(&mut self, context: &Context, mesh: &Arc<Mesh>) -> Result<(bool, u64), RenderError> {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, mesh)) {
            return Ok((false, 0));
        }
        self.of = None;
        let faces = mesh.topology.connectivity().faces.len();
        let part = usize::try_from(context.binding_bytes() / FACE_BYTES).unwrap_or(usize::MAX).min(1 << 31);
        if faces.div_ceil(part.max(1)) > PARTS {
            return Err(context.beyond(format!("a mesh of {faces} faces is too large for it")));
        }
        self.part = part.max(1);
        let (mut made, mut sent) = (false, 0);
        for (at, buffer) in self.parts.iter_mut().enumerate() {
            let range = (at * self.part).min(faces)..((at + 1) * self.part).min(faces);
            let (new, bytes) = buffer.upload_packed(context, range, |face| pack(mesh, face))?;
            (made, sent) = (made | new, sent + bytes);
        }
        self.of = Some(mesh.clone());
        Ok((made, sent))
    }
}

/// The words of a face: corners, ascending; the cells in front of it and behind it for a ray that sees them counter-clockwise.
fn pack(mesh: &Mesh, face: usize) -> [u32; FACE_WORDS] {
    let topology = &mesh.topology;
    let Connectivity { faces, face_cells, .. } = topology.connectivity();
    let ([a, b, c], [first, second]) = (faces[face], face_cells[face]);
    let [front, behind] = if is_outward(topology, face) { [second, first] } else { [first, second] };
    [a, b, c, front, behind]
}

/// The cells in which a ray may begin, in the layout of `shaders/lib/list_params.wgsl`.
pub(super) fn eye_cells(job: &RenderJob, local_view: &View) -> Vec<[u32; EYE_WORDS]> {
    eye::cells(job, local_view).into_iter().map(|cell| eye_cell(job, local_view, cell)).collect()
}

fn eye_cell(job: &RenderJob, local_view: &View, cell: u32) -> [u32; EYE_WORDS] {
    let topology = &job.mesh.topology;
    let tet = topology.tets[cell as usize];
    let mut order = [0, 1, 2, 3];
    order.sort_by_key(|&i| tet[i]);
    let sides = eye::sides(job, local_view, cell);
    let mut bits = 0;
    for (i, &opposite) in order.iter().enumerate() {
        let is_outside = sides >> opposite & 1;
        let is_inside = sides >> (4 + opposite) & 1;
        let neighbour = topology.connectivity().neighbours[cell as usize][opposite].cell();
        let is_open = u32::from(neighbour.is_none_or(|n| !job.active.contains(n)));
        // Counter-clockwise seen from outside, where a ray enters.
        let [a, b, c] = FACE_VERTICES[opposite].map(|v| tet[v]);
        let enters = u32::from(((a > b) ^ (b > c)) == (a > c));
        bits |= is_outside << i | is_inside << (4 + i) | is_open << (8 + i) | enters << (12 + i);
    }
    let [a, b, c, d] = order.map(|i| tet[i]);
    [cell, bits, a, b, c, d]
}
