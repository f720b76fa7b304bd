//! `tetreel render`: frames of a series to image files or to a movie.

#[cfg(test)]
mod export_tests;
mod time;
mod upsample;

use super::progress::Terminal;
use super::project::{self, Opened};
use super::scene::{SceneArgs, SizeArgs, gpu_report};
use super::trace::Trace;
use super::{Outcome, source, steps};
use crate::export::annotate::Annotations;
use crate::export::movie::Ffmpeg;
use crate::export::run::{FrameRecord, Naming, RunOptions, Target};
use crate::export::still::Background;
use crate::files;
use crate::image::{ExrColor, ExrCompression};
use crate::import::{self, Format};
use crate::pipeline::{DrawnBy, RenderMode, SampleSet, Upsampling};
use crate::project::{Project, is_project};
use crate::scene::Scene;
use crate::short::Short;
use crate::store::is_store;
use crate::transfer::RangePolicy;
use anyhow::{Context, bail};
use clap::builder::{OsStringValueParser, TypedValueParser};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use time::TimeArgs;
use upsample::UpsampleArgs;

/// Render steps of a series to image files or to a movie
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  tetreel render case.zarr -o frames/frame_%04d.png --tf 'inferno@0:0,0.3:0,1:0.4' --steps 0..99:10
  tetreel render case.zarr -o case.mp4 --duration 10 --interpolate --background white
  tetreel render case.zarr -o around.webm --steps 40 --turntable 360 --duration 4 --fps 30

Movies need ffmpeg on the path, or named in TETREEL_FFMPEG.")]
pub(super) struct Args {
    #[arg(value_name = "NAME.zarr|PROJECT.toml")]
    #[arg(help = format!("A store, a source ({}) to import to the cache first, or a project (docs/projects.md)", Format::extensions()))]
    store: PathBuf,
    /// Image files (.png, .exr; %04d counts the frames from 0) or a movie (.mp4, .mov, .mkv: H.264; .webm: VP9); of a project, the
    /// one that it names if none is given
    #[arg(short, long, value_name = "frame_%04d.png|movie.mp4")]
    #[arg(value_parser = OsStringValueParser::new().try_map(Target::parse))]
    output: Option<Target>,
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    image: SizeArgs,
    /// Rays that are cast: exact (one for each pixel), or adaptive[:CONTRAST] (more where neighbouring ones differ by more than that, 0 to 1;
    /// 0.05 if not said) and the pixels between them filled (docs/sampling.md)
    #[arg(long, value_name = "RAYS", default_value = "exact")]
    rays: SampleSet,
    #[command(flatten)]
    upsample: UpsampleArgs,
    /// Colour behind the volume, #rrggbb, black, white or gray (default: transparent; in movies black)
    #[arg(long, value_name = "COLOR", default_value = "none")]
    background: Background,
    /// Drawn over the frames: time, legend, title or title=TEXT, separated by commas, or none
    #[arg(long, value_name = "PARTS")]
    annotate: Option<Annotations>,
    /// Bits per channel: 8 or 16 of PNG files (default: 8), 16 or 32 of colours in EXR files (default: 32)
    #[arg(long, value_name = "BITS")]
    bit_depth: Option<String>,
    /// Colours of EXR files: linear, or raw for display-referred values as they were accumulated (default: linear)
    #[arg(long, value_name = "COLORS")]
    exr: Option<ExrColor>,
    /// Compression of EXR files, always without loss: zip, piz, rle or none (default: zip)
    #[arg(long, value_name = "COMPRESSION")]
    exr_compression: Option<ExrCompression>,
    /// Keep images that are there already if the same request made them, and render the others
    #[arg(long)]
    resume: bool,
    /// Write counts and times of every frame to a JSON file
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Write when each stage worked on which frame to a JSON file for chrome://tracing or ui.perfetto.dev
    #[arg(long, value_name = "FILE.json")]
    trace: Option<PathBuf>,
    /// The project, which supplies options not given here.
    #[arg(skip)]
    project: Option<PathBuf>,
}

impl Args {
    /// The output files.
    fn target(&self) -> anyhow::Result<&Target> {
        self.output.as_ref().context("where to? Give -o frame_%04d.png, or -o movie.mp4")
    }

    /// Options of the run.
    fn run_options(&self) -> anyhow::Result<RunOptions> {
        Ok(RunOptions {
            target: self.target()?.clone(),
            times: self.time.times(),
            size_px: (self.image.size.0, self.image.size.1),
            background: self.background,
            annotations: self.annotate.clone(),
            bit_depth: self.bit_depth.clone(),
            exr: self.exr,
            exr_compression: self.exr_compression,
            resume: self.resume,
            replaces: true,
        })
    }

