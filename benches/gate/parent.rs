//! Counts of the parent commit, with the current tools.

use crate::baseline::Counts;
use crate::tools::root;
use crate::{RENEW, Trouble};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Counts the commit that this tree changes: `HEAD` if there are uncommitted changes, else its parent.
///
/// # Errors
/// If it does not exist, has no gate, or cannot be built or counted; the message says how to renew the baseline instead.
pub fn counts() -> Result<Counts, Trouble> {
    counted().map_err(|problem| {
        Trouble(format!("the parent commit cannot be counted: {problem}; look at the counts yourself, then: {RENEW}"))
    })
}

fn counted() -> Result<Counts, String> {
    let changed = run(git().args(["status", "--porcelain", "--untracked-files=no"]))?;
    let revision = if changed.trim().is_empty() { "HEAD^" } else { "HEAD" };
    let commit = run(git().args(["rev-parse", "--verify", "--quiet", &format!("{revision}^{{commit}}")]))
        .map_err(|_| format!("there is no {revision} here (a shallow clone?)"))?;
    let commit = commit.trim();
    let target = target()?;
    let scratch = tempfile::Builder::new().prefix("gate-parent-").tempdir_in(&target).map_err(|e| e.to_string())?;
    let tree = scratch.path().join("tree");
    // A separate index leaves the repository unchanged.
    let index = scratch.path().join("index");
    run(git().env("GIT_INDEX_FILE", &index).args(["read-tree", commit]))?;
    let prefix = format!("--prefix={}/", tree.display());
    run(git().env("GIT_INDEX_FILE", &index).args(["checkout-index", "--all", &prefix]))?;
    if !tree.join("benches/gate").is_dir() {
        return Err(format!("{commit} has no gate"));
    }
    println!("building {commit}");
    rename(&tree.join("Cargo.toml")).map_err(|problem| format!("Cargo.toml of {commit}: {problem}"))?;
    let program = build(&tree, &target)?;
    let said = run(Command::new(&program).args(["counts", "--json"]).current_dir(&tree))?;
    serde_json::from_str(&said).map_err(|e| format!("{}: {e}", program.display()))
}

fn git() -> Command {
    let mut git = Command::new("git");
    git.current_dir(root());
    git
}

/// The target folder of this program; both versions share their dependencies there.
fn target() -> Result<PathBuf, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    // target/release/deps/gate-0123
    let target = program.ancestors().nth(3).ok_or("this program is in no target folder")?;
    Ok(target.to_owned())
}

/// Changes the package's version: otherwise cargo would confuse the builds of the two trees, which have the same path in their workspace.
fn rename(manifest: &Path) -> Result<(), String> {
    let text = fs::read_to_string(manifest).map_err(|e| e.to_string())?;
    let line = text.lines().find(|line| line.starts_with("version = \"")).ok_or("has no version")?;
    let other = line.strip_suffix('"').ok_or("has no version")?.to_owned() + "-parent\"";
    fs::write(manifest, text.replacen(line, &other, 1)).map_err(|e| e.to_string())
}

/// Builds the gate of a tree; returns its program.
fn build(tree: &Path, target: &Path) -> Result<PathBuf, String> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let mut command = Command::new(cargo);
    command.args(["bench", "--bench", "gate", "--no-run", "--message-format=json-render-diagnostics"]);
    let said = run(command.current_dir(tree).env("CARGO_TARGET_DIR", target))?;
    let messages = said.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    let mut programs = messages.filter_map(|message| {
        let is_gate = message["target"]["name"] == "gate";
        message["executable"].as_str().filter(|_| is_gate).map(PathBuf::from)
    });
    programs.next_back().ok_or_else(|| "cargo names no program".to_owned())
}

/// Output of a command.
fn run(command: &mut Command) -> Result<String, String> {
    let name = format!("{command:?}");
    let output = command.output().map_err(|e| format!("{name}: {e}"))?;
    if output.status.success() {
        return String::from_utf8(output.stdout).map_err(|e| format!("{name}: {e}"));
    }
    let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    // The end of the output has the reason.
    let last = said.lines().rev().take(20).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join("\n");
    Err(format!("{name}: {}: {last}", output.status))
}
