//! Slivers, boundary layers and meshes far from the origin: what exact order sets right, and what a buffer alone does not.

use super::*;
use crate::meshes::{build, grid};

/// A box moved by `offset`, its heights squashed, and its layers as thin as `thinnest` towards one side.
struct Case {
    name: &'static str,
    jitter: f64,
    squash: f64,
    thinnest: f64,
    offset: f64,
    /// Cells much wider than high: their order is not that of their centroids.
    slivers: bool,
}

const REGULAR: Case = Case { name: "regular", jitter: 0.0, squash: 1.0, thinnest: 1.0, offset: 0.0, slivers: false };
const JITTERED: Case = Case { name: "jittered", jitter: 0.16, ..REGULAR };
const CASES: [Case; 6] = [
    REGULAR,
    JITTERED,
    Case { name: "offset 1e4", offset: 1e4, ..JITTERED },
    Case { name: "squash 1e-3", squash: 1e-3, slivers: true, ..JITTERED },
    Case { name: "squash 1e-5", squash: 1e-5, slivers: true, ..JITTERED },
    Case { name: "layers to 1e-6", thinnest: 1e-6, slivers: true, ..JITTERED },
];

/// No ray of such an image is in the middle, and so in the plane of faces or through a vertex, but for cameras along axes.
const SIZE: (usize, usize) = (64, 60);
/// Cameras that are not along axes.
const OBLIQUE: usize = 6;

impl Case {
    fn mesh(&self) -> (Arc<Mesh>, Vec<f32>) {
        let mut raw = grid(6, self.jitter, 5, |_| true);
        let values: Vec<f64> = raw.points.iter().map(|&p| wave(p)).collect();
        for p in &mut raw.points {
            let layer = |z: f64| self.thinnest.powf(0.5 - 0.5 * z) * 2.0 - 1.0;
            p.z = self.squash * if self.thinnest == 1.0 { p.z } else { layer(p.z) };
            *p += DVec3::splat(self.offset);
        }
        let mesh = build(raw);
        let scalars = mesh.vertex_source.iter().map(|&v| values[v as usize] as f32).collect();
        (Arc::new(mesh), scalars)
    }

    fn cameras(&self) -> Vec<Camera> {
        // Those along axes come last.
        let oblique = [DVec3::new(0.5, 0.3, 4.0), DVec3::new(2.0, 1.0, 3.0), DVec3::new(3.0, 2.0, 0.1)];
        let directions = oblique.into_iter().chain([DVec3::Z, DVec3::X]);
        let look = |direction: DVec3, projection| {
            let camera = camera(5.0 * direction.normalize(), projection);
            let by = DVec3::splat(self.offset);
            Camera { position: camera.position + by, focal_point: camera.focal_point + by, ..camera }
        };
        let projections = [Projection::Perspective { view_angle: 30.0 }, Projection::Parallel { scale: 1.27 }];
        directions.flat_map(|d| projections.map(|p| look(d, p))).collect()
    }

    fn table(&self) -> NodeTable {
        let squash = self.squash;
        NodeTable::new(dense().nodes().iter().map(|n| Node { tau: n.tau / squash, ..*n }).collect()).unwrap()
    }
}

#[test]
fn exact_order_sets_right_what_buffers_get_wrong_on_slivers_layers_and_far_from_the_origin() {
    eprintln!("mesh | k | rmse | max | fragments | again | out of order as they come | rmse, max of that");
    for case in &CASES {
        let (mesh, scalars) = case.mesh();
        let mut out_of_order = Vec::new();
        for k in [2, 8, 32] {
            let (mut worst, mut loose) = ((0.0f64, 0.0f64), (0.0f64, 0.0f64));
            let (mut fragments, mut again, mut wrong, mut oblique) = (0, 0, 0, 0);
            for (i, camera) in case.cameras().iter().enumerate() {
                let job = job(&mesh, scalars.clone(), camera, SIZE, case.table());
                let judge = raycast(&job);
                let all = with_all_faces(&job);
                let exact = havs(&with_buffer(&all, k, true));
                let (rmse, max) = difference(&exact.color, &judge);
                assert!(rmse <= 1e-5 && max <= 1e-3, "{}, k {k}, camera {i}: {rmse:.1e}, {max:.1e}", case.name);
                worst = (worst.0.max(rmse), worst.1.max(max));
                fragments += exact.stats.fragments;
                again += exact.stats.pixels_resolved_again;
                let as_they_come = havs(&with_buffer(&all, k, false));
                wrong += as_they_come.stats.out_of_order;
                oblique += if i < OBLIQUE { as_they_come.stats.out_of_order } else { 0 };
                let (rmse, max) = difference(&as_they_come.color, &judge);
                loose = (loose.0.max(rmse), loose.1.max(max));
                // Nothing is reported as wrong that is not, and the image says so where nothing is.
                assert!(as_they_come.stats.pixels_resolved_again == 0);
                if exact.stats.pixels_resolved_again == 0 {
                    assert_eq!(as_they_come.color, exact.color, "{}, k {k}, camera {i}", case.name);
                }
            }
            eprintln!(
                "{} | {k} | {:.1e} | {:.1e} | {fragments} | {again} | {wrong} | {:.1e}, {:.1e}",
                case.name, worst.0, worst.1, loose.0, loose.1
            );
            assert!(fragments > 10_000, "{}: an empty image proves nothing", case.name);
            out_of_order.push(wrong);
            match (case.slivers, k) {
                (true, 2) => assert!(loose.0 > 1e-5 && loose.1 > 1e-3, "{}: a comparison that cannot fail", case.name),
                (false, 32) => assert_eq!(oblique, 0, "{}: out of order in a buffer of {k}", case.name),
                _ => {}
            }
        }
        assert!(out_of_order[0] > 0, "{}: a buffer of two is enough", case.name);
        assert!(out_of_order.is_sorted_by(|a, b| a >= b), "{}: a larger buffer sets more right", case.name);
    }
}
