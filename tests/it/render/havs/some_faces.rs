//! Levels of detail, and buffers that are too small, against the ray that is written out.

use super::*;
use crate::meshes::{build, grid, sample};

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

/// Outside, parallel, and from within a cell with and without near distance.
fn cameras() -> [Camera; 4] {
    let inside = Camera {
        position: DVec3::new(0.31, 0.22, 0.73),
        focal_point: DVec3::new(-0.4, 0.1, -0.2),
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle: 80.0 },
        near: 0.0,
    };
    [
        camera(DVec3::new(3.0, 2.1, 2.6), PERSPECTIVE),
        camera(DVec3::new(1.0, -2.0, 0.7), Projection::Parallel { scale: 1.27 }),
        inside,
        Camera { near: 0.4, ..inside },
    ]
}

pub fn jobs() -> Vec<RenderJob> {
    let mut jobs = Vec::new();
    for mesh in [grid(5, 0.16, 1, |_| true), grid(6, 0.16, 7, |c| c.length() > 0.5)].map(|raw| Arc::new(build(raw))) {
        for camera in cameras() {
            jobs.push(job(&mesh, sample(&mesh, wave), &camera, (31, 29), dense()));
        }
    }
    // Holes in the field.
    let mut scalars = sample(&jobs[0].mesh, wave);
    scalars[100] = f32::NAN;
    scalars[77] = f32::INFINITY;
    jobs.push(job(&jobs[0].mesh.clone(), scalars, &cameras()[0], (31, 29), dense()));
    jobs
}

// Long: the oracle looks at every face for every pixel.
#[test]
fn levels_of_detail_in_exact_order_are_all_fragments_sorted() {
    let mut worst = (0.0f64, 0.0f64);
    for (i, base) in jobs().iter().enumerate() {
        for share in [1.0, 0.5, 0.1, 0.0] {
            let job = with_some_faces(base, share, 5);
            let judge = oracle::image(&job, None);
            for k in [2, 8, 32] {
                let frame = havs(&with_buffer(&job, k, true));
                assert_within(&format!("job {i}, share {share}, k {k}"), &frame.planes.color, &judge);
                let (rmse, max) = difference(&frame.planes.color, &judge);
                assert!(frame.planes.color.pixels.iter().any(|p| p[3] > 0.5), "an empty image proves nothing");
                worst = (worst.0.max(rmse), worst.1.max(max));
            }
        }
    }
    eprintln!("levels of detail: rmse {:.1e}, max {:.1e}", worst.0, worst.1);
}

// Long: the oracle looks at every face for every pixel.
#[test]
fn a_small_buffer_makes_the_mistakes_of_a_small_buffer() {
    let mut mistakes = 0;
    for (i, base) in jobs().iter().enumerate() {
        for share in [1.0, 0.3] {
            let job = with_some_faces(base, share, 6);
            let all = oracle::image(&job, None);
            for k in [2, 3, 8] {
                let frame = havs(&with_buffer(&job, k, false));
                let judge = oracle::image(&job, Some(usize::from(k)));
                assert_within(&format!("job {i}, share {share}, k {k}"), &frame.planes.color, &judge);
                assert_eq!(frame.stats.pixels_resolved_again, 0);
                mistakes += usize::from(difference(&frame.planes.color, &all).1 > BOUND_MAX);
            }
        }
    }
    assert!(mistakes > 5, "{mistakes} images with mistakes: nothing proved");
}

#[test]
fn the_comparison_notices_one_face_more_and_a_larger_buffer() {
    let base = &jobs()[0];
    let judge = oracle::image(&with_some_faces(base, 0.1, 5), None);
    assert_noticed("more faces", &havs(&with_some_faces(base, 0.12, 5)).planes.color, &judge);
    let other = |base: &RenderJob| {
        let all = with_all_faces(base);
        difference(&havs(&with_buffer(&all, 8, false)).planes.color, &oracle::image(&all, Some(2))).1
    };
    assert!(jobs().iter().any(|base| other(base) > 1e-2));
}
