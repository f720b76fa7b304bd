//! Depth layers against the interval ends that the float64 reference clips out of rays, cell by cell.

use super::*;
use crate::camera::{Camera, Projection};
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid_of};
use crate::node_table::NodeTable;
use crate::render::reference::clip::Cell;
use crate::render::testing;
use glam::DVec3;
use std::sync::Arc;

/// Local units: pixels with shorter intervals or gaps are not compared.
const SHORT: f64 = 1e-5;
/// Local units: tolerance of depths. Coordinates below 8 are rounded by 1e-15, which a face seen at a flat angle of 1e-5 magnifies to
/// 1e-10.
pub(super) const APART: f64 = 1e-9;

/// Two parts, one with a hole through it and a cavity, and some cells left out at random.
pub(super) fn scene(random: &mut Random, perspective: bool, within: bool) -> RenderJob {
    let keep = |[x, y, z]: [usize; 3]| x != 3 && !(x == 1 && y == 1) && [x, y, z] != [5, 1, 1];
    let (mesh, _) = Mesh::build(jittered(kuhn_grid_of([7, 3, 3], keep), random)).unwrap();
    let mesh = Arc::new(mesh);
    let mut component = || random.signed();
    let middle = DVec3::new(3.5, 1.5, 1.5);
    let direction = DVec3::new(component(), component(), component()).normalize_or(DVec3::X);
    let position = if within { DVec3::new(0.4, 0.6, 0.7) } else { middle + 9.0 * direction };
    let projection =
        if perspective { Projection::Perspective { view_angle: 50.0 } } else { Projection::Parallel { scale: 3.5 } };
    let camera = Camera { position, focal_point: middle, view_up: DVec3::Z, projection, near: 0.0 };
    let vertices = mesh.positions.local.len();
    let mut job = testing::job(&mesh, vec![0.5; vertices], &camera, (53, 37), Arc::new(NodeTable::transparent()));
    let out: Vec<bool> = (0..job.active.universe()).map(|_| random.below(12) == 0).collect();
    let all = job.active.clone();
    job.active = Arc::new(CellSet::of(all.universe(), |cell| all.contains(cell as u32) && !out[cell]));
    job
}

/// The ends of each ray's intervals in active cells, local, ascending; `None` where some are too short to compare.
pub(super) fn ends(job: &RenderJob) -> Vec<Option<Vec<f64>>> {
    let view = job.local_view();
    let topology = &job.mesh.topology;
    let in_view = |v: u32| view.to_view(job.mesh.positions.local[v as usize].as_dvec3());
    let active = (0..topology.tets.len() as u32).filter(|&cell| job.active.contains(cell));
    let cells: Vec<Cell> =
        active.filter_map(|c| Cell::new(job, &view, c, topology.tets[c as usize].map(in_view))).collect();
    let of_pixel = |at: usize| {
        let (px, py) = view.ray(at % view.width_px, at / view.width_px);
        let clipped = cells.iter().filter_map(|cell| cell.clip(&view, job.mesh.positions.scale, px, py));
        let mut parts: Vec<[f64; 2]> = clipped.map(|segment| segment.part).collect();
        parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut intervals: Vec<[f64; 2]> = Vec::new();
        for [near, far] in parts {
            match intervals.last_mut() {
                Some(last) if near - last[1] < APART => last[1] = last[1].max(far),
                _ => intervals.push([near, far]),
            }
        }
        // The eye is no part of the boundary.
        let ends = intervals.as_flattened();
        let ends = if view.perspective && ends.first() == Some(&0.0) { &ends[1..] } else { ends };
        ends.array_windows().all(|[a, b]| b - a > SHORT).then(|| ends.to_vec())
    };
    (0..view.width_px * view.height_px).into_par_iter().map(of_pixel).collect()
}

