//! Eight rays side by side against one after the other.

use super::tests::{cameras, constant, dense, field, tents};
use super::*;
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid, torn};
use crate::render::points::PointStyle;
use crate::render::testing::{self, with_points};
use crate::render::{Planes, Renderer};

const EXACT: PointStyle = PointStyle::EXACT;

/// A frame, and what was counted in it.
fn counted(mut renderer: Points, job: &RenderJob) -> (Planes, [u64; 5]) {
    let Frame { planes, stats, .. } = renderer.render(job.clone()).unwrap().clone();
    let counts = [stats.fragments, stats.segments, stats.rays_hit, stats.rays_stopped_early, stats.out_of_order];
    (planes, counts)
}

/// A grid of cells; torn; or two at the same place, so that cells overlap.
fn mesh_of(case: usize, random: &mut Random) -> Arc<Mesh> {
    let mut raw = jittered(kuhn_grid([4, 3, 5]), random);
    if case % 3 == 2 {
        let other = jittered(kuhn_grid([4, 3, 5]), random);
        let first = raw.points.len() as u32;
        let tets = other.cells.tets.iter().map(|tet| tet.map(|v| first + v));
        raw.cells = raw.cells.tets.iter().copied().chain(tets).collect::<Vec<_>>().into();
        raw.points.extend(other.points);
    }
    let raw = if case.is_multiple_of(3) { raw } else { torn(&raw, random) };
    Arc::new(Mesh::build(raw).unwrap().0)
}

/// A job of cells with scalars of vertices, now and then of cells; dense, opaque, with narrow and with thin ranges, with and without early end.
pub(in crate::render::cpu) fn job_of(case: usize, random: &mut Random) -> RenderJob {
    let mesh = mesh_of(case, random);
    let table = [dense(), tents(), constant(3e3), tents(), constant(0.5)][case % 5].clone();
    let mut job = testing::job(&mesh, field(&mesh), &cameras(&mesh)[case % 4], (37, 21), table);
    job.skip.opaque = !case.is_multiple_of(7);
    if case % 8 == 7 { testing::of_cells(&job) } else { job }
}

#[test]
fn rays_side_by_side_have_the_bits_and_the_counts_of_rays_one_after_the_other() {
    let mut random = Random::new(20);
    let (mut out_of_order, mut stopped, mut several) = (0, 0, 0);
    for case in 0..36 {
        let job = job_of(case, &mut random);
        let style = PointStyle { exact_order: case % 4 != 3, lod: [1.0, 0.7][case / 18], ..EXACT };
        let job = with_points(&job, style);
        let (whole, one) = (counted(Points::new(), &job), counted(Points::portable(), &job));
        assert!(whole == one, "case {case}: {:?} {:?}", whole.1, one.1);
        let [_, segments, hit, early, cut] = whole.1;
        (out_of_order, stopped, several) =
            (out_of_order + cut, stopped + early, several + segments.saturating_sub(hit));
    }
    assert!(out_of_order > 0 && stopped > 0 && several > 0, "{out_of_order} {stopped} {several}");
}

#[test]
fn rays_side_by_side_notice_a_scalar() {
    let mesh = Arc::new(Mesh::build(kuhn_grid([3; 3])).unwrap().0);
    let job = with_points(&testing::job(&mesh, field(&mesh), &cameras(&mesh)[0], (24, 24), dense()), EXACT);
    let mut scalars = field(&mesh);
    scalars[5] += 1e-3;
    let off = RenderJob { scalars: Arc::new(scalars).into(), ..job.clone() };
    assert_ne!(counted(Points::new(), &off).0, counted(Points::portable(), &job).0);
}
