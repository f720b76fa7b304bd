//! Transfer functions of more than the scalar: orders of fragments, eyes within the mesh, threads.

use super::havs::{havs, with_all_faces, with_buffer, with_some_faces};
use super::joint::*;
use super::*;
use crate::meshes::noise;

#[test]
fn eyes_within_the_mesh_see_what_the_reference_sees() {
    let mut seen = 0;
    for seed in 0..12 {
        let random = |i: u64| noise(seed, i);
        let position = 0.8 * DVec3::new(random(0), random(1), random(2));
        let eye = Camera { position, ..camera(DVec3::new(3.0, random(3), random(4)), PERSPECTIVE) };
        for (name, job) in jobs(4, PERSPECTIVE) {
            let job = RenderJob { view: eye.view(40, 32).unwrap(), ..job };
            let judge = reference(&job);
            seen += usize::from(judge.pixels.iter().any(|p| p[3] > 0.1));
            let faces = havs(&with_all_faces(&job));
            assert_within(&format!("{name}, {seed}, ray caster"), &raycast(&job), &judge);
            assert_within(&format!("{name}, {seed}, faces"), &faces.planes.color, &judge);
            assert_within(&format!("{name}, {seed}, points"), &points(&job).planes.color, &judge);
            assert_eq!((faces.stats.out_of_order, faces.stats.broken_paths), (0, 0), "{name}, {seed}");
            // A pixel further to the side is another one.
            if judge.pixels.iter().all(|p| p[3] > 0.1) {
                assert_noticed(name, &raycast(&stretched(&job)), &judge);
            }
        }
    }
    assert!(seen > 20, "{seen}");
}

/// All faces, the last one first.
fn back_to_front(job: &RenderJob) -> RenderJob {
    let job = with_all_faces(job);
    let mut list = (**job.faces.as_ref().unwrap()).clone();
    list.ids.reverse();
    RenderJob { faces: Some(Arc::new(list)), ..job }
}

#[test]
fn whatever_the_buffer_of_fragments_holds_back_exact_order_is_exact() {
    let mut mistakes = 0;
    for (name, job) in jobs(6, PERSPECTIVE) {
        let judge = reference(&job);
        for k in [2, 3, 16] {
            for (order, job) in [("front to back", with_all_faces(&job)), ("back to front", back_to_front(&job))] {
                let image = havs(&with_buffer(&job, k, true));
                assert_within(&format!("{name}, {order}, k {k}"), &image.planes.color, &judge);
            }
        }
        // Where it may, a small buffer makes mistakes.
        let wrong = havs(&with_buffer(&back_to_front(&job), 2, false));
        mistakes += wrong.stats.out_of_order;
        assert_noticed(name, &wrong.planes.color, &judge);
    }
    assert!(mistakes > 100, "{mistakes} fragments too late");
}

#[test]
fn an_image_does_not_depend_on_how_many_threads_there_are() {
    for (name, job) in jobs(6, PARALLEL) {
        let with_threads = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let some = havs(&with_some_faces(&job, 0.5, 3));
                let frame = Raycast::new().render(job.clone()).unwrap().clone();
                [some, havs(&with_all_faces(&job)), frame].map(|frame| (frame.planes.color, frame.planes.depth))
            })
        };
        let one = with_threads(1);
        assert!(one == with_threads(2) && one == with_threads(3), "{name}");
        // Half of the faces are not all of them.
        assert!(one[0] != one[1], "{name}");
    }
}

#[test]
fn the_walk_without_vectors_is_the_one_that_all_processors_take() {
    for (name, job) in jobs(5, PERSPECTIVE) {
        let portable = Raycast::portable().render(job.clone()).unwrap().planes.color.clone();
        assert_same(name, &portable, &raycast(&job));
    }
}