/// Numbers of pixels that were compared, of those with all depth layers, and of those that differ.
fn compared(job: &RenderJob, layers: usize, found: &BoundaryDepths) -> [usize; 3] {
    let mut counts = [0; 3];
    for (depths, ends) in found.depths.pixels.iter().zip(ends(job)) {
        let Some(ends) = ends else { continue };
        let expected = ends.iter().copied().chain(std::iter::repeat(f64::INFINITY)).take(layers);
        let scale = job.mesh.positions.scale;
        let agree = |(a, b): (&f64, f64)| *a == b || (a / scale - b).abs() <= APART;
        let is_same = depths.iter().zip(expected).all(agree) && depths[layers..].iter().all(|d| *d == f64::INFINITY);
        counts[0] += usize::from(!ends.is_empty());
        counts[1] += usize::from(ends.len() >= layers);
        counts[2] += usize::from(!is_same);
    }
    counts
}

#[test]
fn layers_are_the_first_ends_of_the_references_intervals() {
    let mut random = Random::new(3);
    let (mut met, mut full) = (0, 0);
    for round in 0..12 {
        let job = scene(&mut random, round % 2 == 0, round % 6 == 0);
        for layers in 1..=MAX_LAYERS {
            let found = BoundaryDepths::of(&job, layers).unwrap();
            let [seen, whole, differ] = compared(&job, layers, &found);
            assert_eq!(differ, 0, "round {round}, {layers} layers: {differ} of {seen}");
            (met, full) = (met + seen, full + whole);
        }
        // The comparison can fail: another cell, or another eye.
        let mut other = job.clone();
        let some = (0..).find(|&cell| job.active.contains(cell)).unwrap();
        let without =
            CellSet::of(job.active.universe(), |cell| job.active.contains(cell as u32) && cell as u32 != some);
        other.active = Arc::new(without);
        let mut moved = job.clone();
        moved.view.eye += 1e-6 * job.view.right + 1e-6 * job.view.forward;
        let differing = |of: &RenderJob| compared(&job, 3, &BoundaryDepths::of(of, 3).unwrap())[2];
        assert!(differing(&moved) > 100, "round {round}");
        assert!(round % 6 == 0 || differing(&other) > 0, "round {round}");
    }
    assert!(met > 10_000 && full > 5_000, "{met}, {full}");
}

#[test]
fn layers_are_the_same_on_any_number_of_threads_and_the_range_is_that_of_all_of_them() {
    let job = scene(&mut Random::new(8), true, false);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| BoundaryDepths::of(&job, 2)).unwrap()
    };
    let found = on(1);
    assert_eq!(found, on(3));
    let scale = job.mesh.positions.scale;
    let all: Vec<f64> = ends(&job).into_iter().flatten().flatten().map(|depth| depth * scale).collect();
    let range = found.range.unwrap();
    let (least, most) = (all.iter().copied().fold(f64::MAX, f64::min), all.iter().copied().fold(f64::MIN, f64::max));
    // Pixels left out of the comparison may extend the range a little.
    assert!(range[0] <= least + 1e-8 && range[1] >= most - 1e-8 && range[0] > least - 0.5 && range[1] < most + 0.5);
    let reference = found.reference(range);
    let values = reference.pixels.as_flattened();
    assert!(values.iter().all(|v| (0.0..=1.0).contains(v) || *v == 2.0));
    assert!(values.contains(&2.0) && values.contains(&0.0));
    let flat =
        BoundaryDepths { depths: Plane { width: 1, height: 1, pixels: vec![[3.0, 3.25, f64::INFINITY]] }, range: None };
    assert_eq!(flat.reference([3.0, 3.0]).pixels, [[0.0, 0.25, 2.0]]);
}

#[test]
fn where_there_are_no_cells_there_are_no_layers_and_nobody_waits_for_cancelled_ones() {
    let mut job = scene(&mut Random::new(9), true, false);
    job.cancel.cancel();
    assert_eq!(BoundaryDepths::of(&job, 3), None);
    job.cancel = crate::task::Cancel::new();
    job.active = Arc::new(CellSet::none(job.active.universe()));
    let none = BoundaryDepths::of(&job, 3).unwrap();
    assert_eq!((none.range, none.depths.pixels), (None, vec![[f64::INFINITY; 3]; 53 * 37]));
}
