//! Starts and cells of rays, counted by the walk and by testing all cells for each pixel.

use super::*;
use crate::image::RgbaImage;
use crate::optics::OPAQUE_TRANSMITTANCE;
use crate::render::{Frame, Renderer, cpu};
use crate::stats::FrameStats;

/// Starts of paths, cells and rays of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    entries: u64,
    steps: u64,
    rays_hit: u64,
}

impl Counts {
    fn of(stats: &FrameStats) -> Self {
        Self { entries: stats.entries, steps: stats.steps, rays_hit: stats.rays_hit }
    }
}

/// Counts by the definition, and the rays that pass so close to an edge that f32 may decide otherwise.
fn count(job: &RenderJob) -> (Counts, usize) {
    let view = job.local_view();
    let cells: Vec<_> = active_cells(job)
        .into_iter()
        .map(|cell| {
            let faces = [0, 1, 2, 3].map(|o| (face(job, &view, cell, o), is_open(job, cell, o)));
            (faces, has_eye(job, &view, cell))
        })
        .collect();
    let mut counts = Counts::default();
    let mut doubtful = 0;
    for pixel in (0..view.height_px).flat_map(|j| (0..view.width_px).map(move |i| (i, j))) {
        let mut entries = 0;
        let mut in_doubt = false;
        for (faces, has_eye) in &cells {
            let in_front = |depth: f64| depth > 0.0 || !view.perspective;
            let mut left_in_front = false;
            for &([a, b, c], is_open) in faces {
                let entered = meet(&view, pixel, [a, b, c]);
                let left = meet(&view, pixel, [a, c, b]);
                in_doubt |= entered == Meeting::Doubtful || left == Meeting::Doubtful;
                entries += u64::from(is_open && matches!(entered, Meeting::Front(d) if in_front(d)));
                left_in_front |= matches!(left, Meeting::Front(d) if in_front(d));
            }
            entries += u64::from(*has_eye);
            counts.steps += u64::from(left_in_front);
        }
        counts.entries += entries;
        counts.rays_hit += u64::from(entries > 0);
        doubtful += usize::from(in_doubt);
    }
    (counts, doubtful)
}

fn render(context: &Arc<Context>, job: &RenderJob) -> FrameStats {
    frame_of(context, job).stats
}

/// Image and counts together: the next test has the renderer at once.
fn frame_of(context: &Arc<Context>, job: &RenderJob) -> Frame {
    renderer(context).render(job.clone()).unwrap().clone()
}

fn scenes() -> Vec<(String, RenderJob)> {
    let mut scenes = Vec::new();
    for missing in [0, 3] {
        let mesh = mesh(5, missing, DVec3::ZERO);
        for (name, camera) in cameras(DVec3::ZERO) {
            scenes.push((format!("{name}, missing {missing}"), job(&mesh, &camera, (37, 29))));
        }
    }
    scenes
}

#[test]
fn rays_meet_the_cells_that_they_must() {
    let Some(context) = context() else { return };
    for (name, job) in scenes() {
        let (expected, doubtful) = count(&job);
        let found = render(&context, &job);
        assert_eq!((found.broken_paths, found.out_of_order, found.rays_stopped_early), (0, 0, 0), "{name}");
        assert_eq!((Counts::of(&found), doubtful), (expected, 0), "{name}");
    }
}

#[test]
fn the_count_notices_a_missing_cell_and_a_moved_eye() {
    let Some(context) = context() else { return };
    let (_, base) = scenes().swap_remove(0);
    let (expected, _) = count(&base);
    let removed: Vec<_> = (0..base.active.universe() as u32).step_by(40).collect();
    let noticed = removed.iter().filter(|&&cell| {
        let mut active = (*base.active).clone();
        active.set(cell, false);
        let found = render(&context, &RenderJob { active: Arc::new(active), ..base.clone() });
        Counts::of(&found) != expected
    });
    // All of those that a ray meets.
    assert!(noticed.count() > removed.len() / 2);
    let mut moved = base;
    moved.view.eye += 1e-2 * moved.view.right;
    assert_ne!(Counts::of(&render(&context, &moved)), expected);
}

/// All counts that both ray casters have.
fn all_counts(stats: &FrameStats) -> [u64; 9] {
    [
        stats.entries,
        stats.steps,
        stats.segments,
        stats.rays_hit,
        stats.rays_stopped_early,
        stats.out_of_order,
        stats.cells_active,
        stats.cells_total,
        stats.entry_faces,
    ]
}

/// Pixels whose transmittance is so close to the threshold at which rays stop that rounding decides: alpha is a sum in f32 that
/// ends just below 1, rounded by up to 2^-25 by each of some eight terms.
fn undecided(image: &RgbaImage) -> u64 {
    let distance = |alpha: f32| (1.0 - f64::from(alpha) - f64::from(OPAQUE_TRANSMITTANCE)).abs();
    image.pixels.iter().filter(|p| distance(p[3]) <= 8.0 / f64::from(1 << 25)).count() as u64
}

#[test]
fn counters_are_those_of_the_cpu() {
    let Some(context) = context() else { return };
    let on_cpu = |job: &RenderJob| cpu::raycast::Raycast::new().render(job.clone()).unwrap().clone();
    let (mut decided, mut stopped, mut noticed) = (0, 0, 0);
    for (name, job) in scenes() {
        // No ray passes an edge, and no scalar a node, so closely that f32 decides otherwise.
        assert_eq!(all_counts(&render(&context, &job)), all_counts(&on_cpu(&job).stats), "{name}");
        let nodes = job.table.nodes().iter().map(|n| Node { tau: 100.0 * n.tau, ..*n }).collect();
        let opaque = RenderJob { table: Arc::new(NodeTable::new(nodes).unwrap()), skip: Skip::ALL, ..job.clone() };
        let (frame, cpu) = (frame_of(&context, &opaque), on_cpu(&opaque));
        let (gpu, undecided) = (&frame.stats, undecided(&cpu.planes.color) + undecided(&frame.planes.color));
        if undecided == 0 {
            assert_eq!(all_counts(gpu), all_counts(&cpu.stats), "{name}, opaque");
            decided += 1;
        }
        // A ray that goes on from there is opaque after the next cell or the one behind it.
        let difference = gpu.steps.abs_diff(cpu.stats.steps);
        assert!(difference <= 2 * undecided, "{name}, opaque: steps differ by {difference}, {undecided} undecided");
        assert_eq!((gpu.entries, gpu.rays_hit), (cpu.stats.entries, cpu.stats.rays_hit), "{name}, opaque");
        stopped += gpu.rays_stopped_early;
        let mut moved = opaque;
        moved.view.eye += 3e-2 * (moved.view.right + moved.view.up);
        let moved = render(&context, &moved);
        noticed += usize::from(moved.steps.abs_diff(cpu.stats.steps) > 2 * undecided);
    }
    assert!(decided > 0 && stopped > 1000, "{decided} scenes decided, {stopped} rays stopped early");
    // Some of these views are from so far, or so close to the surface, that such a step changes little.
    assert!(noticed > 0, "a moved eye was noticed in {noticed} scenes");
}
