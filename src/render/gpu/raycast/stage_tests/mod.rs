//! Every stage on the GPU against plain f64: what a shader has written is read back and judged by the definition, not by the
//! CPU's renderer. Each comparison is shown to notice a small change of one side.

mod entries;
mod rays;
mod transform;
mod walk;

use super::Raycast;
use crate::camera::{Camera, Projection, View};
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid_of};
use crate::mesh::{FACE_VERTICES, Mesh};
use crate::node_table::{Node, NodeTable};
use crate::render::gpu::context::{self, Context, ContextOptions};
use crate::render::gpu::layout::Params;
use crate::render::gpu::test_common as common;
use crate::render::{Frame, LayerRenderer, RenderJob, testing};
use crate::visibility::Skip;
use glam::DVec3;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// The GPU of this machine; without one `None`, and the test is reported as skipped.
pub(in crate::render::gpu) fn context() -> Option<Arc<Context>> {
    static CONTEXT: OnceLock<Result<Arc<Context>, String>> = OnceLock::new();
    let made = || Context::new(&ContextOptions::default()).map(Arc::new).map_err(|e| e.to_string());
    CONTEXT.get_or_init(made).clone().map_err(|why| common::skip("gpu", &why)).ok()
}

/// The same GPU as a window has it, which is shared with whoever draws the window.
pub(in crate::render::gpu) fn context_of_window() -> Option<Arc<Context>> {
    context()?;
    let (instance, options) = (context::instance(), ContextOptions::default());
    let adapters = pollster::block_on(instance.enumerate_adapters(context::BACKENDS));
    let adapter = context::best(&adapters, &options).unwrap();
    let asked = adapter.request_device(&context::descriptor(adapter, &options));
    let (device, queue) = pollster::block_on(asked).unwrap();
    Some(Arc::new(Context::of_window(adapter, device, queue)))
}

/// The renderer that all stage tests share: its shaders are compiled once.
fn renderer(context: &Arc<Context>) -> MutexGuard<'static, Raycast> {
    static RENDERER: OnceLock<Mutex<Raycast>> = OnceLock::new();
    let renderer = RENDERER.get_or_init(|| Mutex::new(Raycast::new(context.clone())));
    renderer.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Edges of the test meshes: cubes of size 1, four along each axis.
const CUBES: usize = 4;

/// A mesh without symmetries, its vertices moved and every `missing`-th of its cubes gone, at `offset` of the world.
pub(in crate::render::gpu) fn mesh(seed: u64, missing: usize, offset: DVec3) -> Arc<Mesh> {
    let keep = |[x, y, z]: [usize; 3]| missing == 0 || (x + 3 * y + 7 * z) % missing != 1;
    let mut raw = jittered(kuhn_grid_of([CUBES; 3], keep), &mut Random::new(seed));
    raw.points.iter_mut().for_each(|p| *p += offset);
    Arc::new(Mesh::build(raw).unwrap().0)
}

/// Views of a mesh at `offset`: outside, parallel, close with a wide angle, inside, and from very far.
pub(in crate::render::gpu) fn cameras(offset: DVec3) -> Vec<(&'static str, Camera)> {
    let middle = offset + DVec3::splat(0.5 * CUBES as f64);
    let look = |from: DVec3, to: DVec3, projection| Camera {
        position: middle + from,
        focal_point: middle + to,
        view_up: DVec3::Z,
        projection,
        near: 0.0,
    };
    let perspective = |view_angle| Projection::Perspective { view_angle };
    let to = DVec3::new(0.03, -0.07, 0.05);
    vec![
        ("outside", look(DVec3::new(7.1, -8.3, 5.2), to, perspective(30.0))),
        ("parallel", look(DVec3::new(1.3, 2.1, -4.2), to, Projection::Parallel { scale: 3.1 })),
        ("close", look(DVec3::new(2.61, 0.13, 0.21), to, perspective(100.0))),
        ("inside", look(DVec3::new(0.33, 0.21, 0.68), DVec3::new(-0.8, 0.2, -0.4), perspective(100.0))),
        ("far", look(DVec3::new(3.1e4, -5.3e4, 2.2e4), to, perspective(0.005))),
    ]
}

fn wave(p: DVec3) -> f64 {
    (2.1 * p.x + 0.3).sin() * (1.7 * p.y).cos() + 0.4 * (3.0 * p.z + p.x).sin()
}

pub(in crate::render::gpu) fn job(mesh: &Arc<Mesh>, camera: &Camera, size_px: (usize, usize)) -> RenderJob {
    let scalars: Vec<_> = mesh.positions.local.iter().map(|p| wave(2.0 * p.as_dvec3()) as f32).collect();
    let nodes = [(-1.2, [0.1, 0.2, 0.9], 0.1), (0.2, [0.2, 0.9, 0.3], 0.5), (1.3, [1.0, 0.4, 0.1], 0.2)];
    let nodes = nodes.map(|(scalar, rgb, tau)| Node { scalar, rgb, tau }).to_vec();
    let table = Arc::new(NodeTable::new(nodes).unwrap());
    let skip = Skip { opaque: false, ..Skip::ALL };
    RenderJob { skip, ..testing::job(mesh, scalars, camera, size_px, table) }
}

