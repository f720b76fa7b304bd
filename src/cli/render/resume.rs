//! `--resume`: which frames are there already.
//!
//! Every image has the fingerprint of what made it: a SHA-256 over the version of tetreel, the request (camera, transfer
//! function as nodes, size, mode, moment), what the file says of itself (time, field, units), the content of the mesh and of the steps shown, and how it is written. A file with
//! the same fingerprint that can be read to its end is the frame that would be rendered.

use super::plan::{Plan, PlannedFrame};
use crate::export::still::{FrameAttributes, read_fingerprint};
use crate::mesh::Mesh;
use crate::pipeline::FrameRequest;
use sha2::{Digest, Sha256};
use std::path::Path;

/// What all frames of a run have in common, and the content of its steps.
pub(super) struct Fingerprints {
    common: Sha256,
    /// Steps, ascending, and the checksums of their scalars.
    steps: Vec<(usize, u32)>,
}

impl Fingerprints {
    /// `checksums` are those of the plan's steps, in their order; `written_as` is how frames become files.
    pub(super) fn new(mesh: &Mesh, plan: &Plan, checksums: &[u32], written_as: &str) -> Self {
        let mut common = Sha256::new();
        common.update(FrameAttributes::SOFTWARE);
        let positions = &mesh.positions;
        let crcs = [
            crc32c::crc32c(bytemuck::cast_slice(&positions.local)),
            crc32c::crc32c(bytemuck::cast_slice(&mesh.topology.tets)),
        ];
        let counts = (positions.local.len(), mesh.topology.tets.len());
        common.update(format!("{:?} {} {crcs:?} {counts:?} {written_as}", positions.origin, positions.scale));
        Self { common, steps: plan.steps.iter().copied().zip(checksums.iter().copied()).collect() }
    }

    /// The fingerprint of a frame, hexadecimal.
    pub(super) fn of(
        &self,
        frame: &PlannedFrame,
        request: &FrameRequest,
        attributes: &FrameAttributes,
    ) -> anyhow::Result<String> {
        let mut hash = self.common.clone();
        hash.update(serde_json::to_vec(&(request, attributes))?);
        for step in [Some(frame.time.step()), frame.time.toward().map(|(next, _)| next)].into_iter().flatten() {
            let at = self.steps.binary_search_by_key(&step, |(step, _)| *step);
            hash.update(at.map_or(0, |i| self.steps[i].1).to_le_bytes());
        }
        Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    }
}

/// Whether `file` is a complete image with this fingerprint. A file that cannot be read is none.
pub(super) fn is_done(file: &Path, fingerprint: &str) -> bool {
    file.is_file() && read_fingerprint(file).is_ok_and(|found| found.as_deref() == Some(fingerprint))
}
