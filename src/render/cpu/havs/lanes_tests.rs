//! Rounds, and eight rays side by side, against one after the other.

use super::super::points::lanes_tests::job_of;
use super::*;
use crate::mesh::NONE;
use crate::mesh::test_meshes::Random;
use crate::render::{KBuffer, Planes, Renderer};
use crate::visibility::Drawn;

/// A frame, and what was counted in it.
fn counted(renderer: &mut Havs, job: &RenderJob) -> (Planes, [u64; 7]) {
    let Frame { planes, stats, .. } = renderer.render(job.clone()).unwrap().clone();
    let counts = [stats.fragments, stats.segments, stats.rays_hit, stats.rays_stopped_early, stats.out_of_order];
    let [fragments, segments, hit, early, late] = counts;
    (planes, [fragments, segments, hit, early, late, stats.pixels_resolved_again, stats.faces_hidden])
}

/// The job with the faces of its active cells, a share of those between two; front to back, or back to front.
fn with_faces(job: &RenderJob, share: f64, is_reversed: bool, random: &mut Random) -> RenderJob {
    let connectivity = job.mesh.topology.connectivity();
    let is_active = |cell: u32| cell != NONE && job.active.contains(cell);
    let mut ids = Vec::new();
    let mut is_complete = true;
    for (face, cells) in (0u32..).zip(&connectivity.face_cells) {
        let [first, second] = cells.map(is_active);
        let is_kept = first != second || first && random.below(1000) < (1000.0 * share) as usize;
        is_complete &= is_kept || !first;
        ids.extend(is_kept.then_some(face));
    }
    let depth = |face: &u32| {
        let corners = connectivity.faces[*face as usize].map(|v| job.mesh.positions.local[v as usize].as_dvec3());
        job.view.forward.dot(corners.into_iter().sum()) * if is_reversed { -1.0 } else { 1.0 }
    };
    ids.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
    RenderJob { faces: Some(Arc::new(Drawn { ids, is_complete })), ..job.clone() }
}

/// Jobs of all kinds: whole, torn and overlapping meshes, all faces and some, in exact order and in that of small buffers.
fn jobs() -> Vec<RenderJob> {
    let mut random = Random::new(26);
    let mut jobs = Vec::new();
    for case in 0..48 {
        let job = job_of(case, &mut random);
        let job = with_faces(&job, [1.0, 0.6][case / 24], case % 11 == 5, &mut random);
        let k_buffer = KBuffer { k: [2, 8, 3][case % 3], exact_order: case % 4 != 3 };
        jobs.push(RenderJob { k_buffer, ..job });
    }
    jobs
}

#[test]
fn rays_side_by_side_have_the_bits_and_the_counts_of_rays_one_after_the_other() {
    let mut sums = [0; 7];
    for (case, job) in jobs().iter().enumerate() {
        let (whole, one) = (counted(&mut Havs::new(), job), counted(&mut Havs::portable(), job));
        assert!(whole == one, "case {case}: {:?} {:?}", whole.1, one.1);
        sums.iter_mut().zip(whole.1).for_each(|(sum, count)| *sum += count);
    }
    assert!(sums.iter().all(|sum| *sum > 0), "{sums:?}");
}

#[test]
fn a_tile_with_more_fragments_than_are_held_back_is_drawn_in_parts() {
    let mut most = 0;
    for (case, job) in jobs().iter().enumerate().filter(|(_, job)| job.k_buffer.exact_order) {
        let whole = counted(&mut Havs::new(), job);
        most = most.max(whole.1[0]);
        let mut little = Havs::new();
        little.layer.held_most = 100;
        let parts = counted(&mut little, job);
        // Rays become opaque in other rounds.
        let same = if job.skip.opaque { 1..6 } else { 0..6 };
        let (planes, counts) = (whole.0 == parts.0, whole.1[same.clone()] == parts.1[same]);
        assert!(planes && counts, "case {case}: {:?} {:?}", whole.1, parts.1);
    }
    // Tiles of which one part cannot be all.
    assert!(most > 20_000, "{most}");
}

#[test]
fn the_comparison_notices_a_scalar() {
    let job = jobs().swap_remove(0);
    let mut scalars = job.scalars.values().to_vec();
    scalars[5] += 1e-3;
    let off = RenderJob { scalars: Arc::new(scalars).into(), ..job.clone() };
    assert_ne!(counted(&mut Havs::new(), &off).0, counted(&mut Havs::portable(), &job).0);
}
