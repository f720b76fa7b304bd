//! The accuracy suite on the command line: opens all series, finds the truth of each, and measures them.

use super::super::progress::Terminal;
use super::super::scene::gpu_report;
use super::super::source;
use super::{Args, Suite};
use crate::bench::accuracy::{
    AccuracyBench, CODEC_PATHS, Judged, TRANSFER_FUNCTIONS, function_paths, judge, judge_runs, on_backends, paths,
    run_accuracy, scenes,
};
use crate::bench::plot::{check_folder, write_plots};
use crate::bench::{BenchRun, JUDGE_RAW, JUDGE_REFERENCE};
use crate::codec::{raw, vq};
use crate::look::{DEFAULT_TF, Look, mapped_range};
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, FaceDetail, RenderMode, Representation};
use crate::render::functions::SheetStyle;
use crate::scene::Scene;
use crate::store::Store;
use crate::task::Progress;
use crate::transfer::TransferFunction;
use crate::visibility::Skip;
use anyhow::{Context, bail};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An opened series.
struct Opened {
    name: String,
    scene: Scene,
    /// Bytes of the values as f32 over those in the store.
    ratio: Option<f64>,
    backends: Vec<Backend>,
}

/// Refuses impossible options before anything is measured.
pub(super) fn check(args: &Args) -> anyhow::Result<()> {
    if let Some(folder) = &args.plot {
        if !args.suite.has(Suite::Accuracy) {
            bail!("--plot shows the accuracy suite; add --suite accuracy or --suite all");
        }
        check_folder(folder)?;
    }
    let scene = &args.scene;
    let is_of_functions = representation(args) == Representation::Vertices;
    let is_usual = (scene.mode() == RenderMode::Auto || is_of_functions && scene.mode() == RenderMode::Sheets)
        && scene.faces.detail() == FaceDetail::default()
        && scene.optics == OpticsKind::Exact
        && scene.sheets.style() == SheetStyle::default()
        && scene.skip == Skip::default();
    if args.suite == Suite::Accuracy && !is_usual {
        bail!(
            "--suite accuracy goes through all of --mode, --lod, --k, --inexact-order, --optics, --sheets and --sampling-error; leave them, --sampling and --skip out (it measures cells, or with --representation vertices functions)"
        );
    }
    Ok(())
}

/// What the suite measures.
fn representation(args: &Args) -> Representation {
    args.scene.representation().unwrap_or_default()
}

/// Measures all paths on all series; returns the runs, and the GPU if one was used.
pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<(Vec<BenchRun>, Option<String>)> {
    let opened = args.stores.iter().map(|path| open(path, args, terminal));
    let mut all = opened.collect::<anyhow::Result<Vec<Opened>>>()?;
    let truths: Vec<usize> = (0..all.len()).map(|at| truth_of(&all, at)).collect();
    let mut judged: Vec<Option<Judged>> = all.iter().map(|_| None).collect();
    let (mut runs, mut adapter) = (Vec::new(), None);
    for (at, &truth) in truths.iter().enumerate() {
        if judged[truth].is_none() {
            judged[truth] = Some(judge_all(&mut all[truth], args, terminal)?);
        }
        let Some(judged) = &judged[truth] else { continue };
        let is_own = truth == at;
        if is_own && all[at].scene.pipeline.field().codec == vq::NAME {
            terminal.say(&format!(
                "{}: the series that it was compressed from is not among the stores; errors are those of its own values",
                all[at].name
            ));
        }
        runs.extend(measure(&mut all[at], judged, is_own, args, terminal)?);
        adapter = gpu_report(&all[at].scene.pipeline).adapter.or(adapter);
    }
    Ok((runs, adapter))
}

/// Writes the plots if a folder is given, and reports which had no data.
pub(super) fn plot(folder: Option<&PathBuf>, runs: &[BenchRun], terminal: &Terminal) -> anyhow::Result<()> {
    let Some(folder) = folder else { return Ok(()) };
    let report = write_plots(folder, runs)?;
    for path in &report.written {
        terminal.detail(&format!("wrote {}", path.display()));
    }
    for (file, needs) in &report.empty {
        terminal.say(&format!("{file} was not written: there is nothing in it without {needs}"));
    }
    Ok(())
}

