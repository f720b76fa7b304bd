//! `tetreel fit`: functions in place of the cells of a store.

use super::progress::Terminal;
use super::{Outcome, print_result, source, steps};
use crate::field::FieldSelector;
use crate::fit::{FitOptions, STEPS_JUDGED, fit};
use crate::functions::vertices::VertexFunctions;
use crate::ingest::StepRange;
use crate::store::{Store, is_store};
use anyhow::bail;
use std::path::PathBuf;

/// Fit smooth functions to a series, and say how far they are from its cells
#[derive(Debug, clap::Args)]
#[command(after_help = "What functions are, and how they are judged: docs/functions.md\n\n\
                  Example:\n  tetreel fit jet.zarr -o functions.zarr --method vertices\n  \
                  tetreel fit jet.zarr --add --method vertices --width 0.5\n  \
                  tetreel render functions.zarr -o jet.png --mode sheets")]
#[command(group(clap::ArgGroup::new("place").required(true).args(["output", "add"])))]
pub(super) struct Args {
    /// A store, or a source to import to the cache first
    #[arg(value_name = "STORE|SOURCE")]
    store: PathBuf,
    /// Write a copy of the store that has the functions, all else as it is
    #[arg(short, long, value_name = "OUT.zarr")]
    output: Option<PathBuf>,
    /// Write the functions into the store itself, nothing else of which changes
    #[arg(long)]
    add: bool,
    /// vertices: one function at each vertex, its value that of the step
    #[arg(long)]
    method: Method,
    /// Parameters as published; neophytou (2006) prints no widths: those of the defaults
    #[arg(long, conflicts_with_all = ["width", "cut"])]
    preset: Option<Preset>,
    /// Widths of functions, in root mean squares of the edges at their vertices, above 0, at most 4
    #[arg(long, default_value_t = VertexFunctions::default().width, value_name = "W")]
    width: f64,
    /// Distance at which functions end, in widths, from 0.5 to 6
    #[arg(long, default_value_t = VertexFunctions::default().cut, value_name = "C")]
    cut: f64,
    /// Field that the functions are judged by: NAME, NAME:mag or NAME:0 (default: the first of vertices); they serve all
    #[arg(long, value_name = "FIELD")]
    field: Option<FieldSelector>,
    #[arg(long, value_name = "A..B:S")]
    #[arg(help = format!("Steps in which they are judged, both ends included (default: {STEPS_JUDGED} spread over the series)"))]
    steps: Option<StepRange>,
    /// Seed of the places at which they are judged
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Replace functions, or an output, that exist
    #[arg(long)]
    overwrite: bool,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// How functions are fitted.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Method {
    /// One at each vertex.
    Vertices,
}

/// Parameters as published.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Preset {
    /// Neophytou and Mueller 2006.
    Neophytou,
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let Method::Vertices = args.method;
    let functions = match args.preset {
        Some(Preset::Neophytou) => VertexFunctions::default(),
        None => VertexFunctions { width: args.width, cut: args.cut },
    };
    functions.check().map_err(anyhow::Error::msg)?;
    let store = match args.add {
        true if args.store.exists() && !is_store(&args.store) => {
            bail!("{}: is no store, to which --add could add; import it first, or use -o", args.store.display())
        }
        true => Store::open(&args.store)?,
        false => source::open(&args.store, terminal)?,
    };
    let count = store.times().len();
    let steps = args.steps.map(|range| steps::within_series(range, count, terminal).select(count)).transpose()?;
    let options =
        FitOptions { functions, field: args.field.clone(), steps, seed: args.seed, overwrite: args.overwrite };
    let fitted = fit(&store, args.output.as_deref(), &options, terminal, &terminal.cancel)?;
    print_result(args.json, &fitted, &fitted)?;
    Ok(Outcome::Done)
}
