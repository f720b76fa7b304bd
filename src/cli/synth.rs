//! `tetreel synth`: generated series.

use super::export::Written;
use super::progress::Terminal;
use super::{Interrupted, Outcome, print_result, source};
use crate::export::vtu::{self, VtuError, VtuOptions};
use crate::ingest::IngestOptions;
use crate::synth::{SeriesName, SynthSpec, generate};
use std::path::PathBuf;

/// Largest series written as .vtu files, which repeat the mesh in every step.
const VTU_CELLS_MAX: u64 = 200_000;

/// Generate a series: decay, dipole, jet, tornado or slab
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel synth jet -o jet.zarr --cells 1000000 --steps 64")]
pub(super) struct Args {
    /// decay, dipole, jet (turbulent scalar with fronts), tornado (vector) or slab (homogeneous)
    name: SeriesName,
    /// A store, or a folder for .vtu files and their .pvd
    #[arg(short, long, value_name = "OUT.zarr|DIR")]
    output: PathBuf,
    /// About how many tets
    #[arg(long, default_value_t = 100_000, value_name = "N")]
    cells: u64,
    /// Number of steps (default: the series' own)
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Seed of everything random
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Replace a store that exists
    #[arg(long)]
    overwrite: bool,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let steps = args.steps.unwrap_or(args.name.default_steps());
    let series = generate(&SynthSpec { name: args.name, cells: args.cells, steps, seed: args.seed })?;
    if args.output.extension().is_some_and(|e| e == "zarr") {
        let options = IngestOptions { overwrite: args.overwrite, ..Default::default() };
        let report = source::run_ingest(&series, &args.output, &options, terminal)?;
        print_result(args.json, &report, &report)?;
        return Ok(Outcome::Done);
    }
    if series.cell_count() > VTU_CELLS_MAX {
        anyhow::bail!(
            "{} cells as .vtu files would repeat the mesh in every step; above {VTU_CELLS_MAX} write a store: -o NAME.zarr",
            series.cell_count()
        );
    }
    match vtu::write_series(&series, &args.output, &VtuOptions::default(), terminal, &terminal.cancel) {
        Err(VtuError::Cancelled) => Err(Interrupted.into()),
        Err(error) => Err(error.into()),
        Ok(report) => {
            print_result(args.json, &report, &Written(&report))?;
            Ok(Outcome::Done)
        }
    }
}
