//! `tetreel bench`: run time beside error.

mod accuracy;

use super::progress::Terminal;
use super::scene::{SceneArgs, SizeArgs, gpu_report};
use super::{Outcome, print_result, source};
use crate::bench::accuracy::{AccuracyTable, EqualTimeTable, IntegrationTable, TABLE_SIZES, integration_errors};
use crate::bench::{
    BenchReport, BenchRun, FrameBench, HeldBench, HeldRun, MOTIONS, Machine, Motion, PlaybackBench, PlaybackRun,
    SeekTimes, points_progress, run_frames, run_held, run_playback, run_points, run_still,
};
use crate::files;
use crate::task::Progress;
use crate::ui::{DEFAULT_TARGET_FPS, TARGET_FPS};
use std::fmt;
use std::path::{Path, PathBuf};

/// Measure frames of one or more series: milliseconds and error together
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel bench jet.zarr --size 512x512 --json bench.json\n  \
    tetreel bench jet.zarr jet-vq.zarr --suite accuracy --size 320x240 --frames 5 --plot plots")]
pub(super) struct Args {
    /// Stores, or sources to import to the cache first
    #[arg(required = true, value_name = "STORE")]
    stores: Vec<PathBuf>,
    /// frame: time of frames; accuracy: time and error of every way to render against the reference, on the same scenes, what error a
    /// time buys, and the error of one segment by optics and size of the table (docs/accuracy.md); playback: what moving time costs, and
    /// seeks; motion: how well a frame rate is held while camera and time move, and with what error, and
    /// how far details of earlier steps are off while the camera stands still; points: time and error of cells as points, beside
    /// faces and the ray caster, and what each source of error alone makes; all: all of them
    #[arg(long, value_enum, default_value_t = Suite::Frame)]
    suite: Suite,
    /// Frames measured in each run (accuracy: of each path and scene); of playback pairs of 30 frames, and seeks;
    /// of motion a tenth of the frames
    #[arg(long, default_value_t = 15, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Frames per second to be held by the motion suite
    #[arg(long, default_value_t = DEFAULT_TARGET_FPS, value_name = "FPS", value_parser = target_fps)]
    fps: f64,
    /// Write the record to a JSON file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write plots of the accuracy suite to a folder, as SVG: error against time, compression, k, level of detail, size of the
    /// table and of the image
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    image: SizeArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Suite {
    Frame,
    Accuracy,
    Playback,
    Motion,
    Points,
    All,
}

impl Suite {
    /// Motions of the suite's runs, and whether errors are measured.
    fn runs(self) -> Vec<(Motion, bool)> {
        match self {
            Self::Frame => MOTIONS.map(|m| (m, false)).to_vec(),
            Self::All => MOTIONS.map(|m| (m, m.time && m.camera)).to_vec(),
            Self::Playback | Self::Motion | Self::Points | Self::Accuracy => Vec::new(),
        }
    }

