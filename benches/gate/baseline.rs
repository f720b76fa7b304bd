//! The committed counts: reading, comparing and writing them. Needs nothing of the gate beside it, so that `tests/it/gate.rs` can
//! take it in.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Version of the file's format.
pub const VERSION: u32 = 1;

/// How far a count may be from the baseline's, as a part of it.
pub const BAND: f64 = 0.05;

/// Instructions by the names of kernels.
pub type Counts = BTreeMap<String, u64>;

/// What counts depend on beside the source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tools {
    /// Release and commit of the compiler.
    pub rustc: String,
    /// What `valgrind --version` says.
    pub valgrind: String,
    /// What is compiled for.
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
    /// What `valgrind --version` says.
    pub valgrind: String,
    /// What is compiled for.
    pub target: String,
    /// Why these counts are right.
    pub reason: String,
    /// Instructions by the names of kernels.
    pub kernels: Counts,
}

impl Baseline {
    /// Counts that are right for this reason.
    pub fn new(tools: Tools, reason: &str, kernels: Counts) -> Self {
        let Tools { rustc, valgrind, target } = tools;
        Self { version: VERSION, rustc, valgrind, target, reason: reason.to_owned(), kernels }
    }

    /// The baseline in a text; `path` is its file.
    ///
    /// # Errors
    /// If it is damaged, of another version, or has not the counts of exactly the kernels `names`; says where, and that `renew` is the
    /// command that helps.
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
        // From the text again: it knows lines and columns.
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

    /// The text of the file.
    ///
    /// # Errors
    /// None that is known; those of serde.
    pub fn text(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// What makes these counts no measure for counts with `tools`, if anything does.
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

/// What a count is beside the baseline's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Within the band.
    Same,
    /// More than the band allows.
    Slower,
    /// Fewer: the baseline should be renewed, lest what was gained may be lost again unseen.
    Faster,
    /// There is nothing to compare with.
    New,
}

/// How a count differs: the part of the old one that it has more, and what that means.
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
