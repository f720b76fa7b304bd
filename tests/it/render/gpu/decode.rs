//! Codec `vq` decoded on the GPU: the frame is that of the scalars that the CPU decodes, to the bit.

use super::*;
use tetreel::codec::vq::VqOptions;
use tetreel::field::{Association, Component, FieldInfo, Scalars, SeriesSource, TimeAxis};
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::mesh::{RawMesh, SolidShape, SourceCells};
use tetreel::pipeline::{FaceDetail, FrameRequest, FrameTime, Pipeline, TetDraw};
use tetreel::render::gpu::havs::Havs as GpuHavs;
use tetreel::render::{CompressedScalars, CompressedStep};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, Synth, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// A generated series with holes, and steps of so different sizes that powers of two matter.
struct Odd {
    series: Synth,
    fields: Vec<FieldInfo>,
    /// Instead of the series' mesh, with values of its cells.
    of_cells: Option<RawMesh>,
}

impl SeriesSource for Odd {
    fn describe(&self) -> String {
        "odd".to_owned()
    }
    fn times(&self) -> &TimeAxis {
        self.series.times()
    }
    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }
    fn mesh(&self) -> tetreel::error::FileResult<RawMesh> {
        self.of_cells.clone().map_or_else(|| self.series.mesh(), Ok)
    }
    fn read(&self, f: &FieldInfo, c: Component, step: usize, out: &mut Vec<f32>) -> tetreel::error::FileResult<()> {
        match &self.of_cells {
            None => self.series.read(f, c, step, out)?,
            Some(mesh) => *out = (0..mesh.cells.len()).map(|i| (0.7 * i as f32 + 0.1 * step as f32).cos()).collect(),
        }
        for (i, value) in out.iter_mut().enumerate() {
            *value = *value * 10f32.powi(i as i32 % 7 - 3) + 0.3 * (i as f32 * 0.1 + step as f32 * 0.2).sin();
            if i % 97 == 5 {
                *value = f32::NAN;
            }
        }
        Ok(())
    }
}

/// A box of tetrahedra, or of hexahedra.
fn mesh_of_cells(are_cubes: bool) -> RawMesh {
    let n = 8;
    let mut raw = crate::meshes::grid(n, 0.1, 3, |_| true);
    if are_cubes {
        let at = |x: usize, y: usize, z: usize| (x + (n + 1) * (y + (n + 1) * z)) as u32;
        raw.cells.tets.clear();
        for (x, y, z) in (0..n * n * n).map(|i| (i % n, i / n % n, i / n / n)) {
            let layer = |z: usize| [at(x, y, z), at(x + 1, y, z), at(x + 1, y + 1, z), at(x, y + 1, z)];
            raw.cells.solids.push(SolidShape::Hexahedron, [layer(z), layer(z + 1)].concat().into_iter());
        }
    }
    raw
}

/// Series of three blocks, the last one short, compressed in this way.
struct Stored {
    name: String,
    pipeline: Pipeline,
    _dir: tempfile::TempDir,
}

impl Stored {
    fn new(entries: usize, own_scales: bool) -> Self {
        Self::with(entries, own_scales, None)
    }

    /// A field of the cells of a mesh.
    fn of_cells(entries: usize, own_scales: bool, are_cubes: bool) -> Self {
        let stored = Self::with(entries, own_scales, Some(mesh_of_cells(are_cubes)));
        Self { name: format!("{}, {}", stored.name, if are_cubes { "cubes" } else { "tetrahedra" }), ..stored }
    }

