//! Isosurfaces on the GPU, against the CPU and the judge.

use super::gpu::{context, own_context, points as points_on_gpu, render as walked};
use super::havs::gpu::render as drawn;
use super::havs::{havs, with_all_faces, with_buffer, with_some_faces};
use super::joint::{LAYERS, ROWS, SCALARS, cell_values, noisy, vertex_values, with_joint_table};
use super::surfaces::*;
use super::*;
use crate::meshes::noise;
use tetreel::codec::vq::VqOptions;
use tetreel::image::Planes;
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::optics::OpticsKind;
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::render::Frame;
use tetreel::render::gpu::context::{ContextOptions, Tier};
use tetreel::render::gpu::havs::Havs as GpuHavs;
use tetreel::render::gpu::raycast::Raycast as GpuRaycast;
use tetreel::render::surfaces::{Isosurface, Light, Normals, SurfaceShading};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// Frames of the ray caster, and of the renderers of faces and of points.
fn by_all(job: &RenderJob) -> [(&'static str, Frame); 3] {
    let faces = drawn(&with_all_faces(job)).unwrap();
    [("walk", walked(job).unwrap()), ("faces", faces), ("points", points_on_gpu(job).unwrap())]
}

/// How far two images are apart.
#[derive(Debug, Default)]
struct Apart {
    /// Pixels at which the image has an edge.
    edges: usize,
    /// Pixels of which one has a sheet that the other has not.
    other_sheets: usize,
    /// Squares of the differences of all other pixels.
    squares: f64,
    /// Their channels.
    channels: usize,
    /// The largest difference of theirs.
    max: f64,
    /// Largest difference of depths of the same sheet.
    depth: f64,
}

/// Two pixels differ by more than that if one has a sheet that the other has not: sheets of the scenes have opacities of 0.2 and more.
const SHEET: f64 = 0.01;

impl Apart {
    fn add(&mut self, found: &Planes, expected: &Planes) {
        let (width, pixels) = (expected.color.width, &expected.color.pixels);
        let differ = |a: &[f32; 4], b: &[f32; 4]| {
            a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).fold(0.0, f64::max)
        };
        for (i, (a, b)) in found.color.pixels.iter().zip(pixels).enumerate() {
            let is_beside = |j: usize| pixels.get(j).is_some_and(|other| differ(b, other) > 0.05);
            self.edges += usize::from(is_beside(i + 1) || is_beside(i + width));
            let [near, far] = [&found.depth.pixels[i], &expected.depth.pixels[i]].map(|depth| f64::from(*depth));
            let depth = if near == far { 0.0 } else { (near - far).abs() };
            if differ(a, b) > SHEET || !depth.is_finite() {
                self.other_sheets += 1;
                continue;
            }
            self.squares += a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
            self.channels += 4;
            (self.max, self.depth) = (self.max.max(differ(a, b)), self.depth.max(depth));
        }
    }

    fn rmse(&self) -> f64 {
        (self.squares / self.channels.max(1) as f64).sqrt()
    }
}

/// The bound on the share of edge pixels with other sheets than on the CPU. Scalars of hits are right to some 2^-23 of the range, which
/// moves a silhouette by that over the slope of the field: far less than a thousandth of a pixel. Of small images one pixel. Measured: none.
const OTHER_SHEETS: f64 = 1e-3;
/// Bounds for light on slivers in f32: a depth is right to 2^-23, 3e-4 of the height of these cells, and so are the shares of their corners
/// in a normal, or more along rays that run along them. Measured: 3.6e-5 and 1.2e-3.
const SLIVERS_IN_F32: [f64; 2] = [1e-4, 5e-3];

impl Apart {
    fn of(found: &Planes, expected: &Planes) -> Self {
        let mut apart = Self::default();
        apart.add(found, expected);
        apart
    }

    /// Whether images agree that have lengths of `unit` for those of a mesh of 2 a side.
    ///
    /// Light is the cosine of a normal that is right to some 2^-24 of a cell's longest edge over its height: 1.5e-5 at most where that is 256,
    /// and in few pixels; thinner cells are computed in f64. A depth is off by a scalar's 2^-23 of the range over the slope along the ray,
    /// which the scenes have of 0.01 of it a unit and more in nearly all pixels.
    fn is_close(&self, unit: f64) -> bool {
        self.is_within([BOUND_RMSE, BOUND_MAX], unit)
    }

    fn is_within(&self, [rmse, max]: [f64; 2], unit: f64) -> bool {
        let others = (OTHER_SHEETS * self.edges as f64).max(1.0);
        let light = self.rmse() <= rmse && self.max <= max;
        light && self.depth <= unit * DEPTH_BOUND && self.other_sheets as f64 <= others
    }

