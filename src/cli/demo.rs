//! `tetreel demo`: generates a series and shows it.

use super::Outcome;
#[cfg(feature = "gui")]
use super::play::{self, Playing};
use super::progress::Terminal;
use super::scene::{SceneArgs, SizePx};
use crate::export::run::{Output, Plan, Run};
use crate::export::sequence::FramePattern;
use crate::export::still::{Background, StillOptions};
use crate::image::{self, PngDepth};
use crate::ingest::{IngestOptions, ingest};
use crate::store::Store;
use crate::synth::{SeriesName, SynthSpec, generate};
#[cfg(feature = "gui")]
use crate::ui::window::{Start, WindowError};
use anyhow::Context;
use clap::{Args as _, FromArgMatches};
use std::io::Write;
use std::path::PathBuf;

/// Generate a series and play it; without a display, render it to pictures
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel demo --out demo")]
pub(super) struct Args {
    /// Folder for the series, its frames and the contact sheet
    #[arg(long, default_value = "demo", value_name = "DIR")]
    out: PathBuf,
    /// About how many tets
    #[arg(long, default_value_t = 400_000, value_name = "N")]
    cells: u64,
    /// Render frames and a contact sheet even if there is a display
    #[cfg(feature = "gui")]
    #[arg(long)]
    no_window: bool,
}

/// Steps generated; the contact sheet shows every other one, from the second on (the jet is empty at first).
const STEPS: usize = 24;
/// Columns and rows of the contact sheet: half of the steps.
const SHEET: (usize, usize) = (3, STEPS / 2 / 3);
const SIZE: SizePx = SizePx(640, 420);
/// Nearer than the default, which leaves room to turn the box.
const CAMERA: &str = "angle=20";
const BACKGROUND_COLOR: [f32; 3] = [0.086, 0.094, 0.114];
const BACKGROUND: Background = Background::Color(BACKGROUND_COLOR);

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let series = generate(&SynthSpec { cells: args.cells, steps: STEPS, ..SynthSpec::new(SeriesName::Jet) })?;
    let dir = &args.out;
    std::fs::create_dir_all(dir).with_context(|| format!("{}: cannot make the folder", dir.display()))?;
    let store_path = dir.join("demo_jet.zarr");
    let options = IngestOptions { overwrite: true, ..Default::default() };
    let report = ingest(&series, &store_path, &options, terminal, &terminal.cancel)?;
    terminal.say(&report.to_string());

    let options = SceneArgs::augment_args(clap::Command::new("demo"));
    let matches = options.try_get_matches_from(["demo", "--camera", CAMERA])?;
    let scene_args = SceneArgs::from_arg_matches(&matches)?;
    let store = Store::open(&store_path)?;
    #[cfg(feature = "gui")]
    if play::has_display() && !args.no_window {
        let path = store_path.display();
        terminal
            .say(&format!("playing {path} (again: tetreel play {path}); with --no-window there are pictures instead"));
        let background = Some(BACKGROUND_COLOR);
        let playing = Playing { background, follows: false, beside: None, size: None, plays: true, project: None };
        let start = Start::Play(Box::new(play::open_store(&store_path, &scene_args)?));
        match play::show(start, &scene_args, &playing, terminal) {
            Err(error) if error.is::<WindowError>() => terminal.say(&format!("{error}; here they are")),
            shown => return shown.map(|()| Outcome::Done),
        }
    }
    let mut scene = scene_args.open(&store, SIZE, None, &terminal.cancel)?;
    let frames_dir = dir.join("frames");
    std::fs::create_dir_all(&frames_dir)
        .with_context(|| format!("{}: cannot make the folder", frames_dir.display()))?;
    let pattern = FramePattern::new(&frames_dir.join("frame_%04d.png"))?;
    let steps: Vec<usize> = (0..STEPS).collect();
    let options = StillOptions { background: BACKGROUND, ..Default::default() };
    let plan = Plan::of_steps(&steps, scene.pipeline.times());
    let output = Output::Images { pattern: pattern.clone(), options };
    let run = Run::new(plan, output);
    run.render(&mut scene, terminal)?;

    let shown = (0..SHEET.0 * SHEET.1).map(|i| pattern.path(2 * i + 1));
    let frames = shown.map(|path| image::read_png(&path)).collect::<Result<Vec<_>, _>>()?;
    let sheet = image::contact_sheet(&frames, SHEET.0, 4, [0.0; 3]);
    let sheet_path = dir.join("contact_sheet.png");
    image::write_png(&sheet_path, &sheet, None, PngDepth::Eight)?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{} frames: {}", STEPS, frames_dir.display())?;
    writeln!(out, "contact sheet: {}", sheet_path.display())?;
    let store = store_path.display();
    writeln!(out, "the series: {store} (try: tetreel info {store}; tetreel render {store} -o frame_%04d.png)")?;
    Ok(Outcome::Done)
}