fn open(path: &Path, args: &Args, terminal: &Terminal) -> anyhow::Result<Opened> {
    let store = source::open(path, terminal)?;
    args.image.size.check_memory(1)?;
    let mut scene = args.scene.open(&store, args.image.size, None, &terminal.cancel)?;
    let backends = match args.scene.backend {
        // A GPU in software counts: it shows how accurate GPUs are, if not how fast.
        Backend::Auto if scene.pipeline.check_backend(Backend::Gpu).is_ok() => vec![Backend::Cpu, Backend::Gpu],
        Backend::Auto => vec![Backend::Cpu],
        one => vec![one],
    };
    let is_unique = args.stores.iter().filter(|other| source::name_of(other) == source::name_of(path)).count() == 1;
    let name = if is_unique { source::name_of(path) } else { path.display().to_string() };
    Ok(Opened { name, ratio: ratio_of(&store, &scene)?, scene, backends })
}

fn ratio_of(store: &Store, scene: &Scene) -> anyhow::Result<Option<f64>> {
    let values = scene.pipeline.mesh().positions.local.len() * scene.pipeline.times().len();
    let bytes = store.value_bytes(scene.pipeline.field())?;
    Ok((bytes > 0).then(|| (values * size_of::<f32>()) as f64 / bytes as f64))
}

/// The series whose values are the truth for one: its uncompressed source, if among them, else itself.
fn truth_of(all: &[Opened], at: usize) -> usize {
    let series = |at: usize| &all[at].scene.pipeline;
    let of_values = |at: usize| (&series(at).field().name, series(at).times());
    let is_source = |other: &usize| {
        let (this, other) = (series(at).mesh(), series(*other).mesh());
        this.topology.tets == other.topology.tets && this.positions.local == other.positions.local
    };
    if series(at).field().codec != vq::NAME {
        return at;
    }
    let raw_ones = (0..all.len()).filter(|&other| series(other).field().codec == raw::NAME);
    raw_ones.filter(|&other| of_values(other) == of_values(at)).find(is_source).unwrap_or(at)
}

/// Renders the scenes of a series with the reference.
fn judge_all(opened: &mut Opened, args: &Args, terminal: &Terminal) -> anyhow::Result<Judged> {
    let scene = &mut opened.scene;
    let (look, series, steps) = (&scene.look, scene.pipeline.series(), scene.pipeline.times().len());
    let is_given = args.scene.tf != DEFAULT_TF;
    let table = |name: &str, step: usize| -> anyhow::Result<_> {
        // A path in the text may not be Unicode.
        let text = if is_given { args.scene.tf.as_os_str() } else { OsStr::new(name) };
        let tf = TransferFunction::parse(text).with_context(|| format!("--tf '{}'", text.display()))?;
        let range = mapped_range(series, &look.range, step.into())
            .map_err(|e| anyhow::anyhow!("field {}: {e}", series.field().name))?;
        let look = Look { tf, ..look.clone() };
        Ok((Arc::new(look.table(&range)?), Arc::new(look.source(&range))))
    };
    let text = args.scene.tf.to_string_lossy();
    let given = [("given", &*text)];
    let functions = if is_given { &given[..] } else { &TRANSFER_FUNCTIONS[..] };
    let size = (args.image.size.0, args.image.size.1);
    let scenes = scenes(&opened.name, steps, &look.camera, size, functions, table)?;
    terminal.begin("judge", scenes.len() as u64, "scenes");
    let judged = judge(&mut scene.pipeline, scenes, representation(args), terminal, &terminal.cancel)?;
    terminal.end();
    Ok(judged)
}

fn measure(
    opened: &mut Opened,
    judged: &Judged,
    is_own: bool,
    args: &Args,
    terminal: &Terminal,
) -> anyhow::Result<Vec<BenchRun>> {
    let paths = match judged.representation {
        Representation::Vertices => function_paths(),
        Representation::Cells if is_own => paths(&opened.backends),
        Representation::Cells => on_backends(&CODEC_PATHS, &opened.backends),
    };
    let bench = AccuracyBench {
        dataset: &opened.name,
        judged,
        judge: if is_own { JUDGE_REFERENCE } else { JUDGE_RAW },
        paths: &paths,
        frames: args.frames as usize,
        ratio: opened.ratio,
    };
    terminal.begin("bench", (paths.len() * judged.scenes.len()) as u64, "paths and scenes");
    let measured = run_accuracy(&mut opened.scene.pipeline, &bench, terminal, &terminal.cancel)?;
    terminal.end();
    measured.refused.iter().for_each(|why| terminal.say(&format!("{}: not measured: {why}", opened.name)));
    let of_judge = if is_own { judge_runs(&opened.scene.pipeline, &bench) } else { Vec::new() };
    Ok([of_judge, measured.runs].concat())
}