/// What view transform and entries have left on the GPU for a job.
struct Prepared {
    params: Params,
    /// Plane and depth of each vertex, as `ViewVertex` in `shaders/lib/frame.wgsl`.
    vertices: Vec<[f32; 8]>,
    /// The numbers behind them.
    behind: Vec<f32>,
    /// Ends of the tiles' lists, their sum, the lists.
    bins: Vec<u32>,
}

fn prepare(context: &Arc<Context>, job: &RenderJob) -> Prepared {
    let mut renderer = renderer(context);
    let layer = &mut renderer.layer.layer;
    let active = layer.begin(job.clone(), &mut Frame::default()).unwrap().unwrap();
    let words = |buffer: &wgpu::Buffer| read_back(context, buffer);
    let vertices = words(layer.scene.shared.vertices.vertices.get(context).unwrap());
    let (vertices, behind) = vertices.split_at(8 * job.mesh.positions.local.len());
    let vertices = bytemuck::cast_slice::<_, [f32; 8]>(vertices).to_vec();
    let behind = bytemuck::cast_slice(behind).to_vec();
    let bins = words(layer.scene.bins.get(context).unwrap());
    Prepared { params: active.params, vertices, behind, bins }
}

pub(in crate::render::gpu) fn read_back(context: &Context, buffer: &wgpu::Buffer) -> Vec<u32> {
    let device = &context.device;
    let staging = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("stage under test"),
        size: buffer.size(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    context.queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |result| result.unwrap());
    device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None }).unwrap();
    context.check().unwrap();
    let bytes = staging.get_mapped_range(..).unwrap();
    bytemuck::pod_collect_to_vec(&bytes[..])
}

/// Right, up and depth of a place from the eye: the definition of view coordinates.
pub(in crate::render::gpu) fn seen(view: &View, place: DVec3) -> DVec3 {
    let d = place - view.eye;
    DVec3::new(view.right.dot(d), view.up.dot(d), view.forward.dot(d))
}

/// How the ray of a pixel meets a triangle, by the definition in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render::gpu) enum Meeting {
    /// Not at all, or from behind.
    None,
    /// From its front (counter-clockwise), at this depth.
    Front(f64),
    /// So close to an edge that f32 may decide otherwise.
    Doubtful,
}

/// Below this share of the product of the reaches the sign of an edge function is in doubt for f32. A sheared coordinate is
/// right to 2^-23 of itself (`shaders/lib/ray.wgsl`), so each of the two products to 2^-22, and they are at most the product of
/// the reaches: together 2^-21. A factor of 4 is left for what f32 has lost of a vertex far from the ray.
const DOUBT: f64 = 1.0 / (1u64 << 19) as f64;

/// Corners in view coordinates, counter-clockwise from the front.
pub(in crate::render::gpu) fn meet(view: &View, (i, j): (usize, usize), corners: [DVec3; 3]) -> Meeting {
    let (px, py) = view.ray(i, j);
    let [a, b, c] = corners.map(|v| {
        let h = if view.perspective { v.z } else { 1.0 };
        DVec3::new(v.x - px * h, v.y - py * h, v.z)
    });
    let reach = |v: DVec3| v.x.abs() + v.y.abs();
    let edge = |a: DVec3, b: DVec3| (a.x * b.y - b.x * a.y, DOUBT * reach(a) * reach(b));
    let edges = [edge(b, c), edge(c, a), edge(a, b)];
    if edges.iter().any(|&(value, doubt)| value < -doubt) {
        return Meeting::None;
    }
    if edges.iter().any(|&(value, doubt)| value <= doubt) {
        // Seen from behind, two or three signs are negative; here none is beyond doubt.
        return Meeting::Doubtful;
    }
    let sum = edges[0].0 + edges[1].0 + edges[2].0;
    Meeting::Front((edges[0].0 * a.z + edges[1].0 * b.z + edges[2].0 * c.z) / sum)
}

/// Corners of the face opposite vertex `opposite` of a cell, in view coordinates.
fn face(job: &RenderJob, view: &View, cell: u32, opposite: usize) -> [DVec3; 3] {
    let tet = job.mesh.topology.tets[cell as usize];
    FACE_VERTICES[opposite].map(|v| seen(view, job.mesh.positions.local[tet[v] as usize].as_dvec3()))
}

/// Whether a face of an active cell has no active cell behind it.
fn is_open(job: &RenderJob, cell: u32, opposite: usize) -> bool {
    let behind = job.mesh.topology.connectivity().neighbours[cell as usize][opposite].cell();
    behind.is_none_or(|n| !job.active.contains(n))
}

/// All active cells.
pub(in crate::render::gpu) fn active_cells(job: &RenderJob) -> Vec<u32> {
    (0..job.active.universe() as u32).filter(|&cell| job.active.contains(cell)).collect()
}

/// Whether the eye is strictly inside a cell.
pub(in crate::render::gpu) fn has_eye(job: &RenderJob, view: &View, cell: u32) -> bool {
    view.perspective
        && (0..4).all(|opposite| {
            let [a, b, c] = face(job, view, cell, opposite);
            // The eye is the origin, faces are counter-clockwise from outside, view coordinates left-handed. Beyond the rounding
            // of f64: products of three coordinates below 10 are off by 1e-12 at most where a cell is near enough to hold the eye.
            a.dot((b - a).cross(c - a)) < -1e-9
        })
}
