//! Reads, compares and writes the committed counts. Independent of the rest of the gate, so that `tests/it/gate.rs` can include it.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Version of the file's format.
pub const VERSION: u32 = 1;

/// Allowed relative deviation of a count from the baseline's.
pub const BAND: f64 = 0.05;

/// Instruction counts by kernel name.
pub type Counts = BTreeMap<String, u64>;

/// Tools that counts depend on, besides the source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tools {
    /// Release and commit of the compiler.
    pub rustc: String,
    /// Output of `valgrind --version`.
    pub valgrind: String,
    /// Compilation target.
    pub target: String,
}

/// The committed counts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// [`VERSION`].
    pub version: u32,
    /// Release and commit of the compiler.
    pub rustc: String,
    /// Output of `valgrind --version`.
    pub valgrind: String,
    /// Compilation target.
    pub target: String,
    /// Reason for the last renewal.
    pub reason: String,
    /// Instruction counts by kernel name.
    pub kernels: Counts,
}

impl Baseline {
    /// A baseline of these counts, with the reason for renewing.
    pub fn new(tools: Tools, reason: &str, kernels: Counts) -> Self {
        let Tools { rustc, valgrind, target } = tools;
        Self { version: VERSION, rustc, valgrind, target, reason: reason.to_owned(), kernels }
    }

    /// Parses a baseline; `path` is its file, for messages.
    ///
    /// # Errors
    /// If it is damaged, of another version, or does not have counts of exactly the kernels `names`; the message has the position and
    /// `renew`, the command that helps.
    pub fn parse(text: &str, path: &Path, names: &[&str], renew: &str) -> Result<Self, String> {
        let fail = |problem: String| {
            format!("{}: {problem}; restore it from git, or write it again with: {renew}", path.display())
        };
        let value: serde_json::Value = serde_json::from_str(text).map_err(|e| fail(format!("is no JSON: {e}")))?;
        match value.get("version").and_then(serde_json::Value::as_u64) {
            Some(version) if version == u64::from(VERSION) => {}
            Some(version) => return Err(fail(format!("'version' is {version}, and this gate reads {VERSION}"))),
            None => return Err(fail("has no 'version'".to_owned())),
        }
        // Parsed again from the text, for errors with line and column.
        let baseline: Self = serde_json::from_str(text).map_err(|e| fail(format!("is damaged: {e}")))?;
        let kernels = &baseline.kernels;
        if let Some(name) = names.iter().find(|name| !kernels.contains_key(**name)) {
            return Err(fail(format!("'kernels' lacks '{name}'")));
        }
        if let Some(name) = kernels.keys().find(|name| !names.contains(&name.as_str())) {
            return Err(fail(format!("'kernels' has '{name}', which the gate does not count")));
        }
        if let Some((name, _)) = kernels.iter().find(|(_, count)| **count == 0) {
            return Err(fail(format!("'kernels': '{name}' has no instructions")));
        }
        Ok(baseline)
    }

    /// The baseline as text of its file.
    ///
    /// # Errors
    /// None known; those of serde.
    pub fn text(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// The difference that makes these counts incomparable with counts by `tools`, if any.
    pub fn other_tools(&self, tools: &Tools) -> Option<String> {
        let pairs = [
            ("compiler", &self.rustc, &tools.rustc),
            ("valgrind", &self.valgrind, &tools.valgrind),
            ("target", &self.target, &tools.target),
        ];
        let other = pairs.into_iter().filter(|(_, then, now)| then != now);
        let said: Vec<String> = other.map(|(what, then, now)| format!("{what} {then}, here {now}")).collect();
        (!said.is_empty()).then(|| said.join("; "))
    }
}

/// Verdict on a count against the baseline's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The count is within the band.
    Same,
    /// The count is above the band.
    Slower,
    /// The count is below the band: the baseline should be renewed, or the gain could be lost unnoticed.
    Faster,
    /// The baseline has no such count.
    New,
}

/// Relative change of a count, and the verdict.
pub fn compare(old: Option<u64>, new: u64) -> (f64, Change) {
    let Some(old) = old else { return (0.0, Change::New) };
    let more = new as f64 / old as f64 - 1.0;
    let change = match more {
        more if more > BAND => Change::Slower,
        more if more < -BAND => Change::Faster,
        _ => Change::Same,
    };
    (more, change)
}