    /// Whether it is this suite, or all of them.
    fn has(self, suite: Self) -> bool {
        self == suite || self == Self::All
    }
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    if let Some(path) = &args.json {
        files::check_place(path)?;
    }
    accuracy::check(args)?;
    let (machine, playback, held, still, points) = (Machine::detect(), vec![], vec![], vec![], vec![]);
    let mut report = BenchReport { machine, runs: vec![], playback, held, still, points, integration: vec![] };
    if args.suite != Suite::Accuracy {
        args.scene.check_adapter()?;
        for path in &args.stores {
            run_moving(path, args, terminal, &mut report)?;
        }
    }
    if args.suite.has(Suite::Accuracy) {
        let (runs, adapter) = accuracy::run(args, terminal)?;
        report.runs.extend(runs);
        report.machine.adapter = adapter.or(report.machine.adapter);
        report.integration = integration_errors(&TABLE_SIZES, INTEGRATION_SEGMENTS)?;
    }
    if let Some(path) = &args.json {
        let mut text = serde_json::to_vec_pretty(&report)?;
        text.push(b'\n');
        files::replace_with(path, &text)?;
    }
    accuracy::plot(args.plot.as_ref(), &report.runs, terminal)?;
    print_result(false, &report, &Table(&report))?;
    Ok(Outcome::Done)
}

/// The frame, playback and motion suites on one series.
fn run_moving(path: &Path, args: &Args, terminal: &Terminal, report: &mut BenchReport) -> anyhow::Result<()> {
    let store = source::open(path, terminal)?;
    args.image.size.check_memory(1)?;
    let mut scene = args.scene.open(&store, args.image.size, None, &terminal.cancel)?;
    let (dataset, request, pipeline) = (source::name_of(path), scene.request(0)?, &mut scene.pipeline);
    let frames = args.frames as usize;
    for (motion, judged) in args.suite.runs() {
        terminal.check_interrupted()?;
        let (dataset, request) = (dataset.clone(), request.clone());
        let bench = FrameBench { dataset, request, motion, frames, judged };
        terminal.begin("bench", frames as u64, "frames");
        report.runs.push(run_frames(pipeline, &bench, terminal, &terminal.cancel)?);
        terminal.end();
    }
    if args.suite.has(Suite::Playback) {
        let bench = PlaybackBench { dataset: dataset.clone(), request: request.clone(), pairs: frames };
        let series = pipeline.series().clone();
        let open = || args.scene.new_pipeline(&series);
        terminal.begin("bench", 2 * frames as u64, "pairs and seeks");
        report.playback.push(run_playback(&open, &bench, terminal, &terminal.cancel)?);
        terminal.end();
    }
    if args.suite.has(Suite::Motion) {
        let (frames, target_ms) = (10 * frames, 1e3 / args.fps);
        let bench = HeldBench { dataset: dataset.clone(), request: request.clone(), frames, target_ms };
        terminal.begin("bench", frames as u64, "frames");
        report.held.push(run_held(pipeline, &bench, terminal, &terminal.cancel)?);
        terminal.end();
        report.still.extend(run_still(pipeline, &dataset, &request, terminal, &terminal.cancel)?);
    }
    if args.suite.has(Suite::Points) {
        terminal.begin("bench", points_progress(frames), "ways and rounds");
        let run = run_points(pipeline, &dataset, &request, frames, terminal, &terminal.cancel)?;
        report.points.push(run);
        terminal.end();
    }
    report.machine.adapter = gpu_report(&scene.pipeline).adapter.or(report.machine.adapter.take());
    Ok(())
}

/// Parses a frame rate that the player accepts.
fn target_fps(text: &str) -> Result<f64, String> {
    let fps = text.parse().ok().filter(|fps| TARGET_FPS.contains(fps));
    fps.ok_or_else(|| {
        format!("'{text}' is no rate; give {} to {} frames per second", TARGET_FPS.start(), TARGET_FPS.end())
    })
}

/// Number of segments for each length, method and transfer function.
const INTEGRATION_SEGMENTS: usize = 500;

/// The report as a table.
struct Table<'a>(&'a BenchReport);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let machine = &self.0.machine;
        writeln!(f, "{}, {} cores", machine.cpu, machine.cores)?;
        if let Some(adapter) = &machine.adapter {
            writeln!(f, "{adapter}")?;
        }
        let moving: Vec<&BenchRun> = self.0.runs.iter().filter(|run| run.scene.is_none()).collect();
        if !moving.is_empty() {
            heading(f)?;
        }
        moving.iter().try_for_each(|run| row(f, run))?;
        self.0.playback.iter().try_for_each(|run| playback_rows(f, run))?;
        self.0.held.iter().try_for_each(|run| held_rows(f, run))?;
        self.0.still.iter().try_for_each(|run| run.fmt(f))?;
        self.0.points.iter().try_for_each(|run| run.fmt(f))?;
        AccuracyTable(&self.0.runs).fmt(f)?;
        EqualTimeTable(&self.0.runs).fmt(f)?;
        IntegrationTable(&self.0.integration).fmt(f)
    }
}

