//! Scenes on which renderers go wrong, each drawn on every path and judged by the reference.
//!
//! A [`Case`] is a mesh, a field, a transfer function and cameras. [`Case::run`] draws it by the ray caster, by faces in exact
//! order (buffers of 2 and 8) and by cells as points on the CPU and where there is a GPU on it, compares with the reference, prints what it measured
//! (`cargo test stress -- --nocapture`), and shows that the comparison notices a lost cell, an exchanged pair of scalars or a
//! moved vertex on each of those paths.
//!
//! Bounds: [`ON_CPU`], and [`BOUND`] for all other paths. Exceptions are named: [`THIN_ON_GPU`], [`geometry::table3d_bound`].
//! A case is ambiguous where a ray lies in a face of the boundary: it is inside or outside as one likes. Which rays do is found by
//! a definition of its own ([`ambiguity`]), and only those pixels are left out.

mod ambiguity;
mod arithmetic;
mod ball;
mod cameras;
mod closed_form;
mod degenerate;
mod eyes;
mod fields;
mod geometry;
mod order;
mod perturbed;
mod repair;
mod shapes;
mod symmetry;
mod tables;
mod watertight;

use crate::render::havs::{havs, with_all_faces, with_buffer};
use crate::render::{BOUND_MAX, BOUND_RMSE, camera, dense, job, points, table, wave};
use std::sync::Arc;
use tetreel::camera::{Camera, Projection};
use tetreel::image::RgbaImage;
use tetreel::mesh::Mesh;
use tetreel::node_table::{Node, NodeTable};
use tetreel::optics::OpticsKind;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::{Frame, RenderJob, Renderer};

/// What an image may be off by, over four channels and all pixels that are not ambiguous.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    pub rmse: f64,
    pub max: f64,
}

/// The project's bound for every fast path.
pub const BOUND: Bound = Bound { rmse: BOUND_RMSE, max: BOUND_MAX };

/// On the CPU, where scalars are f64 and no ray is on the wrong side of a step by more than rounding. Measured over all cases: 3.7e-7
/// and 7.5e-6, the latter of a ray that ends when less than 2^-17 shines through.
pub const ON_CPU: Bound = Bound { rmse: 2e-6, max: 2e-5 };

/// On the GPU, slivers of 1e-5 and layers of 1e-6: where they are visible they are computed in f64, if the device has it. (One that
/// has not misses this by far: `slivers_agree_in_f64_and_nearly_in_f32`.)
pub const THIN_ON_GPU: Bound = Bound { rmse: 1e-5, max: 2e-3 };

impl Bound {
    fn holds(&self, (rmse, max): (f64, f64)) -> bool {
        rmse <= self.rmse && max <= self.max
    }
}

/// A way to draw a job.
pub struct Path {
    pub name: &'static str,
    pub on_gpu: bool,
    /// `None` if there is no GPU.
    pub render: fn(&RenderJob) -> Option<Frame>,
}

/// All ways that are to give the reference's image.
pub fn paths() -> Vec<Path> {
    fn faces(job: &RenderJob, k: u8) -> RenderJob {
        with_buffer(&with_all_faces(job), k, true)
    }
    let cpu = |name, render: fn(&RenderJob) -> Option<Frame>| Path { name, on_gpu: false, render };
    #[allow(unused_mut, reason = "there is more with a GPU")]
    let mut paths = vec![
        cpu("raycast", |job| Some(Raycast::new().render(job.clone()).unwrap().clone())),
        cpu("havs, k 2", |job| Some(havs(&faces(job, 2)))),
        cpu("havs, k 8", |job| Some(havs(&faces(job, 8)))),
        cpu("points", |job| Some(points(job))),
    ];
    #[cfg(feature = "gpu")]
    {
        let gpu = |name, render: fn(&RenderJob) -> Option<Frame>| Path { name, on_gpu: true, render };
        paths.push(gpu("raycast, GPU", crate::render::gpu::render));
        paths.push(gpu("havs, GPU", |job| crate::render::havs::gpu::render(&faces(job, 8))));
        paths.push(gpu("points, GPU", crate::render::gpu::points));
    }
    paths
}

/// A scene, and what may be asked of it.
#[derive(Clone)]
pub struct Case {
    pub name: String,
    pub mesh: Arc<Mesh>,
    pub scalars: Vec<f32>,
    pub table: NodeTable,
    pub optics: OpticsKind,
    pub cameras: Vec<Camera>,
    pub size: (usize, usize),
    /// Why some rays have no one answer.
    pub ambiguous: Option<&'static str>,
    /// What counts as 1: errors are divided by it. For images that are everywhere nearly transparent.
    pub unit: f64,
    pub bound: Bound,
    pub bound_on_gpu: Bound,
}

