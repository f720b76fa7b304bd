//! Every stage on the GPU against plain f64: what a shader has written is read back and judged by the definition, not by the
//! CPU's renderer. Each comparison is shown to notice a small change of one side.

use super::*;
use crate::camera::{Camera, Projection, View};
use crate::mesh::{Mesh, NONE, RawMesh};
use crate::render::LayerRenderer;
use crate::render::gpu::layout::{FRAGMENT_BYTES, Lists, depth_of};
use crate::render::gpu::lists::steps::{ListJob, Step};
use crate::render::gpu::raycast::stage_tests::{
    Meeting, active_cells, cameras, context, context_of_window, has_eye, job, meet, mesh, read_back, seen,
};
use crate::render::{Frame, Renderer};
use crate::visibility::Drawn;
use glam::DVec3;

/// All faces of the active cells, in the order of their ids.
fn with_faces(job: RenderJob) -> RenderJob {
    let cells = &job.mesh.topology.connectivity().face_cells;
    let is_active = |cells: &[u32; 2]| cells.iter().any(|&cell| cell != NONE && job.active.contains(cell));
    let faces = (0u32..).zip(cells).filter(|(_, cells)| is_active(cells)).map(|(face, _)| face).collect();
    RenderJob { faces: Some(Arc::new(Drawn { ids: faces, is_complete: true })), ..job }
}

fn jobs() -> Vec<(&'static str, RenderJob)> {
    let mut jobs = Vec::new();
    for (seed, missing) in [(1, 0), (2, 5)] {
        let mesh = mesh(seed, missing, DVec3::ZERO);
        jobs.extend(cameras(DVec3::ZERO).into_iter().map(|(name, camera)| {
            // More than one tile, and not a multiple of them.
            (name, with_faces(job(&mesh, &camera, (43, 29))))
        }));
    }
    jobs
}

/// Does all that comes before `step`, which is about to begin.
fn run_until(layer: &mut FragmentLists<Faces>, job: &RenderJob, step: Step) -> ListJob {
    let mut frame = Frame::default();
    let mut active = layer.begin(job.clone(), &mut frame).unwrap().unwrap();
    loop {
        let units = active.units(active.step, &layer.bands);
        if active.step == step && active.next == units.start {
            return active;
        }
        if active.next >= units.end {
            layer.next_step(&mut active, &mut frame.stats).unwrap();
        } else {
            let next = active.next..units.end.min(active.next.saturating_add(active.step.most_units()));
            layer.submit_units(&mut active, next, true).unwrap();
        }
    }
}

/// The lists as they are before `step`.
fn lists_before(context: &Arc<Context>, job: &RenderJob, step: Step) -> (Vec<u32>, Lists) {
    let mut layer = Havs::new(context.clone()).layer.layer;
    let active = run_until(&mut layer, job, step);
    (read_back(context, layer.scene.lists.get(context).unwrap()), active.lists)
}

/// Words of the pixels of all tiles.
fn pixels(words: &[u32], lists: Lists) -> &[u32] {
    &words[lists.pixels() as usize..lists.pieces() as usize]
}

/// Place of a pixel of the image in those.
fn place_of(view: &View, (i, j): (usize, usize)) -> usize {
    let tile = j / 16 * view.width_px.div_ceil(16) + i / 16;
    256 * tile + j % 16 * 16 + i % 16
}

/// Depths at which the ray of a pixel passes through the faces drawn, or starts in a cell (0), by the definition; `None` if
/// f32 may decide otherwise about one.
fn depths(job: &RenderJob, view: &View, pixel: (usize, usize)) -> Option<Vec<f64>> {
    let mut found = Vec::new();
    for &face in &job.faces.as_ref().unwrap().ids {
        let corners = job.mesh.topology.connectivity().faces[face as usize];
        let [a, b, c] = corners.map(|v| seen(view, job.mesh.positions.local[v as usize].as_dvec3()));
        for corners in [[a, b, c], [a, c, b]] {
            match meet(view, pixel, corners) {
                Meeting::None => {}
                Meeting::Front(depth) if depth > 0.0 || !view.perspective => found.push(depth),
                Meeting::Front(_) => {}
                Meeting::Doubtful => return None,
            }
        }
    }
    if active_cells(job).into_iter().any(|cell| has_eye(job, view, cell)) {
        found.push(0.0);
    }
    found.sort_by(f64::total_cmp);
    Some(found)
}

