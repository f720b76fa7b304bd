//! `tetreel bench`: run time beside error.

use super::progress::Terminal;
use super::scene::{Scene, SceneArgs};
use super::{Outcome, print_result, source};
use crate::bench::{BenchReport, BenchRun, FrameBench, MOTIONS, Machine, Motion, run_frames};
use crate::files;
use crate::task::Progress;
use std::fmt;
use std::path::{Path, PathBuf};

/// Measure frames of one or more series: milliseconds and error together
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel bench jet.zarr --suite all --size 512x512 --json bench.json")]
pub(super) struct Args {
    /// Stores, or sources to import to the cache first
    #[arg(required = true, value_name = "STORE")]
    stores: Vec<PathBuf>,
    /// frame: time of frames; accuracy: error against the reference; all: both
    #[arg(long, value_enum, default_value_t = Suite::Frame)]
    suite: Suite,
    /// Frames measured in each run
    #[arg(long, default_value_t = 15, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Write the record to a JSON file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Suite {
    Frame,
    Accuracy,
    All,
}

impl Suite {
    /// What moves in the runs of the suite, and whether they are judged.
    fn runs(self) -> Vec<(Motion, bool)> {
        match self {
            Self::Frame => MOTIONS.map(|m| (m, false)).to_vec(),
            Self::Accuracy => vec![(Motion { time: true, camera: true }, true)],
            Self::All => MOTIONS.map(|m| (m, m.time && m.camera)).to_vec(),
        }
    }
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    if let Some(path) = &args.json {
        files::check_place(path)?;
    }
    let mut runs = Vec::new();
    let mut machine = Machine::detect();
    for path in &args.stores {
        let store = source::open(path, terminal)?;
        let mut scene = Scene::open(&store, &args.scene)?;
        for (motion, judged) in args.suite.runs() {
            terminal.check_interrupted()?;
            let bench = FrameBench {
                dataset: dataset_name(path),
                request: scene.request(0)?,
                motion,
                frames: args.frames as usize,
                judged,
            };
            terminal.begin("bench", u64::from(args.frames), "frames");
            let measured = run_frames(&mut scene.pipeline, &bench, terminal, &terminal.cancel);
            terminal.end();
            runs.push(measured?);
        }
        machine.adapter = scene.gpu_report().adapter.or(machine.adapter);
    }
    let report = BenchReport { machine, runs };
    if let Some(path) = &args.json {
        let mut text = serde_json::to_vec_pretty(&report)?;
        text.push(b'\n');
        files::replace_with(path, &text)?;
    }
    print_result(false, &report, &Table(&report))?;
    Ok(Outcome::Done)
}

fn dataset_name(path: &Path) -> String {
    path.file_stem().map_or_else(|| path.display().to_string(), |s| s.to_string_lossy().into_owned())
}

/// The report as a table.
struct Table<'a>(&'a BenchReport);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let machine = &self.0.machine;
        writeln!(f, "{}, {} cores", machine.cpu, machine.cores)?;
        if let Some(adapter) = &machine.adapter {
            writeln!(f, "{adapter}")?;
        }
        writeln!(
            f,
            "{:16} {:>10} {:12} {:9} {:>7} {:>9} {:>8} {:>8} {:>8} {:>7} {:>9} {:>9}",
            "dataset", "cells", "moves", "size", "backend", "ms/frame", "p95", "decode", "order", "fps", "rmse", "max"
        )?;
        self.0.runs.iter().try_for_each(|run| row(f, run))
    }
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
        "{:16} {:>10} {:12} {:9} {:>7} {:>9.1} {:>8.1} {:>8.2} {:>8.1} {:>7.1} {:>9} {:>9}",
        run.dataset,
        run.cells,
        moves,
        size,
        run.backend,
        run.ms.p50,
        run.ms.p95,
        run.ms.decode,
        run.ms.order,
        run.fps,
        error(|e| e.rmse),
        error(|e| e.max)
    )
}
