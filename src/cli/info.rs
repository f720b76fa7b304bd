//! `tetreel info`: contents of a store.

use super::progress::Terminal;
use super::{Outcome, print_result, source};
use std::path::PathBuf;

/// Show what a store holds: mesh, times, fields, sizes
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel info case.zarr --json")]
pub(super) struct Args {
    /// A store, or a source to import to the cache first
    #[arg(value_name = "NAME.zarr")]
    store: PathBuf,
    /// Print JSON: {mesh, time, fields, bytes, version}
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let info = source::open(&args.store, terminal)?.info()?;
    print_result(args.json, &info, &info)?;
    Ok(Outcome::Done)
}
