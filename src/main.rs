//! The `tetreel` command.

fn main() -> std::process::ExitCode {
    tetreel::cli::run(tetreel::cli::Cli::of(std::env::args_os()))
}