fn heading(f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(
        f,
        "{:16} {:>10} {:12} {:9} {:>7} {:>9} {:>8} {:>8} {:>8} {:>8} {:>7} {:>9} {:>9}",
        "dataset",
        "cells",
        "moves",
        "size",
        "backend",
        "ms/frame",
        "p95",
        "decode",
        "order",
        "place",
        "fps",
        "rmse",
        "max"
    )
}

/// Rows of the playback suite: moving time against time moving half as often, and seeks.
fn playback_rows(f: &mut fmt::Formatter<'_>, run: &PlaybackRun) -> fmt::Result {
    let [width, height] = run.size;
    writeln!(f, "{}, {} cells, {width}x{height}, {}, codec {}", run.dataset, run.cells, run.backend, run.codec)?;
    for (name, p) in [("pipelined", &run.pipelined), ("one stage after the other", &run.sequential)] {
        let (ratio, [lo, hi]) = (p.ratio, p.interval);
        let times = format!("{:.1} ms for {} frames, {:.1} with each step twice", p.b.median, run.frames, p.a.median);
        writeln!(f, "  time moves, {name}: {ratio:.3} (95 % in {lo:.3} to {hi:.3}, {} pairs); {times}", p.pairs)?;
    }
    let SeekTimes { ms, ratio, beyond_ms } = &run.seek;
    let quartiles = format!("quartiles {:.3} to {:.3}; {:.2} ms more", ratio.q1, ratio.q3, beyond_ms.median);
    writeln!(f, "  seeks: {:.1} ms, {:.3} of all its stages ({quartiles})", ms.median, ratio.median)
}

/// Rows of the motion suite: how the rate was held, and the qualities chosen.
fn held_rows(f: &mut fmt::Formatter<'_>, run: &HeldRun) -> fmt::Result {
    let ([width, height], HeldRun { target_ms, exact_ms, ms, .. }) = (run.size, run);
    writeln!(f, "{}, {} cells, {width}x{height}, {}, {target_ms:.1} ms a frame", run.dataset, run.cells, run.backend)?;
    let within = 100.0 * run.within;
    writeln!(
        f,
        "  in full {exact_ms:.1} ms; in motion {:.1} (at most {:.1}), {within:.0} % in time",
        ms.median, ms.max
    )?;
    let best = run.over_best.map_or("none to compare with".to_owned(), |of| {
        format!("{:.2} of the least that is in time (quartiles {:.2} to {:.2})", of.median, of.q1, of.q3)
    });
    writeln!(f, "  RMSE {:.1e} (at most {:.1e}), {best}", run.rmse.median, run.rmse.max)?;
    let chosen: Vec<String> = run.chosen.iter().map(|(name, count)| format!("{name} ({count})")).collect();
    writeln!(f, "  {}", chosen.join(", "))
}

fn row(f: &mut fmt::Formatter<'_>, run: &BenchRun) -> fmt::Result {
    let moves = match (run.time_moves, run.camera_moves) {
        (true, true) => "time+camera",
        (true, false) => "time",
        (false, true) => "camera",
        (false, false) => "nothing",
    };
    let size = format!("{}x{}", run.size[0], run.size[1]);
    let error = |of: fn(&crate::bench::RunError) -> f64| {
        run.error.as_ref().map_or("-".to_owned(), |e| format!("{:.1e}", of(e)))
    };
    writeln!(
        f,
        "{:16} {:>10} {:12} {:9} {:>7} {:>9.1} {:>8.1} {:>8.2} {:>8.1} {:>8.1} {:>7.1} {:>9} {:>9}",
        run.dataset,
        run.cells,
        moves,
        size,
        run.backend,
        run.ms.p50,
        run.ms.p95,
        run.ms.decode,
        run.ms.order,
        run.ms.place,
        run.fps,
        error(|e| e.rmse),
        error(|e| e.max)
    )
}