    fn assert_close(&self, name: &str, unit: f64) {
        self.assert_within(name, [BOUND_RMSE, BOUND_MAX], unit);
    }

    fn assert_within(&self, name: &str, light: [f64; 2], unit: f64) {
        let numbers = format!(
            "rmse {:.1e}, max {:.1e}, depth {:.1e}, {} of {} edge pixels",
            self.rmse(),
            self.max,
            self.depth / unit,
            self.other_sheets,
            self.edges
        );
        eprintln!("{name}: {numbers}");
        assert!(self.edges > 100, "{name}: an image without surfaces proves nothing");
        assert!(self.is_within(light, unit), "{name}: {numbers}");
    }
}

fn assert_all_close(name: &str, job: &RenderJob, expected: &Planes) {
    for (path, frame) in by_all(job) {
        let name = format!("{name}, {path}");
        assert_eq!((frame.stats.broken_paths, frame.stats.out_of_order), (0, 0), "{name}");
        Apart::of(&frame.planes, expected).assert_close(&name, 1.0);
    }
}

#[test]
fn all_renderers_draw_the_surfaces_of_the_cpu() {
    if context().is_none() {
        return;
    }
    for (name, job) in scenes() {
        let cpu = planes("raycast", &job);
        assert_all_close(&name, &job, &cpu);
        for (path, frame) in by_all(&stretched(&job)) {
            assert!(!Apart::of(&frame.planes, &cpu).is_close(1.0), "{name}, {path}: not noticed");
        }
    }
}

#[test]
fn other_isovalues_normals_lights_and_sides_are_noticed() {
    if context().is_none() {
        return;
    }
    let base = with_holes((61, 47), OUTSIDE, PERSPECTIVE);
    let above = Light::From([0.3, -0.5, 2.0]);
    let of = |sheet: Isosurface, normals, light| {
        alone(&base, &[sheet], SurfaceShading { normals, light, ..Default::default() })
    };
    let sheet = Isosurface { back: Some(BLUE), ..surface(0.2, RED, 0.7) };
    let cpu = planes("raycast", &of(sheet, Normals::Vertex, above));
    assert_all_close("as asked", &of(sheet, Normals::Vertex, above), &cpu);
    for (what, job) in [
        ("moved by 2e-3 of the range", of(Isosurface { value: 0.205, ..sheet }, Normals::Vertex, above)),
        ("facets", of(sheet, Normals::Cell, above)),
        ("no light", of(sheet, Normals::None, above)),
        ("light from the eye", of(sheet, Normals::Vertex, Light::Headlight)),
        ("another back", of(Isosurface { back: None, ..sheet }, Normals::Vertex, above)),
        ("another opacity", of(Isosurface { opacity: 0.69, ..sheet }, Normals::Vertex, above)),
    ] {
        for (path, frame) in by_all(&job) {
            assert!(!Apart::of(&frame.planes, &cpu).is_close(1.0), "{what}, {path}: not noticed");
        }
    }
}

#[test]
fn all_optics_have_surfaces() {
    if context().is_none() {
        return;
    }
    for (from, projection) in [("perspective", PERSPECTIVE), ("parallel", Projection::Parallel { scale: 1.7 })] {
        let base = with_holes((61, 47), OUTSIDE, projection);
        for optics in OpticsKind::ALL {
            for normals in [Normals::Cell, Normals::Vertex] {
                let job = with_surfaces(&RenderJob { optics, ..base.clone() }, &sheets(), shading(normals));
                assert_all_close(&format!("{optics}, {from}, {normals}"), &job, &planes("raycast", &job));
            }
        }
    }
}

/// A job of [`with_holes`] with a table of more than the scalar.
fn joint_job(projection: Projection, cells: bool) -> RenderJob {
    let base = with_holes((61, 47), OUTSIDE, projection);
    let cell = cells.then(|| cell_values(&base));
    with_joint_table(&base, noisy(&SCALARS, &ROWS, &LAYERS, 3), Some(vertex_values(&base)), cell)
}

#[test]
fn joint_tables_have_surfaces() {
    if context().is_none() {
        return;
    }
    for (projection, cells) in [(PERSPECTIVE, true), (Projection::Parallel { scale: 1.7 }, false)] {
        for normals in [Normals::Cell, Normals::Vertex] {
            let joint = joint_job(projection, cells);
            let job = with_surfaces(&joint, &sheets(), shading(normals));
            let judge = planes("reference", &job);
            assert_all_close(&format!("joint, {normals}"), &job, &judge);
            for (path, frame) in by_all(&joint) {
                assert!(!Apart::of(&frame.planes, &judge).is_close(1.0), "{path}: not noticed");
            }
        }
    }
}

