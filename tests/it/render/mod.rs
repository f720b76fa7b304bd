//! Renderers against closed forms and against the reference.

mod adaptive;
mod cells;
mod cuts;
mod depth;
mod formula;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod havs;
mod joint;
#[cfg(feature = "gpu")]
mod joint_gpu;
mod joint_orders;
mod lattice;
mod layers;
#[cfg(feature = "gpu")]
mod layers_gpu;
mod many_nodes;
mod partial;
mod raycast;
mod residual;
mod surfaces;
#[cfg(feature = "gpu")]
mod surfaces_gpu;
mod table3d;
mod transparent_cells;
mod upsampling;

use glam::DVec3;
use std::sync::Arc;
use tetreel::camera::{Camera, Projection};
use tetreel::image::RgbaImage;
use tetreel::mesh::Mesh;
use tetreel::node_table::{Node, NodeTable};
use tetreel::render::cpu::points::Points;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::points::{PointScene, PointStyle};
use tetreel::render::reference::Reference;
use tetreel::render::{Frame, RenderJob, Renderer};
use tetreel::visibility::{Drawn, Selection, finite_cells};

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
    let view = camera.view(size.0, size.1).unwrap();
    RenderJob::new(mesh.clone(), Arc::new(scalars), Arc::new(active), view, Arc::new(table))
}

pub fn raycast(job: &RenderJob) -> RgbaImage {
    Raycast::new().render(job.clone()).unwrap().planes.color.clone()
}

/// The job with all of its active cells as points.
pub fn with_points(job: &RenderJob, style: PointStyle) -> RenderJob {
    let mut cells = Drawn::default();
    cells.list(&Selection { ids: (*job.active).clone(), is_complete: true }, &mut Vec::new());
    RenderJob { points: Some(PointScene { cells: Arc::new(cells), style }), ..job.clone() }
}

/// The frame of a job by its cells as exact points.
pub fn points(job: &RenderJob) -> Frame {
    Points::new().render(with_points(job, PointStyle::EXACT)).unwrap().clone()
}

pub fn reference(job: &RenderJob) -> RgbaImage {
    Reference::new().render(job.clone()).unwrap().planes.color.clone()
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
        assert_within(&format!("{name}: GPU against CPU"), &frame.planes.color, &fast);
        assert_eq!(frame.stats.broken_paths, 0, "{name}");
    }
}

/// The project's bound for the root mean square over four channels and all pixels, of every fast path against the reference and of
/// the GPU against the CPU. A ray ends when less than 2^-17 = 7.6e-6 shines through, which is what all pixels may lack of a scene
/// that is opaque everywhere; to that come the roundings of f32 sums. Measured on the CPU: 3.2e-6 (a dipole in a torso, of which most
/// is opaque), 1.4e-6 elsewhere.
pub const BOUND_RMSE: f64 = 1e-5;
/// The same for single channels. A scalar right to 2^-24 of the range is on the other side of a step of the table for 2^-24 of a
/// ray's length at the field's slope, and in a spike of a millionth of the range for a sixteenth of it: that is for
/// GPUs, which have scalars in f32. Measured on the CPU, which has them in f64: 8.1e-6, the end of rays.
pub const BOUND_MAX: f64 = 1e-3;

pub fn is_within(a: &RgbaImage, b: &RgbaImage) -> bool {
    let (rmse, max) = difference(a, b);
    rmse <= BOUND_RMSE && max <= BOUND_MAX
}

pub fn assert_within(name: &str, a: &RgbaImage, b: &RgbaImage) {
    let (rmse, max) = difference(a, b);
    assert!(is_within(a, b), "{name}: rmse {rmse:.2e}, max {max:.2e}");
}

/// That [`assert_within`] would have failed, by both of its bounds: what makes a family of comparisons one that can fail.
pub fn assert_noticed(name: &str, a: &RgbaImage, b: &RgbaImage) {
    let (rmse, max) = difference(a, b);
    assert!(rmse > BOUND_RMSE && max > BOUND_MAX, "{name}: not noticed by rmse {rmse:.1e}, max {max:.1e}");
}

/// The job through an image plane a little wider than its own: a quarter of a pixel at the edges.
pub fn stretched(job: &RenderJob) -> RenderJob {
    let mut job = job.clone();
    job.view.half_width *= 1.0 + 0.5 / job.view.width_px as f64;
    job
}

/// Whether two images have the same colours at some pixels.
pub fn is_same_at(a: &RgbaImage, b: &RgbaImage, mut pixels: impl Iterator<Item = usize>) -> bool {
    assert_eq!((a.width, a.height), (b.width, b.height));
    pixels.all(|at| a.pixels[at] == b.pixels[at])
}

/// The same image with the ray of a pixel off by the last bit of its opacity: what a comparison of bits has to notice.
pub fn one_ray_off(image: &RgbaImage, at: usize) -> RgbaImage {
    let mut image = image.clone();
    let opacity = &mut image.pixels[at][3];
    *opacity = f32::from_bits(opacity.to_bits() ^ 1);
    image
}

/// Equal to the last bit, and more than an empty image.
pub fn assert_same(name: &str, a: &RgbaImage, b: &RgbaImage) {
    assert!(a == b, "{name}: rmse and max {:?}", difference(a, b));
    assert!(a.pixels.iter().any(|p| p[3] > 0.0), "{name}: an empty image proves nothing");
}
