//! Depth layers against the CPU's, for views of meshes with holes and several parts.

use super::*;
use crate::camera::View;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid_of};
use crate::render::cpu::layers::BoundaryDepths;
use crate::render::gpu::full_size::stage_tests::{drawn, enlarged};
use crate::render::gpu::layout::depth_of;
use crate::render::gpu::raycast::Raycast;
use crate::render::gpu::raycast::stage_tests::{Meeting, cameras, context, job, meet, read_back, seen};
use crate::render::upsampling::{DepthEdges, ImageScale, UpsampleFilter};
use crate::task::Cancel;
use glam::DVec3;

/// Two parts, one with a hole through it and a cavity, and cells left out at random.
fn parts(seed: u64, of: usize) -> RenderJob {
    let keep = |[x, y, z]: [usize; 3]| x != 2 && !(x == 1 && y == 1) && [x, y, z] != [3, 1, 1];
    let (mesh, _) = Mesh::build(jittered(kuhn_grid_of([4; 3], keep), &mut Random::new(seed))).unwrap();
    let (mesh, random) = (Arc::new(mesh), &mut Random::new(seed + 1));
    let job = job(&mesh, &cameras(DVec3::ZERO)[of].1, (150, 101));
    let out: Vec<bool> = (0..job.active.universe()).map(|_| random.below(12) == 0).collect();
    let active = CellSet::of(job.active.universe(), |cell| job.active.contains(cell as u32) && !out[cell]);
    RenderJob { active: Arc::new(active), ..job }
}

/// Error of a depth, local units: of one in f32 counted from the pivot (`depth`, at most), and of the weights of a hit, 2^-22 of the
/// differences of depths, which are below 2 for a mesh within [-1, 1]; four times for edge functions that f32 rounds at the rim of doubt
/// (`raycast::stage_tests`), and that of view coordinates.
fn depth_bound(view: &View, depth: f64) -> f64 {
    let unit = 1.0 / f64::from(1 << 24);
    depth * unit + 4.0 * (4.0 * unit + (view.eye.length() + 2.0) / (1u64 << 40) as f64)
}

/// Decodes a depth as `lib/layer_lists.wgsl` has it.
fn depth_of_nearness(nearness: u32) -> Option<f32> {
    let farness = !nearness;
    let bits = if farness >> 31 == 1 { farness & 0x7fff_ffff } else { !farness };
    (nearness != 0).then(|| f32::from_bits(bits))
}

/// The layers of a view as they lie on the GPU: for each pixel depths from the eye, local units.
fn layers_of(context: &Context, layers: &DepthLayers) -> Vec<[f64; 3]> {
    let words = read_back(context, layers.depths.get(context).unwrap());
    let LayerLists { tiles, layers: count } = layers.places;
    let (columns, [width, height]) = (layers.params.tiles[0], layers.params.size_px);
    let origin = depth_of(layers.params.depth_origin) + f64::from(layers.params.pivot);
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let depths = pixels.map(|(x, y)| {
        let (tile, local) = (y / 16 * columns + x / 16, y % 16 * 16 + x % 16);
        let at = 2 * tiles + count * u64::from(256 * tile + local);
        std::array::from_fn(|layer| {
            let nearness = if (layer as u64) < count { words[at as usize + layer] } else { 0 };
            depth_of_nearness(nearness).map_or(f64::INFINITY, |depth| f64::from(depth) + origin)
        })
    });
    depths.collect()
}

/// Whether f32 may take the ray of a pixel past a face of the boundary, or to it.
fn is_doubtful(job: &RenderJob, view: &View, pixel: (usize, usize)) -> bool {
    let place = |v: u32| seen(view, job.mesh.positions.local[v as usize].as_dvec3());
    let faces = boundary_faces(job, &job.active).unwrap();
    faces.iter().any(|ids| {
        let [a, b, c] = ids.map(place);
        [[a, b, c], [a, c, b]].into_iter().any(|corners| meet(view, pixel, corners) == Meeting::Doubtful)
    })
}