    fn with(entries: usize, own_scales: bool, of_cells: Option<RawMesh>) -> Self {
        let series = generate(&SynthSpec { cells: 3000, steps: 130, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        let association = if of_cells.is_some() { Association::Cell } else { Association::Point };
        let fields = vec![FieldInfo { association, ..series.fields()[0].clone() }];
        let odd = Odd { fields, series, of_cells };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("odd.zarr");
        let codec = CodecChoice::new(VqOptions { entries, own_scales, ..Default::default() });
        ingest(&odd, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
        let pipeline = Pipeline::open(&Store::open(&path).unwrap(), None).unwrap();
        Self { name: format!("{entries} entries"), pipeline, _dir: dir }
    }

    fn job(&mut self, time: FrameTime, draw: TetDraw) -> RenderJob {
        let table = table(&[(-1.0, [1.0, 0.2, 0.1], 0.05), (0.5, [0.1, 1.0, 0.3], 0.4), (2.0, [0.2; 3], 1.0)]);
        let camera = Camera::default_for(self.pipeline.mesh().positions.world_bounds()).unwrap();
        let request = FrameRequest::new(time, camera, Arc::new(table), (64, 48)).with_tets(|tets| tets.draw = draw);
        self.pipeline.prepare(&request).unwrap()
    }
}

const DRAWS: [TetDraw; 2] = [TetDraw::Raycast, TetDraw::Faces(FaceDetail::ALL)];

/// A renderer of its own.
fn renderer(draw: TetDraw, context: &Arc<Context>) -> Box<dyn Renderer> {
    match draw {
        TetDraw::Faces(_) => Box::new(GpuHavs::new(context.clone())),
        _ => Box::new(GpuRaycast::new(context.clone())),
    }
}

/// The frame of a job.
fn drawn(renderer: &mut dyn Renderer, job: &RenderJob) -> Frame {
    renderer.render_unless_cancelled(job.clone()).unwrap().unwrap().clone()
}

/// The job with these scalars, which no renderer has seen; the CPU has decoded them.
fn sent(job: &RenderJob, scalars: impl IntoIterator<Item = f32>) -> RenderJob {
    let scalars = Scalars::new(job.scalars.association(), Arc::new(scalars.into_iter().collect()));
    RenderJob { compressed: None, scalars, ..job.clone() }
}

/// Light, opacities and depths to the bit.
fn bits(frame: &Frame) -> Vec<u32> {
    let color = &frame.planes.color.pixels;
    assert!(color.iter().any(|pixel| pixel[3] > 0.1), "an empty image proves nothing");
    color.iter().flatten().chain(&frame.planes.depth.pixels).map(|number| number.to_bits()).collect()
}

/// Times, and the blocks that each adds to those in the GPU's memory: the last two that were needed at once.
fn times() -> [(FrameTime, u64); 12] {
    let between = FrameTime::between;
    [
        (0.into(), 1),
        (1.into(), 0),
        (between(1, 2, 0.3), 0),
        (between(1, 2, 1e-9), 0),
        (63.into(), 0),
        (between(63, 64, 0.7), 1),
        (64.into(), 0),
        (between(66, 3, 1.0 / 3.0), 0),
        (between(127, 128, 0.1), 1),
        (129.into(), 0),
        (between(64, 65, 0.9), 0),
        (6.into(), 1),
    ]
}

#[test]
fn scalars_decoded_on_the_gpu_are_drawn_to_the_bit_as_those_decoded_on_the_cpu() {
    let Some(context) = context() else { return };
    assert!(context.has_f64(), "{} has no f64, in which two steps are mixed", context.adapter());
    let of_vertices = [(256, false), (300, true), (2, true), (1024, false)];
    let of_vertices = of_vertices.map(|(entries, own_scales)| Stored::new(entries, own_scales));
    let of_cells = [(256, false, false), (300, true, true)];
    let of_cells = of_cells.map(|(entries, own_scales, cubes)| Stored::of_cells(entries, own_scales, cubes));
    for mut stored in of_vertices.into_iter().chain(of_cells) {
        for draw in DRAWS {
            let mut renderer = renderer(draw, &context);
            for (time, blocks) in times() {
                let job = stored.job(time, draw);
                let name = format!("{}, {draw:?}, {time:?}", stored.name);
                let vertices = job.scalars.values().len() as u64;
                let steps = if time.toward().is_some() { 2 } else { 1 };
                drawn(&mut *renderer, &sent(&job, vec![0.25; job.scalars.values().len()]));
                let on_cpu = drawn(&mut *renderer, &sent(&job, job.scalars.values().iter().copied()));
                assert_eq!((on_cpu.stats.vertices_decoded_on_gpu, on_cpu.stats.bytes_uploaded), (0, 4 * vertices));

                let on_gpu = drawn(&mut *renderer, &job);
                assert_eq!(on_gpu.stats.vertices_decoded_on_gpu, steps * vertices, "{name}");
                assert!(bits(&on_gpu) == bits(&on_cpu), "{name}");
                // A step is 64 bytes as long as its block is there.
                let bytes = on_gpu.stats.bytes_uploaded - 64 * steps;
                let values = job.compressed.as_ref().unwrap().step.block.means().len() as u64;
                assert!(if blocks == 0 { bytes == 0 } else { bytes > blocks * values * 5 }, "{name}: {bytes} more");
                // The same scalars once more are there.
                let again = drawn(&mut *renderer, &job).stats;
                assert_eq!((again.vertices_decoded_on_gpu, again.bytes_uploaded), (0, 0), "{name}");
            }
        }
    }
}

#[test]
fn the_comparison_to_the_bit_notices_another_step_weight_or_rounding() {
    let Some(context) = context() else { return };
    for (mut stored, draw) in [
        (Stored::new(256, false), DRAWS[0]),
        (Stored::new(256, false), DRAWS[1]),
        (Stored::of_cells(256, false, true), DRAWS[0]),
    ] {
        let mut renderer = renderer(draw, &context);
        let [from, to] = [1, 2].map(|step| stored.job(step.into(), draw).scalars.values().to_vec());
        let weight = 0.3;
        let job = stored.job(FrameTime::between(1, 2, weight), draw);
        let CompressedScalars { step, toward, source_cells } = job.compressed.clone().unwrap();
        let (toward, _) = toward.unwrap();
        let right = bits(&drawn(&mut *renderer, &job));
        let compressed = |step: &CompressedStep, toward: Option<(&CompressedStep, f64)>| {
            let toward = toward.map(|(step, weight)| (step.clone(), weight));
            let compressed = Some(CompressedScalars { step: step.clone(), toward, source_cells: source_cells.clone() });
            RenderJob { compressed, ..sent(&job, job.scalars.values().iter().copied()) }
        };
        let third = CompressedStep { step: 3, ..step.clone() };
        // In f32, rounded to the nearest number as in f64 and then once more.
        let in_f32 = from.iter().zip(&to).map(|(a, b)| a * (1.0 - weight as f32) + b * weight as f32);
        let up = job.scalars.values().iter().map(|s| s.next_up());
        let wrong = [
            ("the first step alone", compressed(&step, None)),
            ("the steps exchanged", compressed(&toward, Some((&step, weight)))),
            ("another second step", compressed(&step, Some((&third, weight)))),
            ("a weight off by 1e-6", compressed(&step, Some((&toward, weight + 1e-6)))),
            ("mixed in f32", sent(&job, in_f32)),
            ("a unit in the last place", sent(&job, up)),
        ];
        for (what, wrong) in wrong {
            assert!(bits(&drawn(&mut *renderer, &wrong)) != right, "{draw:?}, {what}");
        }
        let same = compressed(&step, Some((&toward, weight)));
        assert!(bits(&drawn(&mut *renderer, &same)) == right, "{draw:?}");
        // Each cell a part of what its neighbour is a part of; and one cell too few, which is left to the CPU.
        if let Some(cells) = &source_cells {
            let of_parts = cells.of_parts().unwrap();
            let mut found = |cell_source: &[u32]| {
                let mut other = same.clone();
                other.scalars = Scalars::Cells(Arc::new(job.scalars.values().to_vec()));
                other.compressed.iter_mut().for_each(|c| c.source_cells = Some(Arc::new(SourceCells::of(cell_source))));
                let frame = drawn(&mut *renderer, &other);
                (frame.stats.vertices_decoded_on_gpu, bits(&frame) == right)
            };
            let mut exchanged = of_parts.to_vec();
            exchanged.rotate_left(1);
            assert_eq!(found(&exchanged), (2 * exchanged.len() as u64, false));
            assert_eq!(found(of_parts), (2 * of_parts.len() as u64, true));
            assert_eq!(found(&of_parts[1..]), (0, true));
        }
    }
}

#[test]
fn what_the_gpu_cannot_decode_is_sent_decoded() {
    let Some(context) = context() else { return };
    let adapter = context.adapter().name.clone();
    let options = ContextOptions { adapter, ..Default::default() };
    let own = |options: &ContextOptions| Arc::new(Context::new(options).unwrap());
    // Codebooks of 72 x 1024 numbers are 288 KiB; the mesh needs less.
    let small = own(&ContextOptions { binding_bytes: Some(256 << 10), ..options.clone() });
    let without_f64 = own(&ContextOptions { tier: Tier::WebGpu, ..options });
    assert!(!without_f64.has_f64());
    let mut stored = Stored::new(1024, false);
    let (step, mixture) = (FrameTime::from(1), FrameTime::between(63, 64, 0.3));
    for draw in DRAWS {
        for (what, context, time, is_decoded) in [
            ("a step of a block beyond a binding", &small, step, false),
            ("steps of blocks beyond a binding", &small, mixture, false),
            ("a mixture without f64", &without_f64, mixture, false),
            ("a step without f64", &without_f64, step, true),
        ] {
            let job = stored.job(time, draw);
            assert!(job.compressed.is_some(), "{what}");
            let mut renderer = renderer(draw, context);
            let frame = drawn(&mut *renderer, &job);
            assert_eq!(frame.stats.vertices_decoded_on_gpu > 0, is_decoded, "{draw:?}, {what}");
            let on_cpu = drawn(&mut *renderer, &sent(&job, job.scalars.values().iter().copied()));
            assert!(bits(&frame) == bits(&on_cpu), "{draw:?}, {what}");
        }
        // So small a weight has denormal parts.
        let mut job = stored.job(FrameTime::between(1, 2, 0.5), draw);
        job.compressed.iter_mut().flat_map(|c| &mut c.toward).for_each(|(_, weight)| *weight = 1e-300);
        let mut renderer = renderer(draw, &context);
        assert_eq!(drawn(&mut *renderer, &job).stats.vertices_decoded_on_gpu, 0, "{draw:?}");
    }
}

#[test]
fn mixtures_are_compressed_while_both_blocks_are_in_memory_and_for_a_gpu() {
    let mut stored = Stored::new(2, false);
    let (within, across) = (FrameTime::between(1, 2, 0.5), FrameTime::between(63, 64, 0.5));
    for draw in DRAWS {
        for time in [within, across] {
            assert!(stored.job(time, draw).compressed.is_some(), "{draw:?}, {time:?}");
        }
    }
    assert!(stored.job(across, TetDraw::Reference).compressed.is_none());
    // Room for one block: decoded steps are kept, and nothing is read again to be mixed elsewhere.
    let blocks = stored.pipeline.series().blocks().clone();
    let loads = blocks.statistics().loads;
    blocks.set_budget(1);
    assert!(stored.job(across, TetDraw::Raycast).compressed.is_none());
    assert_eq!(blocks.statistics().loads, loads);
    assert!(stored.job(FrameTime::between(65, 66, 0.5), TetDraw::Raycast).compressed.is_some());
}