#[test]
fn eyes_within_the_mesh_see_what_the_cpu_sees() {
    if context().is_none() {
        return;
    }
    let base = with_holes((40, 32), OUTSIDE, PERSPECTIVE);
    let mut all = Apart::default();
    for seed in 0..12 {
        let random = |i: u64| noise(seed, i);
        let position = 0.8 * DVec3::new(random(0), random(1), random(2));
        let eye = Camera { position, ..camera(DVec3::new(3.0, random(3), random(4)), PERSPECTIVE) };
        // The near plane cuts cells, and surfaces in them.
        let eye = Camera { near: 0.1 * (seed % 3) as f64, ..eye };
        let base = RenderJob { view: eye.view(40, 32).unwrap(), ..base.clone() };
        let job = with_surfaces(&base, &sheets(), shading(Normals::Vertex));
        let cpu = planes("raycast", &job);
        by_all(&job).iter().for_each(|(_, frame)| all.add(&frame.planes, &cpu));
    }
    all.assert_close("eyes within", 1.0);
}

#[test]
fn some_faces_and_small_buffers_have_the_surfaces_of_the_cpu() {
    if context().is_none() {
        return;
    }
    let base = with_holes((61, 47), OUTSIDE, PERSPECTIVE);
    for normals in [Normals::Cell, Normals::Vertex] {
        let job = with_surfaces(&base, &sheets(), shading(normals));
        for (what, job) in [
            ("some faces", with_some_faces(&job, 0.4, 1)),
            ("k of 2", with_buffer(&with_all_faces(&job), 2, false)),
            ("some faces, k of 4", with_buffer(&with_some_faces(&job, 0.4, 2), 4, false)),
        ] {
            let name = format!("{what}, {normals}");
            Apart::of(&drawn(&job).unwrap().planes, &havs(&job).planes).assert_close(&name, 1.0);
        }
    }
}