/// Compares the layers of a view with the CPU's: pixels with some, those that differ, and those among them where nothing is in doubt.
fn compared(job: &RenderJob, found: &[[f64; 3]], layers: usize, depth: f64) -> [usize; 3] {
    let view = job.local_view();
    let (expected, bound) = (BoundaryDepths::of(job, layers).unwrap(), depth_bound(&view, depth));
    let scale = job.mesh.positions.scale;
    let mut counts = [0; 3];
    for (at, (found, expected)) in found.iter().zip(&expected.depths.pixels).enumerate() {
        let is_same = |(a, b): (&f64, &f64)| *a == *b || (a - b / scale).abs() <= bound;
        let differs = !found.iter().zip(expected).all(is_same);
        counts[0] += usize::from(expected[0].is_finite());
        counts[1] += usize::from(differs);
        counts[2] += usize::from(differs && !is_doubtful(job, &view, (at % view.width_px, at / view.width_px)));
    }
    counts
}

#[test]
fn layers_are_those_of_the_cpu_but_where_a_ray_is_within_rounding_of_a_rim() {
    let Some(context) = context() else { return };
    let mut renderer = Raycast::new(context.clone());
    let (mut met, mut others) = (0, 0);
    for (of, (name, _)) in cameras(DVec3::ZERO).iter().enumerate() {
        let job = parts(of as u64, of);
        for layers in 1..=3 {
            let filter = UpsampleFilter::Joint2x2 { edges: DepthEdges { layers, ..DepthEdges::USUAL } };
            let job = enlarged(&job, ImageScale::Half, filter);
            drawn(&mut renderer, &job);
            let full = RenderJob { view: job.enlarge.as_ref().unwrap().view.clone(), ..job.clone() };
            for (at, job) in renderer.layer.layers().iter().zip([&full, &job]) {
                let found = layers_of(&context, at);
                // Depths are counted from the pivot where the mesh is far away, and else the eye is that near.
                let depth = if at.params.pivot > 0.0 || !full.view.perspective { 2.0 } else { 8.0 };
                let [seen, differ, wrong] = compared(job, &found, layers, depth);
                assert_eq!(wrong, 0, "{name}, {layers} layers: {differ} of {seen} pixels differ");
                assert!(differ * 100 <= seen, "{name}, {layers} layers: {differ} of {seen} pixels");
                (met, others) = (met + seen, others + differ);
                // The comparison can fail.
                let shift = 3.0 * depth_bound(&job.local_view(), depth);
                let shifted: Vec<_> = found.iter().map(|depths| depths.map(|depth| depth + shift)).collect();
                assert!(compared(job, &shifted, layers, depth)[2] * 2 > seen, "{name}: a shift is not noticed");
                if *name != "far" {
                    let some = found.iter().position(|depths| depths[0].is_finite()).unwrap();
                    let mut one = found.clone();
                    one[some][0] += 0.01;
                    assert_eq!(compared(job, &one, layers, depth)[1], differ + 1, "{name}: another depth");
                }
            }
            let range =
                BoundaryDepths::of(&full, layers).unwrap().range.unwrap().map(|at| at / full.mesh.positions.scale);
            let params = renderer.layer.layers()[0].params;
            let origin = depth_of(params.depth_origin) + f64::from(params.pivot);
            let words = read_back(&context, renderer.layer.range().get(&context).unwrap());
            for (word, expected) in words.iter().zip(range) {
                let found = f64::from(f32::from_bits(*word)) + origin;
                // Rays that meet the rim or not are few, and the ends of the range seldom theirs.
                assert!((found - expected).abs() <= depth_bound(&full.local_view(), 8.0), "{name}: {found} {expected}");
            }
        }
    }
    assert!(met > 100_000, "{met} pixels");
    println!("{others} of {met} pixels differ");
}