    /// The smaller image that is rendered and enlarged to each frame, if any.
    fn upsampling(&self, project: Option<&Project>) -> anyhow::Result<Option<Upsampling>> {
        let draw = self.scene.draw();
        let upsampling = self.upsample.upsampling(draw.lod() < 1.0 || leaves_faces_out(project))?;
        if upsampling.is_some() && draw.drawn_by().is_reference() {
            bail!(
                "the reference is judged as it is, and --image-scale or --upsample would change its image; leave them out, or choose another --mode"
            );
        }
        if upsampling.is_some() && self.rays.contrast().is_some() {
            bail!("--rays adaptive is about rays of the whole image; leave --image-scale out, or choose --rays exact");
        }
        Ok(upsampling)
    }

    /// Refuses options that need all rays.
    fn check_rays(&self, project: Option<&Project>) -> anyhow::Result<()> {
        let SceneArgs { surfaces, .. } = &self.scene;
        if self.rays.contrast().is_none() {
            return Ok(());
        }
        if leaves_faces_out(project) {
            bail!(
                "--rays adaptive is about rays from cell to cell, and [[timeline.lod]] of the project leaves faces out; take these keys out, or choose --rays exact"
            );
        }
        match self.scene.draw().drawn_by() {
            DrawnBy::Raycast => {}
            by => bail!(
                "--rays adaptive is about rays from cell to cell, and {} draws otherwise; choose --mode raycast, all faces, or --rays exact",
                by.name()
            ),
        }
        if surfaces.needs_whole_image() {
            bail!(
                "--shade screen, --shade depth and --ao need the rays of all pixels; leave them out, or choose --rays exact"
            );
        }
        Ok(())
    }

    /// Files written beside the frames.
    fn side_files(&self) -> Vec<(&'static str, &Path)> {
        let files = [("--stats", &self.stats), ("--trace", &self.trace)];
        files.into_iter().filter_map(|(option, path)| Some((option, path.as_deref()?))).collect()
    }

    /// Files and folders that are read.
    fn inputs(&self) -> Vec<PathBuf> {
        // `FILE` or `FILE@POSITION:OPACITY,...`
        let mut inputs = vec![self.store.clone(), PathBuf::from(&self.scene.tf)];
        let tf = self.scene.tf.as_encoded_bytes();
        let map = tf.iter().rposition(|&byte| byte == b'@').and_then(|at| files::os_string(tf[..at].to_vec()));
        inputs.extend(map.map(PathBuf::from));
        inputs.extend(self.project.clone());
        if !is_store(&self.store) {
            // Problems of a source are reported when it is opened.
            inputs.extend(import::files(&self.store).unwrap_or_default());
        }
        // Most transfer functions are not files.
        inputs.retain(|input| input.exists());
        inputs
    }

    /// Refuses impossible options, before the store is opened or anything is imported. Returns the ffmpeg of a movie.
    fn check(&self, project: Option<&Project>) -> anyhow::Result<Option<Ffmpeg>> {
        let options = self.run_options()?;
        self.time.check(self.scene.has_flow())?;
        self.scene.check_adapter()?;
        self.check_rays(project)?;
        self.upsampling(project)?;
        options.check()?;
        options.check_place()?;
        for (option, path) in self.side_files() {
            files::check_place(path)?;
            if self.inputs().iter().any(|input| is_within(path, input)) {
                bail!(
                    "{option} {} is the project, or a part of the series or of the transfer function; choose another name",
                    path.display()
                );
            }
        }
        if let [(_, stats), (_, trace)] = &self.side_files()[..]
            && same_place(stats, trace)
        {
            bail!("--stats and --trace name the same file; choose another name for one of them");
        }
        Ok(options.ffmpeg()?)
    }
}

/// Whether the timeline of a project leaves faces out.
fn leaves_faces_out(project: Option<&Project>) -> bool {
    project.is_some_and(|project| project.timeline.lod.keys().iter().any(|key| key.value < 1.0))
}

/// A path without symbolic links; for a missing file, its folder's with its name.
fn real(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok().or_else(|| Some(files::parent_of(path).canonicalize().ok()?.join(path.file_name()?)))
}

/// Whether two paths name the same file.
fn same_place(path: &Path, other: &Path) -> bool {
    real(path).is_some_and(|path| real(other) == Some(path))
}

/// Whether a path names a file or something in it.
fn is_within(path: &Path, other: &Path) -> bool {
    matches!((real(path), real(other)), (Some(path), Some(other)) if path.starts_with(&other))
}

/// Runs the command; `words` are the whole command line, which overrides a project.
pub(super) fn run(args: &Args, words: &[OsString], terminal: &Terminal) -> anyhow::Result<Outcome> {
    if is_project(&args.store) {
        let Opened { project, source, mut args } = project::open::<Args>(&args.store, words, project::Taker::Render)?;
        args.project = Some(std::mem::replace(&mut args.store, source));
        return render(&args, Some(&project), terminal);
    }
    render(args, None, terminal)
}