#[test]
fn steps_of_a_jet_decoded_on_the_gpu_have_the_surfaces_of_the_cpu() {
    let Some(context) = context() else { return };
    let series = generate(&SynthSpec { cells: 4000, steps: 66, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("jet.zarr");
    let codec = CodecChoice::new(VqOptions { entries: 256, ..Default::default() });
    ingest(&series, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
    let mut pipeline = Pipeline::open(&Store::open(&path).unwrap(), None).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let table = Arc::new(table(&[(0.0, [0.2, 0.4, 1.0], 0.05), (1.0, [1.0, 0.3, 0.1], 0.4)]));
    let mut walk = GpuRaycast::new(context.clone());
    let mut faces = GpuHavs::new(context);
    for (step, normals, volume) in
        [(5, Normals::Cell, false), (6, Normals::Vertex, true), (63, Normals::Vertex, false), (64, Normals::Cell, true)]
    {
        let request = FrameRequest::new(step, camera, table.clone(), (120, 90)).with_tets(|tets| {
            tets.surfaces = vec![surface(0.3, RED, 0.6), surface(0.6, BLUE, 0.8)];
            (tets.shading, tets.volume) = (shading(normals), volume);
        });
        let job = pipeline.prepare(&request).unwrap();
        let (cpu, scale) = (planes("raycast", &job), job.mesh.positions.scale);
        let frames = [walk.render(job.clone()).unwrap().clone(), faces.render(with_all_faces(&job)).unwrap().clone()];
        for (path, frame) in ["walk", "faces"].into_iter().zip(frames) {
            assert!(frame.stats.vertices_decoded_on_gpu > 0 && frame.stats.on_gpu);
            Apart::of(&frame.planes, &cpu).assert_close(&format!("step {step}, {normals}, {path}"), scale);
        }
    }
}

#[test]
fn scalars_of_any_size_have_the_surfaces_of_the_cpu() {
    if context().is_none() {
        return;
    }
    let base = with_holes((40, 31), OUTSIDE, PERSPECTIVE);
    // Times a number, and far from zero; denormal ones are multiplied before they are sent.
    for (times, offset) in [(1e-40, 0.0), (1e-20, 0.0), (1e34, 0.0), (1.0, 300.0), (1e-3, -7.0)] {
        let scaled = |s: f64| f64::from((s * times + offset) as f32);
        let scalars = Arc::new(base.scalars.values().iter().map(|&s| scaled(f64::from(s)) as f32).collect::<Vec<_>>());
        let nodes: Vec<_> =
            base.table.nodes().iter().map(|node| Node { scalar: scaled(node.scalar), ..*node }).collect();
        let table = Arc::new(NodeTable::new(nodes).unwrap());
        let job = RenderJob { scalars: scalars.into(), table, ..base.clone() };
        let sheets: Vec<_> = sheets().iter().map(|s| Isosurface { value: scaled(s.value), ..*s }).collect();
        for normals in [Normals::Cell, Normals::Vertex] {
            for (what, job) in [
                ("in the volume", with_surfaces(&job, &sheets, shading(normals))),
                ("alone", alone(&job, &sheets, shading(normals))),
                ("one", alone(&job, &sheets[..1], shading(normals))),
            ] {
                assert_all_close(&format!("{times:e}, {offset}, {normals}, {what}"), &job, &planes("raycast", &job));
            }
        }
    }
}

#[test]
fn frames_with_and_without_surfaces_take_turns() {
    if context().is_none() {
        return;
    }
    let base = with_holes((40, 31), OUTSIDE, PERSPECTIVE);
    let joint = joint_job(PERSPECTIVE, true);
    let smooth = shading(Normals::Vertex);
    let other = RenderJob {
        scalars: Arc::new(base.scalars.values().iter().map(|s| 0.9 * s).collect::<Vec<_>>()).into(),
        ..base.clone()
    };
    let jobs = [
        base.clone(),
        with_surfaces(&base, &sheets(), smooth),
        joint.clone(),
        with_surfaces(&joint, &sheets(), smooth),
        with_surfaces(&other, &sheets(), smooth),
        alone(&base, &sheets()[1..], shading(Normals::Cell)),
        slivers(),
        with_surfaces(&slivers(), &sheets(), smooth),
    ];
    let first: Vec<_> = jobs.iter().map(|job| by_all(job).map(|(_, frame)| frame.planes)).collect();
    // Each after each other one.
    for turn in 1..jobs.len() {
        for i in (0..jobs.len()).map(|i| i * turn % jobs.len()) {
            assert!(by_all(&jobs[i]).map(|(_, frame)| frame.planes) == first[i], "job {i}, turn {turn}");
        }
    }
}

#[test]
fn bands_change_no_bit_of_surfaces() {
    let Some(context) = context() else { return };
    let job = with_surfaces(&with_holes((61, 47), OUTSIDE, PERSPECTIVE), &sheets(), shading(Normals::Vertex));
    let job = with_all_faces(&job);
    let mut banded = GpuHavs::with_fragment_bytes(context, 100_000);
    let frame = banded.render(job.clone()).unwrap().clone();
    assert!(banded.band_count() > 3, "{} bands", banded.band_count());
    assert!(frame.planes == drawn(&job).unwrap().planes);
}

#[test]
fn surfaces_keep_within_the_default_limits_of_webgpu() {
    let web = ContextOptions { tier: Tier::WebGpu, ..ContextOptions::default() };
    let Some(context) = own_context(&web) else { return };
    let (mut walk, mut faces) = (GpuRaycast::new(context.clone()), GpuHavs::new(context));
    let mut worst: f64 = 0.0;
    for (name, job) in scenes() {
        let cpu = planes("raycast", &job);
        let (are_thin, all_faces) = (name.starts_with("slivers"), with_all_faces(&job));
        for (path, frame) in [("walk", walk.render(job).unwrap()), ("faces", faces.render(all_faces).unwrap())] {
            assert!(!frame.stats.in_f64);
            let apart = Apart::of(&frame.planes, &cpu);
            let light = if are_thin { SLIVERS_IN_F32 } else { [BOUND_RMSE, BOUND_MAX] };
            apart.assert_within(&format!("{name}, {path}, without f64"), light, 1.0);
            worst = worst.max(apart.rmse());
        }
    }
    assert!(worst > BOUND_RMSE, "f32 is enough: {worst:.1e}");
}

#[test]
fn a_steady_frame_makes_and_sends_nothing_anew() {
    let Some(context) = own_context(&ContextOptions::default()) else { return };
    let base = with_holes((40, 31), OUTSIDE, PERSPECTIVE);
    let job = with_surfaces(&base, &sheets(), shading(Normals::Vertex));
    let (mut walk, mut faces) = (GpuRaycast::new(context.clone()), GpuHavs::new(context.clone()));
    let mut sent = |job: &RenderJob| {
        let walk = walk.render(job.clone()).unwrap().stats.bytes_uploaded;
        [walk, faces.render(job.clone()).unwrap().stats.bytes_uploaded]
    };
    let job = with_all_faces(&job);
    sent(&job);
    let made = context.resources_created();
    assert_eq!((sent(&job), context.resources_created()), ([0, 0], made));
    // Another colour: the sheets alone.
    let mut other = sheets();
    other[0].front = Some(BLUE);
    let gradients = with_surfaces(&base, &other, shading(Normals::Cell));
    let other = RenderJob { surfaces: gradients.surfaces, ..job.clone() };
    let of_sheets = sent(&other);
    assert!(of_sheets.iter().all(|&bytes| bytes > 0 && bytes < 2000), "{of_sheets:?} bytes");
}
