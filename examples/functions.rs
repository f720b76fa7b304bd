//! Draws a step of a series as cells and as a sum of functions at its vertices (docs/functions.md), beside four times their difference:
//! `cargo run --release --example functions -- STORE.zarr STEP TF OUT.png [SIZE]`. Prints times, and in an image of 96 x 96 pixels how far
//! sheets are from the judge.

use std::{env::args, error::Error, sync::Arc, time::Instant};
use tetreel::camera::Camera;
use tetreel::functions::vertices::VertexFunctions;
use tetreel::image::{PngDepth, RgbaImage, amplified_difference, compare_raw, contact_sheet, write_png};
use tetreel::pipeline::{Backend, FrameRequest, Pipeline};
use tetreel::render::cpu::functions::Sheets;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::functions::{FunctionScene, SheetSpacing, SheetStyle};
use tetreel::render::reference::Reference;
use tetreel::render::{RenderJob, Renderer};
use tetreel::store::Store;
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::Skip;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// A series, its view and transfer function.
struct Scene {
    pipeline: Pipeline,
    request: FrameRequest,
    functions: FunctionScene,
}

impl Scene {
    fn open(store: &str, step: usize, tf: &str) -> Result<Self> {
        let pipeline = Pipeline::open(&Store::open(store)?, None)?;
        let [lo, hi] = pipeline.field().range.ok_or("the field has no finite value")?.map(f64::from);
        let bounds = pipeline.mesh().frame();
        let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
        let range = MappedRange::new(lo, hi, false)?;
        let table = build_node_table(&TransferFunction::parse(tf)?, &range, OpacityKind::Alpha, &lengths)?;
        let usual = Camera::default_for(bounds)?;
        let camera = Camera { position: usual.focal_point + 0.7 * (usual.position - usual.focal_point), ..usual };
        let request = FrameRequest::new(step, camera, Arc::new(table), (1, 1));
        // Functions reach into all cells.
        let skip = Skip { transparent_cells: false, transparent_chunks: false, ..Skip::ALL };
        let started = Instant::now();
        let found = VertexFunctions::default().of(pipeline.mesh())?;
        let (count, widened) = (found.kernels.len(), found.widened);
        println!("{count} functions in {:.0} ms, {widened} widened", started.elapsed().as_secs_f64() * 1e3);
        let functions = FunctionScene::new(Arc::new(found.kernels), SheetStyle::default(), hi - lo);
        Ok(Self { pipeline, request: FrameRequest { backend: Backend::Cpu, skip, ..request }, functions })
    }

    /// A job of cells in an image of this size.
    fn cells(&mut self, side: usize) -> Result<RenderJob> {
        Ok(self.pipeline.prepare(&FrameRequest { size_px: (side, side), ..self.request.clone() })?)
    }

    /// A job of functions.
    fn functions(&mut self, side: usize, spacing: SheetSpacing) -> Result<RenderJob> {
        let functions = FunctionScene { style: SheetStyle { spacing }, ..self.functions.clone() };
        Ok(RenderJob { functions: Some(functions), skip: Skip::ALL, ..self.cells(side)? })
    }
}

fn main() -> Result<()> {
    let words: Vec<String> = args().skip(1).collect();
    let [store, step, tf, out, rest @ ..] = &words[..] else {
        return Err("functions STORE.zarr STEP TF OUT.png [SIZE]".into());
    };
    let side = rest.first().map_or(Ok(256), |side| side.parse())?;
    let mut scene = Scene::open(store, step.parse()?, tf)?;
    let cells = timed("cells", &mut Raycast::new(), scene.cells(side)?)?;
    let usual = SheetStyle::default().spacing;
    let functions = timed("functions", &mut Sheets::new(), scene.functions(side, usual)?)?;
    timed("functions, 128 sheets", &mut Sheets::new(), scene.functions(side, SheetSpacing::Count(128))?)?;
    let difference = amplified_difference(&functions, &cells, [0.0; 3], Some(4.0))?.0;
    write_png(
        out.as_ref(),
        &contact_sheet(&[cells, functions, difference], 3, 4, [0.0; 3]),
        None,
        PngDepth::default(),
    )?;
    let mut judge = Reference::new();
    let judged = judge.render(scene.functions(96, usual)?)?.planes.color.clone();
    for spacing in [1e-5, 1e-4, 1e-3, 1e-2].map(SheetSpacing::Error) {
        let mut sheets = Sheets::new();
        let frame = sheets.render(scene.functions(96, spacing)?)?;
        let error = compare_raw(&frame.planes.color, &judged)?;
        println!("{spacing:?}: RMSE {:.1e}, largest {:.1e} from the judge", error.rmse, error.max);
    }
    Ok(())
}

/// The image of a job, drawn twice: the second time is printed.
fn timed(name: &str, renderer: &mut dyn Renderer, job: RenderJob) -> Result<RgbaImage> {
    renderer.render(job.clone())?;
    let started = Instant::now();
    let frame = renderer.render(job)?;
    println!("{name}: {:.1} ms, {} sheets", started.elapsed().as_secs_f64() * 1e3, frame.stats.sheets);
    Ok(frame.planes.color.clone())
}
