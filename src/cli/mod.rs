//! The command line, one file per subcommand.
//!
//! [`Cli`] is the one source of help, man pages and completions. Exit codes: 0 done, 1 done but a check failed, 2 bad usage or input, 130
//! interrupted.

mod append;
mod bench;
mod compare;
mod demo;
mod export;
mod fit;
mod flow;
mod import;
mod info;
mod manual;
#[cfg(feature = "gui")]
mod play;
mod progress;
mod project;
mod render;
mod scene;
mod source;
mod steps;
mod surfaces;
mod synth;
mod trace;

use crate::export::run::RunError;
use crate::export::surface::SurfaceError;
use crate::export::vtu::VtuError;
use crate::fit::FitError;
use crate::ingest::{CacheError, IngestError};
use crate::pipeline::PipelineError;
use crate::scene::SceneError;
use crate::task::Progress;
use clap::{Parser, Subcommand};
use progress::Terminal;
use std::ffi::OsString;
use std::process::ExitCode;

/// Exit code of a run that was interrupted, as shells have it for SIGINT.
const EXIT_INTERRUPTED: u8 = 130;
/// Exit code for bad usage or input.
const EXIT_BAD_INPUT: u8 = 2;
/// Exit code of a completed run with a failed check.
const EXIT_CHECK_FAILED: u8 = 1;

/// Heading of the options that all commands have.
const COMMON: &str = "Common options";
/// Largest number of threads, more than any machine has cores; starting far more hangs.
const THREADS_MAX: i64 = 1024;

/// Plays time-varying scalar fields on tetrahedral meshes.
#[derive(Debug, Parser)]
#[command(name = "tetreel", version, max_term_width = 110)]
#[command(after_help = "Start with: tetreel demo\nEach command shows an example: tetreel render --help")]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    /// The words of the command line.
    #[arg(skip)]
    words: Vec<OsString>,
    /// Threads to compute with (0: one per core)
    #[arg(long, global = true, default_value_t = 0, value_name = "N", help_heading = COMMON)]
    #[arg(value_parser = clap::value_parser!(u16).range(..=THREADS_MAX))]
    threads: u16,
    /// Say more
    #[arg(short, long, global = true, conflicts_with = "quiet", help_heading = COMMON)]
    verbose: bool,
    /// Say nothing but errors and results
    #[arg(short, long, global = true, help_heading = COMMON)]
    quiet: bool,
}

impl Cli {
    /// Parses these words, the first of which is the program's name. Help and errors end the program.
    pub fn of(words: impl IntoIterator<Item = OsString>) -> Self {
        let words: Vec<OsString> = words.into_iter().collect();
        Self { words: words.clone(), ..Self::parse_from(words) }
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Import(import::Args),
    Info(info::Args),
    #[cfg(feature = "gui")]
    Play(Box<play::Args>),
    Render(Box<render::Args>),
    Compare(compare::Args),
    Bench(Box<bench::Args>),
    Synth(synth::Args),
    Fit(fit::Args),
    Export(export::Args),
    Manual(manual::Args),
}

/// Result of a command without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// Success.
    Done,
    /// The work is done, but a requested check failed.
    CheckFailed,
}

/// The run was interrupted; nothing more is printed.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("interrupted")]
struct Interrupted;

/// Runs the command line and returns its exit code. Results go to stdout, everything else to stderr.
pub fn run(cli: Cli) -> ExitCode {
    if let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(cli.threads.into()).build_global() {
        eprintln!("error: cannot start {} threads: {error}", cli.threads);
        return EXIT_BAD_INPUT.into();
    }
    let terminal = Terminal::new(cli.quiet, cli.verbose);
    let result = match &cli.command {
        Command::Demo(args) => demo::run(args, &terminal),
        Command::Import(args) => import::run(args, &terminal),
        Command::Info(args) => info::run(args, &terminal),
        #[cfg(feature = "gui")]
        Command::Play(args) => play::run(args, &cli.words, &terminal),
        Command::Render(args) => render::run(args, &cli.words, &terminal),
        Command::Compare(args) => compare::run(args, &terminal),
        Command::Bench(args) => bench::run(args, &terminal),
        Command::Synth(args) => synth::run(args, &terminal),
        Command::Fit(args) => fit::run(args, &terminal),
        Command::Export(args) => export::run(args, &terminal),
        Command::Manual(args) => manual::run(args),
    };
    // The bar of a stage that failed.
    terminal.end();
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::CheckFailed) => EXIT_CHECK_FAILED.into(),
        Err(error) if is_interruption(&error) => {
            eprintln!("interrupted");
            EXIT_INTERRUPTED.into()
        }
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            EXIT_BAD_INPUT.into()
        }
    }
}

/// Whether the error comes from Ctrl-C.
fn is_interruption(error: &anyhow::Error) -> bool {
    error.is::<Interrupted>()
        || matches!(error.downcast_ref(), Some(PipelineError::Cancelled))
        || matches!(error.downcast_ref(), Some(IngestError::Cancelled))
        || matches!(error.downcast_ref(), Some(FitError::Cancelled))
        || matches!(error.downcast_ref(), Some(VtuError::Cancelled))
        || matches!(error.downcast_ref(), Some(SurfaceError::Cancelled))
        || error.downcast_ref().is_some_and(CacheError::is_cancelled)
        || error.downcast_ref().is_some_and(SceneError::is_cancelled)
        || error.downcast_ref().is_some_and(RunError::is_cancelled)
}

/// Whether the reader of stdout has closed it (`tetreel info X | head -1`), which is no error.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Prints a result: the text, or with `--json` the same as JSON alone on stdout.
fn print_result(json: bool, value: &impl serde::Serialize, text: &impl std::fmt::Display) -> anyhow::Result<()> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    if json {
        let text = serde_json::to_string_pretty(value)?;
        writeln!(out, "{text}")?;
    } else {
        let text = text.to_string();
        writeln!(out, "{}", text.trim_end())?;
    }
    out.flush()?;
    Ok(())
}
