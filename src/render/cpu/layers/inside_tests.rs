//! Intervals against those that the float64 reference clips out of rays, cell by cell.

use super::super::tests::{APART, ends, scene};
use super::*;
use crate::camera::{Lattice, PixelSet, Samples};
use crate::mesh::test_meshes::Random;
use crate::render::RenderJob;
use glam::DVec3;

/// Far below the shortest interval that is compared.
const WITHIN: f64 = 1e-12;

/// What is inside of a job's active cells.
fn inside(job: &RenderJob, clips: &[Plane], view: &View) -> Inside {
    let boundary = Boundary::of(&job.mesh, &job.active, &Cancel::new()).unwrap();
    Inside::of(&boundary, clips, WITHIN, view, &Cancel::new()).unwrap()
}

/// How many rays were compared, and how many differ.
fn compared(job: &RenderJob, found: &Inside) -> [usize; 2] {
    let mut counts = [0; 2];
    for (place, ends) in ends(job).into_iter().enumerate() {
        let Some(ends) = ends else { continue };
        let of_pixel = found.of_ray(place).as_flattened();
        let of_pixel = if of_pixel.first() == Some(&f64::NEG_INFINITY) { &of_pixel[1..] } else { of_pixel };
        counts[0] += usize::from(!ends.is_empty());
        let is_same = ends.len() == of_pixel.len() && ends.iter().zip(of_pixel).all(|(a, b)| (a - b).abs() <= APART);
        counts[1] += usize::from(!is_same);
    }
    counts
}

#[test]
fn intervals_are_those_of_the_reference_also_around_the_eye() {
    let mut random = Random::new(11);
    let (mut met, mut around) = (0, 0);
    for round in 0..12 {
        let job = scene(&mut random, round % 2 == 0, round % 3 == 0);
        let found = inside(&job, &[], &job.local_view());
        let [seen, differ] = compared(&job, &found);
        assert_eq!(differ, 0, "round {round}: {differ} of {seen}");
        let view = job.local_view();
        around += usize::from(view.perspective && (0..found.ends.len()).all(|place| found.has(place, 0.0)));
        met += seen;
        // The comparison can fail: a cell more or less.
        let some = (0..).find(|&cell| job.active.contains(cell)).unwrap();
        let without = |cell: usize| job.active.contains(cell as u32) && cell as u32 != some;
        let other = RenderJob { active: Arc::new(CellSet::of(job.active.universe(), without)), ..job.clone() };
        assert!(round % 3 == 0 || compared(&job, &inside(&other, &[], &view))[1] > 0, "round {round}");
    }
    assert!(met > 5000 && around > 0, "{met} {around}");
}

#[test]
fn clips_leave_the_parts_of_intervals_in_front_of_them() {
    for perspective in [true, false] {
        let job = scene(&mut Random::new(7), perspective, false);
        let view = job.local_view();
        let (all, mut cut) = (inside(&job, &[], &view), 0);
        // The last is parallel to all rays of a parallel view.
        let normals = [DVec3::new(0.3, -0.5, 0.8), view.forward, -view.forward, view.right];
        for normal in normals.map(DVec3::normalize) {
            let clip = Plane { normal, offset: 0.1 };
            let left = inside(&job, &[clip], &view);
            for place in 0..all.ends.len() {
                let (column, row) = view.pixel_at(place);
                let (px, py) = view.ray(column, row);
                let side = px * view.right + py * view.up;
                for k in -40..40 {
                    let depth = view.forward.dot(-view.eye) + 0.0373 * f64::from(k);
                    let spread = if perspective { depth } else { 1.0 };
                    let beyond = clip.distance(view.eye + depth * view.forward + spread * side);
                    assert!(beyond.abs() > 1e-9, "on the plane by chance");
                    assert_eq!(left.has(place, depth), all.has(place, depth) && beyond < 0.0);
                    cut += usize::from(left.has(place, depth) != all.has(place, depth));
                }
            }
        }
        assert!(cut > 1000, "{cut}");
    }
}

#[test]
fn any_samples_and_threads_have_the_intervals_of_the_whole_image() {
    let job = scene(&mut Random::new(8), true, false);
    let whole = job.local_view();
    let all = inside(&job, &[], &whole);
    let size = (whole.width_px, whole.height_px);
    let pixels: Vec<u32> = (0..200).map(|i| i * 17 % (size.0 * size.1) as u32).collect();
    let listed = Samples::Pixels(Arc::new(PixelSet::new(size, &pixels).unwrap()));
    for samples in [Samples::Lattice(Lattice::new(3.try_into().unwrap())), listed] {
        let view = View { samples, ..whole.clone() };
        let some = inside(&job, &[], &view);
        let (width, height) = view.plane_px();
        assert_eq!(some.ends.len(), width * height);
        let rows = (0..size.1).flat_map(|row| view.rendered_in(row, 0..size.0).map(move |(column, _)| (column, row)));
        for (ray, (column, row)) in rows.enumerate() {
            assert_eq!(some.of_ray(ray), all.of_ray(row * size.0 + column));
        }
    }
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(alone.install(|| inside(&job, &[], &whole)) == all);
}

#[test]
fn what_has_not_changed_is_kept_and_nothing_of_what_was_cancelled() {
    let job = scene(&mut Random::new(9), true, false);
    let (view, clip) = (job.local_view(), Plane { normal: DVec3::X, offset: 0.1 });
    let turned = View { eye: view.eye + 0.1 * view.right, ..view.clone() };
    let fewer = Arc::new(CellSet::of(job.active.universe(), |cell| job.active.contains(cell as u32) && cell % 2 == 0));
    let mut finder = InsideFinder::default();
    let mut before: Option<Arc<Inside>> = None;
    for (cells, clips, view) in [
        (&job.active, &[][..], &view),
        (&job.active, &[], &turned),
        (&job.active, &[clip], &turned),
        (&fewer, &[clip], &turned),
        (&job.active, &[], &view),
    ] {
        let of = (&job.mesh, cells);
        let cancelled = |looks| finder.find(of, clips, WITHIN, view, &Cancel::after_looks(looks)).is_none();
        assert!((0..5).all(cancelled));
        let found = finder.find(of, clips, WITHIN, view, &Cancel::new()).unwrap();
        assert!(Arc::ptr_eq(&found, &finder.find(of, clips, WITHIN, view, &Cancel::new()).unwrap()));
        assert!(before.is_none_or(|before| *before != *found));
        assert!(*found == *InsideFinder::default().find(of, clips, WITHIN, view, &Cancel::new()).unwrap());
        before = Some(found);
    }
}
