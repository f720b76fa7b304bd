//! Codec `vq` decoded on the GPU: the frame is that of the scalars that the CPU decodes.

use super::*;
use crate::render::{assert_within, difference};
use tetreel::codec::vq::VqOptions;
use tetreel::field::{Component, FieldInfo, SeriesSource, TimeAxis};
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::mesh::RawMesh;
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::render::CompressedStep;
use tetreel::store::Store;
use tetreel::synth::{SeriesName, Synth, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// A generated series with holes, and steps of so different sizes that powers of two matter.
struct Odd {
    series: Synth,
    fields: Vec<FieldInfo>,
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
        self.series.mesh()
    }
    fn read(&self, f: &FieldInfo, c: Component, step: usize, out: &mut Vec<f32>) -> tetreel::error::FileResult<()> {
        self.series.read(f, c, step, out)?;
        for (i, value) in out.iter_mut().enumerate() {
            *value = *value * 10f32.powi(i as i32 % 7 - 3) + 0.3 * (i as f32 * 0.1 + step as f32 * 0.2).sin();
            if i % 97 == 5 {
                *value = f32::NAN;
            }
        }
        Ok(())
    }
}

#[test]
fn steps_decoded_on_the_gpu_are_drawn_as_those_decoded_on_the_cpu() {
    let Some(context) = context() else { return };
    let series = generate(&SynthSpec { cells: 3000, steps: 70, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let fields = vec![series.fields()[0].clone()];
    let odd = Odd { series, fields };
    let temp = tempfile::tempdir().unwrap();
    let mut renderer = GpuRaycast::new(context);
    for (entries, own_scales) in [(256, false), (300, true), (2, true), (1024, false)] {
        let path = temp.path().join(format!("{entries}.zarr"));
        let codec = CodecChoice::new(VqOptions { entries, own_scales, ..Default::default() });
        ingest(&odd, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
        let mut pipeline = Pipeline::open(&Store::open(&path).unwrap(), None).unwrap();
        let table =
            Arc::new(table(&[(-1.0, [1.0, 0.2, 0.1], 0.05), (0.5, [0.1, 1.0, 0.3], 0.4), (2.0, [0.2; 3], 1.0)]));
        let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
        let mut last_block = None;
        for step in [0, 1, 6, 63, 64, 69, 3] {
            let job = pipeline.prepare(&FrameRequest::new(step, camera, table.clone(), (64, 48))).unwrap();
            let name = format!("{entries} entries, step {step}");
            let decoded = renderer.render(job.clone()).unwrap().clone();
            let vertices = job.scalars.values().len() as u64;
            assert_eq!(decoded.stats.vertices_decoded_on_gpu, vertices, "{name}");
            // A step is 32 bytes as long as its block is there.
            let is_there = last_block.replace(step / 64) == Some(step / 64);
            let sent = decoded.stats.bytes_uploaded;
            assert!(if is_there { sent <= 64 } else { sent > vertices * 5 }, "{name}: {sent} bytes");

            // The same scalars once more are there; in another place they are sent.
            assert_eq!(renderer.render(job.clone()).unwrap().stats.vertices_decoded_on_gpu, 0);
            let sent =
                RenderJob { compressed: None, scalars: Arc::new(job.scalars.values().to_vec()).into(), ..job.clone() };
            let sent = renderer.render(sent).unwrap().clone();
            assert_eq!(sent.stats.vertices_decoded_on_gpu, 0);
            assert_within(&name, &decoded.planes.color, &sent.planes.color);
            // A driver may fuse the product and the sum of a vertex: half a unit in the last place.
            let (_, max) = difference(&decoded.planes.color, &sent.planes.color);
            assert!(max < 1e-5, "{name}: {max:e}");
            assert!(sent.planes.color.pixels.iter().any(|p| p[3] > 0.1), "{name}: an empty image proves nothing");

            // The comparison notices the wrong step.
            if let Some(CompressedStep { block, step: 1 }) = job.compressed.clone() {
                let wrong = CompressedStep { block, step: 2 };
                let scalars = Arc::new(job.scalars.values().to_vec());
                let wrong = RenderJob { compressed: Some(wrong), scalars: scalars.into(), ..job };
                assert!(
                    difference(&renderer.render(wrong).unwrap().planes.color, &sent.planes.color).1 > 1e-3,
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn a_block_beyond_a_binding_is_sent_decoded() {
    let Some(context) = context() else { return };
    let temp = tempfile::tempdir().unwrap();
    let series = generate(&SynthSpec { cells: 600, steps: 3, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let codec = CodecChoice::new(VqOptions { entries: 1024, ..Default::default() });
    let path = temp.path().join("jet.zarr");
    ingest(&series, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
    let mut pipeline = Pipeline::open(&Store::open(&path).unwrap(), None).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let table = Arc::new(table(&[(0.0, [1.0, 0.2, 0.1], 0.1), (1.0, [0.1, 1.0, 0.3], 0.4)]));
    let job = pipeline.prepare(&FrameRequest::new(1, camera, table, (32, 32))).unwrap();
    let whole = GpuRaycast::new(context.clone()).render(job.clone()).unwrap().clone();
    // Codebooks of 72 x 1024 numbers are 288 KiB; the mesh needs less.
    let adapter = context.adapter().name.clone();
    let small =
        Context::new(&ContextOptions { adapter, binding_bytes: Some(128 << 10), ..Default::default() }).unwrap();
    let sent = GpuRaycast::new(Arc::new(small)).render(job).unwrap().clone();
    assert_eq!((whole.stats.vertices_decoded_on_gpu > 0, sent.stats.vertices_decoded_on_gpu), (true, 0));
    assert_within("sent", &sent.planes.color, &whole.planes.color);
}