/// Within a mesh of many layers: more pieces of large faces than the list has at first.
pub(in crate::render::gpu) fn large_faces() -> RenderJob {
    let filter = UpsampleFilter::Joint { kernel_px: 2, edges: DepthEdges::USUAL };
    let keep = |[x, y, z]: [usize; 3]| (x + y + z) % 2 == 0;
    let (mesh, _) = Mesh::build(kuhn_grid_of([12; 3], keep)).unwrap();
    let mut view = cameras(DVec3::ZERO)[0].1;
    (view.position, view.focal_point) = (DVec3::new(-0.4, 5.71, 6.33), DVec3::new(12.0, 6.1, 6.2));
    let job = job(&Arc::new(mesh), &view, (300, 200));
    enlarged(&job, ImageScale::Half, filter)
}

#[test]
fn large_faces_are_drawn_in_pieces_and_again_if_there_is_no_room_for_them() {
    let Some(context) = context() else { return };
    let (mut renderer, job) = (Raycast::new(context.clone()), large_faces());
    let frame = drawn(&mut renderer, &job);
    assert_eq!(frame.stats.entry_retries, 1, "the list was too short");
    let full = RenderJob { view: job.enlarge.as_ref().unwrap().view.clone(), ..job.clone() };
    let found = layers_of(&context, &renderer.layer.layers()[0]);
    let [seen, differ, wrong] = compared(&full, &found, 3, 8.0);
    assert!(wrong == 0 && differ * 100 <= seen && seen > 50_000, "{differ} of {seen}, {wrong} beyond doubt");
    let pieces = read_back(&context, renderer.layer.layers()[0].head(&context).unwrap());
    assert!(pieces[LayerLists::PIECE_COUNT] > 0 && pieces[LayerLists::PIECES_TO] == pieces[LayerLists::PIECE_COUNT]);
    // There is room the next time, and depths are the same in any order.
    let again = drawn(&mut renderer, &job);
    assert_eq!(again.stats.entry_retries, 0);
    assert!(layers_of(&context, &renderer.layer.layers()[0]) == found && again.planes == frame.planes);
}

#[test]
fn a_boundary_of_a_job_that_is_cancelled_is_not_taken_for_one() {
    let Some(context) = context() else { return };
    let (job, mut boundary) = (parts(3, 0), Boundary::new());
    let cancelled = RenderJob { cancel: Cancel::after_looks(1), ..job.clone() };
    assert_eq!(boundary.update(&context, &cancelled, &job.active).unwrap(), None);
    let faces = boundary_faces(&job, &job.active).unwrap().len();
    assert_eq!(boundary.update(&context, &job, &job.active).unwrap(), Some((true, 12 * faces as u64)));
    assert_eq!(boundary.update(&context, &job, &job.active).unwrap(), Some((false, 0)));
}

#[test]
fn other_active_cells_of_the_same_mesh_have_layers_of_their_own() {
    let Some(context) = context() else { return };
    let mut renderer = Raycast::new(context.clone());
    let filter = UpsampleFilter::Joint2x2 { edges: DepthEdges::USUAL };
    let first = parts(5, 0);
    // Only one of the parts, and then all again: the boundary is shorter, and longer, than the one before.
    let bounds = |cell: usize| first.mesh.topology.tets[cell].map(|v| first.mesh.positions.local[v as usize].x);
    let right = CellSet::of(first.active.universe(), |cell| bounds(cell).iter().all(|&x| x > 0.0));
    let second = RenderJob { active: Arc::new(right), ..first.clone() };
    let boundaries = [&first, &second].map(|job| boundary_faces(job, &job.active).unwrap().len());
    assert!(boundaries[1] > 0 && boundaries[1] < boundaries[0], "{boundaries:?}");
    let mut found = Vec::new();
    for of in [&first, &second, &first] {
        let job = enlarged(of, ImageScale::Half, filter);
        let frame = drawn(&mut renderer, &job);
        for (layers, job) in renderer.layer.layers().iter().zip([of, &job]) {
            let [seen, differ, wrong] = compared(job, &layers_of(&context, layers), 3, 8.0);
            assert!(wrong == 0 && differ * 100 <= seen && seen > 100, "{differ} of {seen}, {wrong} beyond doubt");
        }
        assert!(frame.planes == drawn(&mut Raycast::new(context.clone()), &job).planes);
        found.push(layers_of(&context, &renderer.layer.layers()[0]));
    }
    assert!(found[0] != found[1] && found[0] == found[2]);
}