/// Pixels whose number of fragments is not that of the definition; pixels in doubt.
fn miscounted(job: &RenderJob, words: &[u32], lists: Lists) -> (usize, usize) {
    let view = job.local_view();
    let (mut wrong, mut doubtful, mut fragments) = (0, 0, 0);
    for pixel in (0..view.height_px).flat_map(|j| (0..view.width_px).map(move |i| (i, j))) {
        match depths(job, &view, pixel) {
            Some(expected) => {
                wrong += usize::from(pixels(words, lists)[place_of(&view, pixel)] as usize != expected.len());
                fragments += expected.len();
            }
            None => doubtful += 1,
        }
    }
    assert!(fragments > 1000, "{fragments} fragments prove nothing");
    (wrong, doubtful)
}

#[test]
fn fragments_are_counted_as_the_definition_has_them() {
    let Some(context) = context() else { return };
    for (name, job) in jobs() {
        let (words, lists) = lists_before(&context, &job, Step::Scan);
        let (wrong, doubtful) = miscounted(&job, &words, lists);
        assert_eq!(wrong, 0, "{name}");
        assert!(doubtful < 43 * 29 / 4, "{name}: {doubtful} pixels in doubt");
        // The comparison notices a face that is left out.
        let mut fewer = job.faces.as_ref().unwrap().ids.clone();
        fewer.drain(100..120);
        let fewer = Drawn { ids: fewer, is_complete: false };
        let (words, lists) =
            lists_before(&context, &RenderJob { faces: Some(Arc::new(fewer)), ..job.clone() }, Step::Scan);
        assert!(miscounted(&job, &words, lists).0 > 0, "{name}");
    }
}

#[test]
fn places_are_sums_of_the_counts_before_them() {
    let Some(context) = context() else { return };
    for (name, job) in jobs() {
        let (counts, lists) = lists_before(&context, &job, Step::Scan);
        let (places, _) = lists_before(&context, &job, Step::Store);
        let (counts, tiles) = (pixels(&counts, lists), lists.tiles as usize);
        let expected = |counts: &[u32]| -> (Vec<u32>, Vec<u32>) {
            let before = |tile: &[u32], pixel: usize| tile[..pixel].iter().sum();
            let places = counts.chunks(256).flat_map(|tile| (0..256).map(move |pixel| before(tile, pixel)));
            (places.collect(), counts.chunks(256).map(|tile| tile.iter().sum()).collect())
        };
        let sums = places[lists.sums() as usize..][..tiles].to_vec();
        let found = (pixels(&places, lists).to_vec(), sums);
        assert_eq!(found, expected(counts), "{name}");
        assert!(found.1.iter().sum::<u32>() > 1000, "{name}");
        let mut other = counts.to_vec();
        other[300] += 1;
        assert_ne!(found, expected(&other), "{name}");
    }
}

/// Error of a depth: `depth_error` and `TRANSFORM_ERROR`, four times for edge functions that f32 rounds at the rim of doubt
/// (`raycast::stage_tests`).
fn depth_bound(view: &View) -> f64 {
    4.0 * (depth_error(Precision::Single) + TRANSFORM_ERROR * (view.eye.length() + 2.0))
}

#[test]
fn fragments_are_stored_where_they_belong_with_their_depths() {
    let Some(context) = context() else { return };
    for (name, job) in jobs() {
        let view = job.local_view();
        let mut layer = Havs::new(context.clone()).layer.layer;
        let active = run_until(&mut layer, &job, Step::Resolve);
        let (lists, params) = (active.lists, active.params);
        let words = read_back(&context, layer.scene.lists.get(&context).unwrap());
        let fragments = read_back(&context, layer.scene.fragments[0].get(&context).unwrap());
        let fragments: Vec<&[u32]> = fragments.chunks_exact(FRAGMENT_BYTES as usize / 4).collect();
        let origin = f64::from(params.pivot) + depth_of(params.depth_origin);
        let (mut compared, mut largest, mut shifted) = (0, 0.0f64, 0.0f64);
        for pixel in (0..view.height_px).flat_map(|j| (0..view.width_px).map(move |i| (i, j))) {
            let Some(expected) = depths(&job, &view, pixel) else { continue };
            let place = place_of(&view, pixel);
            let base = words[lists.bases() as usize + place / 256];
            let first = if place.is_multiple_of(256) { 0 } else { pixels(&words, lists)[place - 1] };
            let slots = (base + first) as usize..(base + pixels(&words, lists)[place]) as usize;
            let depth_at =
                |slot: usize| depth_of([fragments[slot][0], fragments[slot][1]].map(f32::from_bits)) + origin;
            let mut found: Vec<f64> = slots.map(depth_at).collect();
            found.sort_by(f64::total_cmp);
            assert_eq!(found.len(), expected.len(), "{name}, {pixel:?}");
            let is_in_front = |depths: &&f64| **depths > 0.0 || !view.perspective;
            for (found, expected) in found.iter().zip(&expected).filter(|(_, expected)| is_in_front(expected)) {
                largest = largest.max((found - expected).abs());
                shifted = shifted.max((found + 2.0 * depth_bound(&view) - expected).abs());
                compared += 1;
            }
        }
        assert!(compared > 1000, "{name}: {compared} depths");
        assert!(largest <= depth_bound(&view), "{name}: {largest:.1e} of {:.1e}", depth_bound(&view));
        assert!(shifted > depth_bound(&view), "{name}: the comparison notices a shift");
    }
}

