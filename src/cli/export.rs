//! `tetreel export`: the steps of a store as files that other programs read.

use super::progress::Terminal;
use super::{Interrupted, Outcome, print_result, source, steps};
use crate::export::StoredSeries;
use crate::export::vtu::{self, VtuError, VtuOptions, VtuReport};
use crate::field::FieldSelector;
use crate::ingest::StepRange;
use std::fmt;
use std::path::PathBuf;

/// Write the steps of a store as .pvd and .vtu files, decompressed
#[derive(Debug, clap::Args)]
#[command(after_help = "Writes case.pvd, and the folder case beside it with case_0000.vtu and so on.\n\n\
                  Example:\n  tetreel export case.zarr -o case.pvd --field T --steps 0..99:10")]
pub(super) struct Args {
    /// A store, or a source to import to the cache first
    #[arg(value_name = "NAME.zarr")]
    store: PathBuf,
    /// The collection to write; its .vtu files go to a folder of that name beside it
    #[arg(short, long, value_name = "OUT.pvd")]
    output: PathBuf,
    /// Field to write: NAME (a vector with all its components), NAME:mag or NAME:0 (again for more; default: all)
    #[arg(long = "field", value_name = "FIELD")]
    fields: Vec<FieldSelector>,
    /// Steps A..B:S, zero-based, both ends included
    #[arg(long, value_name = "A..B:S", default_value = "0..")]
    steps: StepRange,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let store = source::open(&args.store, terminal)?;
    let count = store.times().len();
    let series = StoredSeries::new(&store, &args.fields)?;
    let steps = Some(steps::within_series(args.steps, count, terminal).select(count)?);
    let options = VtuOptions { steps, ..VtuOptions::default() };
    match vtu::write_collection(&series, &args.output, &options, terminal, &terminal.cancel) {
        Err(VtuError::Cancelled) => Err(Interrupted.into()),
        Err(error) => Err(error.into()),
        Ok(report) => {
            print_result(args.json, &report, &Written(&report))?;
            Ok(Outcome::Done)
        }
    }
}

/// The report as a line.
pub(super) struct Written<'a>(pub(super) &'a VtuReport);

impl fmt::Display for Written<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let VtuReport { pvd, steps, bytes } = self.0;
        writeln!(f, "{}: {steps} steps, {:.1} MB", pvd.display(), *bytes as f64 / 1e6)
    }
}
