//! Errors and samples.

use super::super::value_at;
use super::super::vertices::VertexFunctions;
use super::*;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};

fn mesh() -> (Mesh, Kernels) {
    let mesh = Mesh::build(jittered(kuhn_grid([6; 3]), &mut Random::new(1))).unwrap().0;
    let kernels = VertexFunctions::default().of(&mesh).unwrap().kernels;
    (mesh, kernels)
}

fn wave(mesh: &Mesh, phase: f32) -> Vec<f32> {
    mesh.positions.local.iter().map(|p| (3.0 * p.x + phase).sin() + p.y * p.z).collect()
}

fn report(samples: &Samples, mesh: &Mesh, kernels: &Kernels, steps: &[(usize, Vec<f32>)]) -> Report {
    let mut judged = Judged::default();
    assert!(samples.judge(kernels, steps, &mut judged, &Cancel::new()));
    samples.report(mesh, &judged, ("T", Some([-2.0, 2.0])), 9)
}

#[test]
fn errors_are_those_of_all_functions_to_the_bit() {
    let (mesh, kernels) = mesh();
    let samples = Samples::of(&mesh, 100, 7);
    let mut steps = vec![(0, wave(&mesh, 0.0)), (4, wave(&mesh, 1.0))];
    steps[1].1[50] = f32::NAN;
    let found = report(&samples, &mesh, &kernels, &steps);
    let (mut all, mut holes) = (Vec::new(), 0);
    for (_, values) in &steps {
        for sample in samples.samples.iter().filter(|sample| sample.group == Group::Boundary) {
            match sample.truth(values) {
                Some(truth) => all.push((value_at(&kernels, values, sample.at).unwrap() - truth).abs() / 4.0),
                None => holes += 1,
            }
        }
    }
    let errors = &found.series.boundary;
    assert_eq!((errors.samples, errors.holes, errors.unreached), (all.len() as u64, holes, 0));
    assert_eq!(errors.mean, all.iter().sum::<f64>() / all.len() as f64);
    assert_eq!(errors.max, all.iter().copied().fold(0.0, f64::max));
    all.sort_unstable_by(f64::total_cmp);
    assert_eq!(errors.p99, all[(0.99 * all.len() as f64).ceil() as usize - 1]);
    assert!(errors.mean <= errors.rms && errors.rms <= errors.p99 && errors.p99 <= errors.max && errors.mean > 0.0);
    // A function that is changed, and with it the field, is noticed.
    steps[0].1[20] += 0.1;
    assert_ne!(report(&samples, &mesh, &kernels, &steps).series, found.series);
}

#[test]
fn steps_are_judged_alike_together_and_one_by_one() {
    let (mesh, kernels) = mesh();
    let samples = Samples::of(&mesh, 64, 7);
    let steps = vec![(0, wave(&mesh, 0.0)), (4, wave(&mesh, 1.0)), (8, wave(&mesh, 2.0))];
    let mut judged = Judged::default();
    for of_step in steps.chunks(1) {
        assert!(samples.judge(&kernels, of_step, &mut judged, &Cancel::new()));
    }
    let one_by_one = samples.report(&mesh, &judged, ("T", Some([-2.0, 2.0])), 9);
    assert_eq!(one_by_one, report(&samples, &mesh, &kernels, &steps));
    assert_eq!(one_by_one.steps.iter().map(|of| of.step).collect::<Vec<_>>(), [0, 4, 8]);
    let cancelled = Cancel::new();
    cancelled.cancel();
    assert!(!samples.judge(&kernels, &steps, &mut judged, &cancelled));
}

#[test]
fn samples_are_of_their_group_inside_their_cells_and_follow_the_seed() {
    let (mesh, _) = mesh();
    let samples = Samples::of(&mesh, 200, 7);
    let at_boundary = at_boundary(&mesh);
    // 5 of 7 vertices along each axis are inside.
    assert_eq!(at_boundary.iter().filter(|of| !**of).count(), 125);
    let mut counts = [0; 3];
    for sample in &samples.samples {
        counts[sample.group as usize] += 1;
        let is_at_boundary = sample.corners.iter().any(|&vertex| at_boundary[vertex as usize]);
        assert!(sample.group == Group::Vertices || is_at_boundary == (sample.group == Group::Boundary));
        assert!(sample.shares.iter().all(|share| (0.0..=1.0).contains(share)));
        // Three differences and a sum of numbers up to 1.
        assert!((sample.shares.iter().sum::<f64>() - 1.0).abs() <= 4.0 * f64::EPSILON);
    }
    assert_eq!(counts, [200; 3]);
    let places = |seed| Samples::of(&mesh, 200, seed).samples.iter().map(|of| of.at).collect::<Vec<_>>();
    assert_eq!(places(7), places(7));
    assert_ne!(places(7), places(8));
    // All where there are few, each once.
    let all = Samples::of(&mesh, usize::MAX, 7);
    assert_eq!(all.len(), mesh.positions.local.len() + mesh.topology.tets.len());
}

#[test]
fn a_constant_field_has_no_error_and_none_a_share_of_its_range() {
    let (mesh, kernels) = mesh();
    let samples = Samples::of(&mesh, 50, 1);
    let mut judged = Judged::default();
    let values = vec![0.3f32; kernels.len()];
    assert!(samples.judge(&kernels, &[(0, values)], &mut judged, &Cancel::new()));
    let report = samples.report(&mesh, &judged, ("T", Some([0.3; 2])), 1);
    // Two means of some hundred equal numbers.
    assert!(!report.is_share_of_range && report.series.interior.max < 1e-14);
    let holes = vec![f32::NAN; kernels.len()];
    assert!(samples.judge(&kernels, &[(1, holes)], &mut judged, &Cancel::new()));
    let report = samples.report(&mesh, &judged, ("T", None), 2);
    assert_eq!((report.steps[1].errors.vertices.holes, report.steps[1].errors.vertices.samples), (50, 0));
    assert_eq!(report.steps[1].errors.vertices.at, None);
    let text = serde_json::to_string(&report).unwrap();
    assert_eq!(serde_json::from_str::<Report>(&text).unwrap().steps[1], report.steps[1]);
}
