//! `tetreel render`: frames of a series to image files.

use super::progress::Terminal;
use super::scene::{Scene, SceneArgs};
use super::{Outcome, source};
use crate::export::sequence::{FramePattern, FrameWriter};
use crate::export::still::{Background, OutputFrame, StillOptions};
use crate::files;
use crate::ingest::StepRange;
use crate::stats::FrameStats;
use crate::task::Progress;
use anyhow::bail;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Render steps of a series to PNG files
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  tetreel render case.zarr -o frames/frame_%04d.png --tf 'inferno@0:0,0.3:0,1:0.4' --steps 0..99:10"
)]
pub(super) struct Args {
    /// A store, or a source (.pvd, .vtu) to import to the cache first
    #[arg(value_name = "NAME.zarr")]
    store: PathBuf,
    /// Image files; %04d counts the frames from 0
    #[arg(short, long, value_name = "frame_%04d.png")]
    output: FramePattern,
    /// Steps A..B:S, zero-based, both ends included
    #[arg(long, value_name = "A..B:S", default_value = "0..")]
    steps: StepRange,
    /// Only the steps from time T0 to T1, both included
    #[arg(long, value_name = "T0..T1", value_parser = parse_times, allow_hyphen_values = true)]
    times: Option<(f64, f64)>,
    #[command(flatten)]
    scene: SceneArgs,
    /// Colour behind the volume, #rrggbb, black, white or gray (default: transparent)
    #[arg(long, value_name = "COLOR", default_value = "none")]
    background: Background,
    /// Write counts and times of every frame to a JSON file
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

impl Args {
    /// How frames are written.
    fn still_options(&self) -> StillOptions {
        StillOptions { background: self.background, ..Default::default() }
    }
}

/// One entry of `--stats`.
#[derive(Serialize)]
pub(super) struct FrameRecord {
    frame: usize,
    step: usize,
    time: f64,
    file: PathBuf,
    stats: FrameStats,
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let store = source::open(&args.store, terminal)?;
    let steps = select(args, &store.times().values)?;
    if steps.len() > 1 && !args.output.is_numbered() {
        bail!("{} frames need a number in the file name, such as frame_%04d.png", steps.len());
    }
    if let Some(path) = &args.stats {
        files::check_place(path)?;
    }
    let mut scene = Scene::open(&store, &args.scene)?;
    // A damaged step is found before the first frame is written: half a sequence would look like a whole one.
    terminal.begin("check", steps.len() as u64, "steps");
    let checked = scene.pipeline.check_steps(&steps, terminal, &terminal.cancel);
    terminal.end();
    checked?;
    terminal.detail(&format!("camera: {}", scene.camera));
    let records = render_steps(&mut scene, &steps, &args.output, args.still_options(), terminal)?;
    if let Some(path) = &args.stats {
        write_stats(path, &records)?;
    }
    let first = args.output.path(0);
    match records.len() {
        1 => terminal.say(&format!("wrote {}", first.display())),
        n => terminal.say(&format!("wrote {n} frames, {} to {}", first.display(), args.output.path(n - 1).display())),
    }
    Ok(Outcome::Done)
}

/// Renders each step to the next file of the pattern.
pub(super) fn render_steps(
    scene: &mut Scene,
    steps: &[usize],
    output: &FramePattern,
    options: StillOptions,
    terminal: &Terminal,
) -> anyhow::Result<Vec<FrameRecord>> {
    let mut writer = FrameWriter::new(options);
    let mut records = Vec::new();
    terminal.begin("render", steps.len() as u64, "frames");
    let mut render_all = || -> anyhow::Result<()> {
        for (frame_index, &step) in steps.iter().enumerate() {
            terminal.check_interrupted()?;
            let request = scene.request(step)?;
            let attributes = scene.attributes(&request, frame_index);
            let time = attributes.time;
            let frame = scene.pipeline.render_unless(&request, &terminal.cancel)?;
            let file = output.path(frame_index);
            let still = OutputFrame { color: frame.color.clone(), depth: frame.depth.clone(), attributes };
            writer.send(still, file.clone())?;
            records.push(FrameRecord { frame: frame_index, step, time, file, stats: frame.stats.clone() });
            terminal.advance(1);
        }
        Ok(())
    };
    let rendered = render_all();
    // Frames already rendered are written even if a later one fails.
    let written = writer.finish();
    terminal.end();
    rendered?;
    written?;
    Ok(records)
}

/// The steps that `--steps` and `--times` ask for.
fn select(args: &Args, times: &[f64]) -> anyhow::Result<Vec<usize>> {
    let mut steps = args.steps.select(times.len())?;
    if let Some((from, to)) = args.times {
        steps.retain(|&s| (from..=to).contains(&times[s]));
        if steps.is_empty() {
            let (first, last) = (times.first().unwrap_or(&f64::NAN), times.last().unwrap_or(&f64::NAN));
            bail!("no step lies in time {from}..{to}; the series goes from {first} to {last}");
        }
    }
    Ok(steps)
}

fn parse_times(text: &str) -> Result<(f64, f64), String> {
    let number = |part: &str, open: f64| if part.trim().is_empty() { Some(open) } else { part.trim().parse().ok() };
    let ends = text
        .split_once("..")
        .and_then(|(a, b)| Some((number(a, f64::NEG_INFINITY)?, number(b, f64::INFINITY)?)))
        .filter(|(a, b)| a <= b);
    ends.ok_or_else(|| "write T0..T1 with T0 <= T1, as in 0.5..2".to_owned())
}

/// Writes the statistics beside their place and moves them there.
fn write_stats(path: &Path, records: &[impl Serialize]) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(records)?;
    Ok(files::replace_with(path, text.as_bytes())?)
}
