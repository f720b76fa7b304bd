//! A buffer that is too small: what is counted, and what exact order sets right.

use super::*;
use crate::meshes::{build, grid, sample};
use crate::render::{difference, raycast};
use glam::DVec3;
use tetreel::visibility::Drawn;

/// A case of faces in order of their centroids, and whether those are far from the order of their fragments.
struct Ordered {
    case: Case,
    is_anisotropic: bool,
}

fn cases() -> Vec<Ordered> {
    let deep = {
        let mesh = Arc::new(build(grid(16, 0.16, 5, |_| true)));
        Case::new("deep", &mesh, sample(&mesh, wave), dense())
    };
    let from_all_sides = |case: Case| Case { cameras: [cameras::oblique(), on_axes()].concat(), ..case };
    let ordinary = [geometry::regular(), geometry::jittered(), deep].map(from_all_sides).into_iter();
    let ordinary = ordinary.chain([geometry::displaced(DVec3::splat(1e4), 1.0)]);
    let ordinary = ordinary.map(|case| Ordered { case, is_anisotropic: false });
    let thin = geometry::anisotropic().into_iter().map(|case| Ordered { case, is_anisotropic: true });
    ordinary.chain(thin).map(|o| Ordered { case: Case { size: (64, 60), ..o.case }, ..o }).collect()
}

/// Cameras from which many centroids are equally far.
fn on_axes() -> Vec<Camera> {
    [DVec3::Z, DVec3::X].map(|direction| camera(5.0 * direction, cameras::PERSPECTIVE)).to_vec()
}

/// What a buffer of one size did in all views of a case.
#[derive(Default)]
struct Sums {
    exact: (f64, f64),
    as_they_come: (f64, f64),
    fragments: u64,
    again: u64,
    out_of_order: u64,
    /// Of these, in views that are not along axes.
    oblique: u64,
}

impl Sums {
    fn of(case: &Case, judges: &[RgbaImage], k: u8) -> Self {
        let mut sums = Self::default();
        let larger = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.max(b.1));
        for (i, ((job, camera), judge)) in case.jobs().iter().zip(&case.cameras).zip(judges).enumerate() {
            let all = with_all_faces(job);
            let exact = havs(&with_buffer(&all, k, true));
            let errors = difference(&exact.planes.color, judge);
            assert!(BOUND.holds(errors), "{}, k {k}, camera {i}: {errors:?}", case.name);
            sums.exact = larger(sums.exact, errors);
            sums.fragments += exact.stats.fragments;
            sums.again += exact.stats.pixels_resolved_again;
            let loose = havs(&with_buffer(&all, k, false));
            sums.out_of_order += loose.stats.out_of_order;
            let is_oblique = !on_axes().contains(camera);
            sums.oblique += if is_oblique { loose.stats.out_of_order } else { 0 };
            sums.as_they_come = larger(sums.as_they_come, difference(&loose.planes.color, judge));
            // What is reported as wrong is that, and the image says so where nothing is.
            assert_eq!((exact.stats.out_of_order, loose.stats.pixels_resolved_again), (0, 0));
            if loose.stats.out_of_order == 0 {
                assert!(loose.planes.color == exact.planes.color, "{}, k {k}, camera {i}", case.name);
            }
        }
        sums
    }
}

// Long: three buffers on all meshes that are hard to order.
#[test]
fn exact_order_sets_right_what_buffers_get_wrong_on_slivers_layers_and_far_from_the_origin() {
    eprintln!("mesh | k | rmse | max | fragments | again | out of order as they come | rmse, max of that");
    for Ordered { case, is_anisotropic } in cases() {
        let judges: Vec<_> = case.jobs().iter().map(raycast).collect();
        let mut out_of_order = Vec::new();
        for k in [2, 8, 32] {
            let sums = Sums::of(&case, &judges, k);
            let Sums { exact, as_they_come, fragments, again, .. } = sums;
            eprintln!(
                "{} | {k} | {:.1e} | {:.1e} | {fragments} | {again} | {} | {:.1e}, {:.1e}",
                case.name, exact.0, exact.1, sums.out_of_order, as_they_come.0, as_they_come.1
            );
            assert!(fragments > 10_000, "{}: an empty image proves nothing", case.name);
            out_of_order.push(sums.out_of_order);
            match (is_anisotropic, k) {
                (true, 2) => assert!(!BOUND.holds(as_they_come), "{}: a comparison that cannot fail", case.name),
                (false, 32) => assert_eq!(sums.oblique, 0, "{}: out of order in a buffer of {k}", case.name),
                _ => {}
            }
        }
        assert!(out_of_order[0] > 0, "{}: a buffer of two is enough", case.name);
        assert!(out_of_order.is_sorted_by(|a, b| a >= b), "{}: a larger buffer sets more right", case.name);
    }
}

/// The job with two of its faces, a third of the list apart, in each other's place.
fn with_exchanged_faces(job: &RenderJob, first: usize) -> RenderJob {
    let drawn = job.faces.as_ref().unwrap();
    let mut faces = drawn.ids.clone();
    let other = (first + faces.len() / 3) % faces.len();
    faces.swap(first, other);
    RenderJob { faces: Some(Arc::new(Drawn { ids: faces, is_complete: drawn.is_complete })), ..job.clone() }
}

#[test]
fn two_exchanged_faces_are_noticed_as_they_come_and_set_right_in_exact_order() {
    let case = geometry::jittered();
    let job = case.jobs().pop().unwrap();
    let judged = Judged::new(job.clone(), 1.0);
    let all = with_all_faces(&job);
    let errors = |job: &RenderJob, exact_order| {
        let frame = havs(&with_buffer(job, 8, exact_order));
        (judged.errors(&frame.planes.color), frame.stats)
    };
    assert!(BOUND.holds(errors(&all, false).0), "in order, a buffer of 8 is enough here");
    let mut noticed = 0;
    let count = all.faces.as_ref().unwrap().ids.len();
    for first in (0..count).step_by(count / 20) {
        let exchanged = with_exchanged_faces(&all, first);
        let (loose, stats) = errors(&exchanged, false);
        assert!(BOUND.holds(loose) || stats.out_of_order > 0, "a wrong image and nothing counted: {loose:?}");
        noticed += usize::from(!BOUND.holds(loose));
        let (exact, _) = errors(&exchanged, true);
        assert!(BOUND.holds(exact), "faces {first} and a third on: {exact:?}");
    }
    eprintln!("{noticed} of 20 exchanges of faces noticed");
    assert!(noticed > 0);
}