/// A column of `cubes` cubes along z, each of six cells that a ray along it goes through three of.
fn column(cubes: usize) -> Mesh {
    let height = 2.0 / cubes as f64;
    let corner = |n: usize| {
        let side = |bit: usize| if n >> bit & 1 == 1 { 0.5 * height } else { -0.5 * height };
        DVec3::new(side(0), side(1), (n / 4) as f64 * height - 1.0)
    };
    let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
    let cube = |c: usize| paths.map(|path| [0, path[0], path[1], 7].map(|v| (4 * c + v) as u32));
    let points = (0..4 * (cubes + 1)).map(corner).collect();
    Mesh::build(RawMesh { points, cells: (0..cubes).flat_map(cube).collect::<Vec<_>>().into() }).unwrap().0
}

/// Whether the fragments of each pixel, before `step`, are in order of depth and rank; and the most that a pixel has.
fn sorted_before(context: &Arc<Context>, job: &RenderJob, step: Step) -> (bool, usize) {
    let mut layer = Havs::new(context.clone()).layer.layer;
    let lists = run_until(&mut layer, job, step).lists;
    let words = read_back(context, layer.scene.lists.get(context).unwrap());
    let fragments = read_back(context, layer.scene.fragments[0].get(context).unwrap());
    let key = |fragment: &[u32]| (f32::from_bits(fragment[0]), f32::from_bits(fragment[1]), fragment[3]);
    let keys: Vec<_> = fragments.chunks_exact(FRAGMENT_BYTES as usize / 4).map(key).collect();
    let (mut is_sorted, mut most) = (true, 0);
    for (place, &end) in pixels(&words, lists).iter().enumerate() {
        let base = words[lists.bases() as usize + place / 256];
        let first = if place.is_multiple_of(256) { 0 } else { pixels(&words, lists)[place - 1] };
        let here = &keys[(base + first) as usize..(base + end) as usize];
        (is_sorted, most) = (is_sorted && here.is_sorted(), most.max(here.len()));
    }
    (is_sorted, most)
}

#[test]
fn fragments_of_deep_pixels_come_sorted_to_the_last_stage() {
    let Some(context) = context() else { return };
    let mesh = Arc::new(column(500));
    let camera = Camera {
        position: DVec3::new(0.0, 0.0, 5.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Parallel { scale: 0.4 * 2.0 / 500.0 },
        near: 0.0,
    };
    let mut job = with_faces(job(&mesh, &camera, (5, 3)));
    // As bad as it gets: faces from the back to the front.
    let mut faces = job.faces.as_ref().unwrap().ids.clone();
    faces.reverse();
    job.faces = Some(Arc::new(Drawn { ids: faces, is_complete: true }));
    let (before, most) = sorted_before(&context, &job, Step::Sort);
    assert!(most > crate::render::gpu::layout::DEEP as usize, "{most} fragments");
    assert!(!before, "nothing is to be sorted");
    assert!(sorted_before(&context, &job, Step::Resolve).0);
}

#[test]
fn frames_for_a_window_stay_on_its_gpu() {
    let Some(context) = context_of_window() else { return };
    let (_, job) = jobs().swap_remove(0);
    let mut renderer = Havs::new(context.clone());
    let job = RenderJob { for_window: true, ..job };
    let size = |frame: &Frame| frame.texture.as_ref().map(|t| (t.texture().width(), t.texture().height()));
    for _ in 0..2 {
        let frame = renderer.render(job.clone()).unwrap();
        assert_eq!((size(frame), frame.planes.color.pixels.len()), (Some((43, 29)), 0));
    }
    let before = context.resources_created();
    renderer.render(job.clone()).unwrap();
    assert_eq!(context.resources_created(), before);
    let elsewhere = renderer.render(RenderJob { for_window: false, ..job }).unwrap();
    assert_eq!((size(elsewhere), elsewhere.planes.color.pixels.len()), (None, 43 * 29));
}
