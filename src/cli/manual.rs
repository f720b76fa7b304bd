//! `tetreel manual`: man pages and shell completions, from the definitions of `--help`.

use super::{Cli, Outcome};
use anyhow::Context;
use clap::CommandFactory;
use std::io::Write;
use std::path::PathBuf;

/// Write man pages, or print a shell's completions
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  tetreel manual --completions bash > ~/.local/share/bash-completion/completions/tetreel"
)]
pub(super) struct Args {
    /// Folder to write the man pages to
    #[arg(long, value_name = "DIR", required_unless_present = "completions")]
    man: Option<PathBuf>,
    /// Shell whose completions to print
    #[arg(long, value_name = "SHELL")]
    completions: Option<clap_complete::Shell>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut table = Cli::command();
    if let Some(dir) = &args.man {
        std::fs::create_dir_all(dir).with_context(|| format!("{}: cannot make the folder", dir.display()))?;
        clap_mangen::generate_to(table.clone(), dir)
            .with_context(|| format!("{}: cannot write man pages", dir.display()))?;
    }
    if let Some(shell) = args.completions {
        let mut script = Vec::new();
        clap_complete::generate(shell, &mut table, "tetreel", &mut script);
        std::io::stdout().write_all(&script)?;
    }
    Ok(Outcome::Done)
}