impl Case {
    /// From all sides, with all rays unambiguous.
    pub fn new(name: impl Into<String>, mesh: &Arc<Mesh>, scalars: Vec<f32>, table: NodeTable) -> Self {
        Self {
            name: name.into(),
            mesh: mesh.clone(),
            scalars,
            table,
            optics: OpticsKind::Exact,
            cameras: cameras::around(),
            size: (49, 49),
            ambiguous: None,
            unit: 1.0,
            bound: ON_CPU,
            bound_on_gpu: BOUND,
        }
    }

    pub fn jobs(&self) -> Vec<RenderJob> {
        let make = |camera| job(&self.mesh, self.scalars.clone(), camera, self.size, self.table.clone());
        self.cameras.iter().map(|camera| RenderJob { optics: self.optics, ..make(camera) }).collect()
    }

    fn bound_of(&self, path: &Path) -> Bound {
        if path.on_gpu { self.bound_on_gpu } else { self.bound }
    }

    /// Draws all on every path and compares.
    pub fn run(&self) {
        let judged: Vec<Judged> = self.jobs().into_iter().map(|job| Judged::new(job, self.unit)).collect();
        let seen = judged.iter().flat_map(|j| &j.image.pixels).filter(|p| p[3] > 0.0).count();
        assert!(seen > 0, "{}: an empty image proves nothing", self.name);
        let ambiguous = judged.iter().flat_map(|j| &j.is_clear_cut).filter(|clear_cut| !**clear_cut).count();
        assert_eq!(ambiguous > 0, self.ambiguous.is_some(), "{}: {ambiguous} rays in boundary faces", self.name);
        for path in paths() {
            let Some(worst) = self.worst(&path, &judged) else { continue };
            let note = if ambiguous > 0 { format!(", without {ambiguous} ambiguous pixels") } else { String::new() };
            eprintln!("{} | {} | {:.1e} | {:.1e} | {seen} pixels{note}", self.name, path.name, worst.0, worst.1);
        }
        perturbed::assert_noticed(self, &judged);
    }

    /// The largest errors of a path over all views.
    fn worst(&self, path: &Path, judged: &[Judged]) -> Option<(f64, f64)> {
        let bound = self.bound_of(path);
        let mut worst = (0f64, 0f64);
        for (i, judged) in judged.iter().enumerate() {
            let frame = (path.render)(&judged.job)?;
            let name = format!("{}, {}, camera {i}", self.name, path.name);
            assert_eq!(frame.stats.broken_paths, 0, "{name}");
            assert_plausible(&name, &frame.planes.color);
            let errors = judged.errors(&frame.planes.color);
            assert!(bound.holds(errors), "{name}: rmse {:.2e}, max {:.2e} of {bound:?}", errors.0, errors.1);
            worst = (worst.0.max(errors.0), worst.1.max(errors.1));
        }
        Some(worst)
    }
}

/// What holds of any image, ambiguous pixels included: numbers, opacities and colours up to what f32 rounds 1 to.
fn assert_plausible(name: &str, image: &RgbaImage) {
    let most = 1.0 + 16.0 * f32::EPSILON;
    let is_wrong = |p: &&[f32; 4]| !p.iter().all(|v| (0.0..=most).contains(v));
    assert_eq!(image.pixels.iter().find(is_wrong), None, "{name}");
}

/// A job and what the reference says of it.
pub struct Judged {
    pub job: RenderJob,
    pub image: RgbaImage,
    /// Of each pixel, whether its ray has one answer.
    pub is_clear_cut: Vec<bool>,
    unit: f64,
}

impl Judged {
    pub fn new(job: RenderJob, unit: f64) -> Self {
        let image = crate::render::reference(&job);
        let is_clear_cut = ambiguity::rays_in_boundary_faces(&job).into_iter().map(|lies_in_face| !lies_in_face);
        Self { image, is_clear_cut: is_clear_cut.collect(), unit, job }
    }

    /// Root mean square and maximum of an image's errors over what has one answer.
    pub fn errors(&self, image: &RgbaImage) -> (f64, f64) {
        let (mut sum, mut max, mut count) = (0.0, 0f64, 0);
        let pixels = image.pixels.iter().zip(&self.image.pixels).zip(&self.is_clear_cut);
        for ((a, b), _) in pixels.filter(|(_, clear_cut)| **clear_cut) {
            for (a, b) in a.iter().zip(b) {
                let error = (f64::from(*a) - f64::from(*b)).abs() / self.unit;
                assert!(error.is_finite());
                (sum, max, count) = (sum + error * error, max.max(error), count + 1);
            }
        }
        ((sum / f64::from(count)).sqrt(), max)
    }
}

/// [`dense`] for a world of another size.
pub fn dense_per(length: f64) -> NodeTable {
    NodeTable::new(dense().nodes().iter().map(|n| Node { tau: n.tau / length, ..*n }).collect()).unwrap()
}

/// Runs the cases, and says first what the columns are.
pub fn run(cases: impl IntoIterator<Item = Case>) {
    eprintln!("case | path | rmse | max |");
    cases.into_iter().for_each(|case| case.run());
}
