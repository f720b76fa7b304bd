//! Renderers against closed forms and against the reference.

mod clear_cells;
mod depth;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod havs;
mod raycast;
mod table3d;

use glam::DVec3;
use std::sync::Arc;
use tetreel::camera::{Camera, Projection};
use tetreel::image::RgbaImage;
use tetreel::mesh::Mesh;
use tetreel::node_table::{Node, NodeTable};
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::reference::Reference;
use tetreel::render::{RenderJob, Renderer};
use tetreel::visibility::finite_cells;

pub fn table(nodes: &[(f64, [f64; 3], f64)]) -> NodeTable {
    NodeTable::new(nodes.iter().map(|&(scalar, rgb, tau)| Node { scalar, rgb, tau }).collect()).unwrap()
}

/// A smooth field over [-1, 1]^3, within [-1.4, 1.4].
pub fn wave(p: DVec3) -> f64 {
    (2.1 * p.x + 0.3).sin() * (1.7 * p.y).cos() + 0.4 * (3.0 * p.z + p.x).sin()
}

/// Something everywhere over the range of [`wave`], with a step.
pub fn dense() -> NodeTable {
    table(&[
        (-1.5, [0.2, 0.2, 1.0], 0.1),
        (-0.4, [0.1, 0.9, 0.3], 0.4),
        (0.1, [0.9, 0.9, 0.1], 1.2),
        (0.1, [0.3, 0.0, 0.8], 0.2),
        (0.9, [1.0, 0.2, 0.1], 2.0),
    ])
}

/// A camera that looks at the origin.
pub fn camera(position: DVec3, projection: Projection) -> Camera {
    let view_up = if position.x == 0.0 && position.y == 0.0 { DVec3::Y } else { DVec3::Z };
    Camera { position, focal_point: DVec3::ZERO, view_up, projection, near: 0.0 }
}

pub fn job(mesh: &Arc<Mesh>, scalars: Vec<f32>, camera: &Camera, size: (usize, usize), table: NodeTable) -> RenderJob {
    let active = finite_cells(&mesh.topology, &scalars);
    RenderJob {
        mesh: mesh.clone(),
        scalars: Arc::new(scalars),
        active: Arc::new(active),
        view: camera.view(size.0, size.1).unwrap(),
        table: Arc::new(table),
        compressed: None,
        finite: None,
        optics: Default::default(),
        faces: None,
        k_buffer: Default::default(),
        skip: Default::default(),
        thread_limit: Default::default(),
        for_window: false,
        cancel: Default::default(),
        stats: Default::default(),
    }
}

pub fn raycast(job: &RenderJob) -> RgbaImage {
    Raycast::new().render(job.clone()).unwrap().color.clone()
}

pub fn reference(job: &RenderJob) -> RgbaImage {
    Reference::new().render(job.clone()).unwrap().color.clone()
}

/// Root mean square and maximum of the difference over four channels and all pixels.
pub fn difference(a: &RgbaImage, b: &RgbaImage) -> (f64, f64) {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let mut sum = 0.0;
    let mut max: f64 = 0.0;
    for (x, y) in a.pixels.iter().flatten().zip(b.pixels.iter().flatten()) {
        let d = (f64::from(*x) - f64::from(*y)).abs();
        assert!(d.is_finite());
        sum += d * d;
        max = max.max(d);
    }
    ((sum / (4 * a.pixels.len()) as f64).sqrt(), max)
}

/// The project's bound for every fast path against the reference, on the CPU and, where there is one, on the GPU.
pub fn assert_agrees(name: &str, job: &RenderJob) {
    let (fast, judge) = (raycast(job), reference(job));
    assert_within(&format!("{name}: CPU against reference"), &fast, &judge);
    assert!(judge.pixels.iter().any(|p| p[3] > 0.0), "{name}: an empty image proves nothing");
    #[cfg(feature = "gpu")]
    if let Some(frame) = gpu::render(job) {
        assert_within(&format!("{name}: GPU against CPU"), &frame.color, &fast);
        assert_eq!(frame.stats.broken_paths, 0, "{name}");
    }
}

/// RMSE 1e-5, maximum 1e-3.
pub fn assert_within(name: &str, a: &RgbaImage, b: &RgbaImage) {
    let (rmse, max) = difference(a, b);
    assert!(rmse <= 1e-5 && max <= 1e-3, "{name}: rmse {rmse:.2e}, max {max:.2e}");
}
