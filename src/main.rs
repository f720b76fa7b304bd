//! The `tetreel` command.

use clap::Parser;

fn main() -> std::process::ExitCode {
    tetreel::cli::run(tetreel::cli::Cli::parse())
}
