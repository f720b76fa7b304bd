//! Versions of the compiler and valgrind, and paths.

use crate::Trouble;
use crate::baseline::Tools;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Path of the committed counts.
pub fn baseline_path() -> PathBuf {
    root().join("benches").join("baseline.json")
}

/// The root of the repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The versions of the tools.
///
/// # Errors
/// If a tool is missing.
pub fn tools() -> Result<Tools, Trouble> {
    // Under cargo this is the compiler of this program.
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let said = said(Command::new(&rustc).arg("-vV"))
        .map_err(|problem| Trouble(format!("{rustc} -vV: {problem}; run the gate with cargo")))?;
    let line = |name: &str| {
        let found = said.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
        found.map(str::to_owned).ok_or_else(|| Trouble(format!("{rustc} -vV does not say its {name}")))
    };
    let (release, commit, host) = (line("release:")?, line("commit-hash:")?, line("host:")?);
    Ok(Tools { rustc: format!("{release} ({commit})"), valgrind: valgrind()?, target: host })
}

fn valgrind() -> Result<String, Trouble> {
    said(Command::new("valgrind").arg("--version")).map(|text| text.trim().to_owned()).map_err(|problem| {
        Trouble(format!(
            "valgrind --version: {problem}; the counts need valgrind: install it (apt-get install valgrind), or take the ratios alone \
             with: cargo bench --bench gate -- ratios"
        ))
    })
}

/// Output of a command.
fn said(command: &mut Command) -> Result<String, String> {
    let output = command.output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(format!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim()));
    }
    String::from_utf8(output.stdout).map_err(|e| e.to_string())
}
