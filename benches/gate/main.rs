//! The throughput gate: instruction counts of kernels against `benches/baseline.json`, and ratios of run times within one process.
//!
//! ```text
//! cargo bench --bench gate                       counts and ratios
//! cargo bench --bench gate -- counts [--json]    counts alone; as JSON, without comparison
//! cargo bench --bench gate -- ratios             ratios alone
//! cargo bench --bench gate -- renew "REASON"     counts, and writes them as the new baseline
//! cargo bench --bench gate --features slowdown -- prove    shows that each kernel and ratio fails if slowed down
//! ```
//!
//! The exit code is 0 on success, 1 if something has become slower (or so much faster that the baseline is outdated), and 2 without a
//! verdict. `docs/performance.md` has details.

mod baseline;
mod counts;
mod kernels;
mod parent;
mod prove;
mod ratios;
mod renew;
mod scene;
mod table;
mod tools;

use std::path::Path;
use std::process::ExitCode;

/// Why the gate has no verdict; exit code 2.
#[derive(Debug)]
pub struct Trouble(pub String);

impl<E: std::fmt::Display> From<E> for Trouble {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

/// Whether the gate passes, or why it has no verdict.
pub type Verdict = Result<bool, Trouble>;

/// Checks that failed, a line each; none if the gate passes. Or why it has no verdict.
pub type Failures = Result<Vec<String>, Trouble>;

/// The command that renews the baseline.
pub const RENEW: &str = "cargo bench --bench gate -- renew \"REASON\"";

const USAGE: &str = "usage: cargo bench --bench gate [-- counts [--json] | ratios | renew \"REASON\" | prove]";

fn main() -> ExitCode {
    // Cargo itself adds --bench.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let verdict = match words[..] {
        [] => both(),
        ["counts"] => counts::gate().map(said),
        ["counts", "--json"] => counts::print_json(),
        ["ratios"] => ratios::gate().map(said),
        ["renew"] => renew::renew(None),
        ["renew", reason] => renew::renew(Some(reason)),
        ["prove"] => prove::prove(),
        // How the gate runs itself.
        ["kernel", name, folder] => kernels::run(name, Path::new(folder)),
        ["ratio", name] => ratios::once(name),
        _ => Err(Trouble(USAGE.to_owned())),
    };
    match verdict {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(Trouble(text)) => {
            eprintln!("gate: {text}");
            ExitCode::from(2)
        }
    }
}

/// Runs counts, then ratios, even if the counts have changed.
fn both() -> Verdict {
    let counts = counts::gate()?;
    Ok(said([counts, ratios::gate()?].concat()))
}

/// Repeats what failed at the end of the output, below the tables; returns whether nothing did.
fn said(failures: Vec<String>) -> bool {
    failures.iter().for_each(|failure| println!("gate: {failure}"));
    failures.is_empty()
}
