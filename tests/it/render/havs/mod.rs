//! The face renderer against the ray caster, and against a ray that is written out.

mod behaviour;
mod complete;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(feature = "gpu")]
mod gpu_behaviour;
mod oracle;
mod random;
mod samples;
mod some_faces;

use super::*;
use crate::meshes::noise;
use tetreel::mesh::NONE;
use tetreel::render::KBuffer;
use tetreel::render::cpu::havs::Havs;
use tetreel::visibility::Drawn;

/// The job with the faces of its active cells that `keep` keeps, and all at which active cells end.
pub fn with_faces(job: &RenderJob, keep: impl Fn(u32) -> bool) -> RenderJob {
    let topology = &job.mesh.topology;
    let is_active = |cell: u32| cell != NONE && job.active.contains(cell);
    let positions = &job.mesh.positions;
    let mut is_complete = true;
    let mut faces: Vec<(f64, u32)> = Vec::new();
    for (face, cells) in (0u32..).zip(&topology.connectivity().face_cells) {
        let [first, second] = cells.map(is_active);
        if first != second || first && keep(face) {
            let centroid: DVec3 =
                topology.connectivity().faces[face as usize].iter().map(|&v| positions.world(v as usize)).sum();
            faces.push((job.view.forward.dot(centroid), face));
        } else {
            is_complete &= !first;
        }
    }
    faces.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let faces = faces.into_iter().map(|(_, face)| face).collect();
    RenderJob { faces: Some(Arc::new(Drawn { ids: faces, is_complete })), ..job.clone() }
}

pub fn with_all_faces(job: &RenderJob) -> RenderJob {
    with_faces(job, |_| true)
}

/// The job with a share of its inner faces, drawn by lot.
pub fn with_some_faces(job: &RenderJob, share: f64, seed: u64) -> RenderJob {
    with_faces(job, |face| 0.5 + 0.5 * noise(seed, u64::from(face)) < share)
}

pub fn with_buffer(job: &RenderJob, k: u8, exact_order: bool) -> RenderJob {
    RenderJob { k_buffer: KBuffer { k, exact_order }, ..job.clone() }
}

pub fn havs(job: &RenderJob) -> tetreel::render::Frame {
    Havs::new().render(job.clone()).unwrap().clone()
}