fn render(args: &Args, project: Option<&Arc<Project>>, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let ffmpeg = args.check(project.map(|project| &**project))?;
    let output = args.target()?;
    let mut options = args.run_options()?;
    let trace = args.trace.as_deref().map(Trace::begin).transpose()?;
    let store = source::open(&args.store, terminal)?;
    options.times.steps = steps::within_series(options.times.steps, store.times().len(), terminal);
    if let Ok(selected) = options.times.steps.select(store.times().len()) {
        args.time.check_held(selected.len())?;
    }
    let plan = options.plan(store.times())?;
    for (option, path) in args.side_files() {
        if (0..plan.frames.len()).any(|frame| same_place(path, &output.path(frame))) {
            bail!("{option} {} is the place of a frame; choose another name", path.display());
        }
    }
    options.check_memory(plan.frames.len())?;
    let in_file = |error| project::in_file(error, args.project.as_deref());
    let mut scene = args.scene.open(&store, args.image.size, project, &terminal.cancel).map_err(in_file)?;
    (scene.samples, scene.upsampling) = (args.rays.clone(), args.upsampling(project.map(|project| &**project))?);
    terminal.detail(&format!("camera: {}", scene.look.camera));
    if project.is_none() {
        say_look(args, &scene, terminal)?;
    }
    if scene.look.draws_eq20() {
        terminal.say(
            "--normalise eq20 draws values that are not in the data where functions are thin; leave it out for their weighted mean",
        );
    }
    if ffmpeg.is_some() && args.background == Background::Transparent {
        terminal.say("the movie is over black; --background COLOR gives it another colour");
    }
    let (dataset, made_by) = (source::name_of(&args.store), made_by(args, &scene));
    let run = options.run(plan, ffmpeg, &scene, &Naming { dataset: &dataset, made_by: &made_by })?;
    let records = run.render(&mut scene, terminal).map_err(|error| in_file(error.into()))?;
    report_backend(&scene, &records, terminal);
    if let Some(path) = &args.stats {
        files::replace_with(path, serde_json::to_string_pretty(&records)?.as_bytes())?;
    }
    trace.map(Trace::end).transpose()?;
    terminal.say(&run.output.summary(&records));
    Ok(Outcome::Done)
}

/// Reports the automatic look, even without `--verbose` if colours do not cover all values.
fn say_look(args: &Args, scene: &Scene, terminal: &Terminal) -> anyhow::Result<()> {
    let range = scene.look.range;
    terminal.detail(&format!("--tf {} --range {range}", scene.transfer_function()));
    if args.scene.range.is_none()
        && let RangePolicy::Manual(lo, hi) = scene.pipeline.series().settled(&range)?
    {
        let all = if matches!(range, RangePolicy::Percentile(..)) { "series" } else { "symmetric" };
        // Percentiles are stored f32 values.
        let (lo, hi) = (Short(lo as f32), Short(hi as f32));
        terminal.say(&format!("colours cover the 1st to 99th percentile, {lo} to {hi}; all values with --range {all}"));
    }
    Ok(())
}

/// How the frames are made, for the metadata of a movie.
fn made_by(args: &Args, scene: &Scene) -> String {
    let (tf, range) = (scene.transfer_function(), scene.look.range);
    match args.project.as_deref() {
        Some(project) => format!("{}: {tf}", source::name_of(project)),
        None => format!("--tf {tf} --range {range} --camera {}", scene.look.camera),
    }
}

/// Reports the device that rendered, even without `--verbose` if it is unexpected.
fn report_backend(scene: &Scene, records: &[FrameRecord], terminal: &Terminal) {
    let rendered = || records.iter().filter_map(|record| record.stats.as_ref());
    let on_gpu = rendered().filter(|stats| stats.on_gpu).count();
    let gpu = gpu_report(&scene.pipeline);
    let on_cpu = rendered().count() - on_gpu;
    if let Some(adapter) = gpu.adapter.filter(|_| on_gpu > 0) {
        terminal.detail(&format!("{on_gpu} frames on {adapter}"));
    }
    if on_cpu > 0 {
        terminal.detail(&format!("{on_cpu} frames on the CPU"));
    }
    if let Some(problem) = gpu.problem {
        terminal.say(&format!("{on_cpu} frames on the CPU: {problem}"));
    }
    if scene.look.mode == RenderMode::Reference {
        let by_table = rendered().filter(|stats| !stats.by_formula).count();
        if by_table > 0 {
            terminal.say(&format!(
                "{by_table} frames were rendered from the table of the ensemble, not by its formula: a member on gradients or coefficients of variation has none over the scalar"
            ));
        }
    }
    let restarts: u64 = rendered().map(|stats| stats.gpu_restarts).sum();
    if restarts > 0 {
        terminal.say(&format!("the GPU was lost {restarts} times; those frames were begun again"));
    }
}
