//! `tetreel synth`: generated series.

use super::progress::Terminal;
use super::{Outcome, print_result};
use crate::export::vtu::{self, VtuOptions};
use crate::field::{Association, FieldSelector, SeriesSource};
use crate::import::{self, Format};
use crate::ingest::{IngestOptions, ingest};
use crate::synth::{FadedSeries, SeriesName, SynthSpec, generate};
use anyhow::Context;
use std::path::{Path, PathBuf};

/// Largest series written as .vtu files, which repeat the mesh in every step.
const VTU_CELLS_MAX: u64 = 200_000;

/// Generate a series: decay, dipole, jet, tornado or slab
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel synth jet -o jet.zarr --cells 1000000 --steps 64\n  \
                  tetreel synth decay --from spx.vtu --subdivide 2 -o spx2.zarr")]
pub(super) struct Args {
    /// decay, dipole, jet (turbulent scalar with fronts), tornado (vector) or slab (homogeneous)
    name: SeriesName,
    /// A store, or a folder for .vtu files and their .pvd
    #[arg(short, long, value_name = "OUT.zarr|DIR")]
    output: PathBuf,
    /// About how many tets
    #[arg(long, default_value_t = 100_000, value_name = "N")]
    cells: u64,
    #[arg(long, value_name = "MESH", conflicts_with_all = ["cells", "seed"])]
    #[arg(help = format!("decay only: fade the scalars of this mesh ({}) instead of generated ones", Format::extensions()))]
    from: Option<PathBuf>,
    /// Split every cell of the mesh into eight, so many times
    #[arg(long, default_value_t = 0, value_name = "N", requires = "from")]
    subdivide: u32,
    /// Field of the mesh to fade: NAME, NAME:mag or NAME:0 (default: its first field of points)
    #[arg(long, value_name = "FIELD", requires = "from")]
    field: Option<FieldSelector>,
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
    match &args.from {
        None => {
            let series = generate(&SynthSpec { name: args.name, cells: args.cells, steps, seed: args.seed })?;
            write(args, &series, series.cell_count(), terminal)
        }
        Some(from) => {
            let series = faded(args, from, steps)?;
            write(args, &series, series.cell_count(), terminal)
        }
    }
}

/// The decay of the first step of another series.
fn faded(args: &Args, from: &Path, steps: usize) -> anyhow::Result<FadedSeries> {
    anyhow::ensure!(args.name == SeriesName::Decay, "--from goes with decay, not with {}", args.name);
    let source = import::open(from)?;
    let mut of_points = source.fields().iter().filter(|field| field.association == Association::Point);
    let found = match &args.field {
        None => of_points.next(),
        Some(selector) => of_points.find(|field| field.name == selector.name),
    };
    let names: Vec<&str> = source.fields().iter().map(|field| field.name.as_str()).collect();
    let field = found.with_context(|| match &args.field {
        Some(field) => format!("{}: no field '{field}' of points; there are {}", from.display(), names.join(", ")),
        None => format!("{}: has no field of points to fade", from.display()),
    })?;
    let selector = args.field.clone().unwrap_or(FieldSelector { name: field.name.clone(), component: None });
    let mut values = Vec::new();
    source.read(field, selector.component_of(field.components), 0, &mut values)?;
    let mesh = source.mesh()?;
    let name = if field.components == 1 { field.name.clone() } else { selector.to_string() };
    Ok(FadedSeries::new(&source.describe(), &name, mesh, values, args.subdivide, steps)?)
}

/// Writes a series as a store or as `.vtu` files.
fn write(args: &Args, series: &dyn SeriesSource, cells: u64, terminal: &Terminal) -> anyhow::Result<Outcome> {
    if args.output.extension().is_some_and(|e| e == "zarr") {
        let options = IngestOptions { overwrite: args.overwrite, ..Default::default() };
        let report = ingest(series, &args.output, &options, terminal, &terminal.cancel)?;
        print_result(args.json, &report, &report)?;
        return Ok(Outcome::Done);
    }
    if cells > VTU_CELLS_MAX {
        anyhow::bail!(
            "{cells} cells as .vtu files would repeat the mesh in every step; above {VTU_CELLS_MAX} write a store: -o NAME.zarr"
        );
    }
    let options = VtuOptions::default();
    let report = vtu::write_series(series, &args.output, &options, terminal, &terminal.cancel)?;
    print_result(args.json, &report, &report)?;
    Ok(Outcome::Done)
}
