//! Renews the baseline.

use crate::baseline::{Baseline, Counts};
use crate::counts::{committed, count, judge};
use crate::tools::{baseline_path, tools};
use crate::{RENEW, Trouble, Verdict};
use std::fs;
use std::io::{IsTerminal, Write};

/// Counts, prints the changes, and writes the baseline if there is a reason.
pub fn renew(reason: Option<&str>) -> Verdict {
    if reason.is_some_and(|reason| reason.trim().is_empty()) || reason.is_none() && !std::io::stdin().is_terminal() {
        return Err(Trouble(format!("say why the counts may change: {RENEW}")));
    }
    let tools = tools()?;
    let old = committed().map_err(|Trouble(text)| println!("there is nothing to compare with: {text}")).ok();
    if let Some(other) = old.as_ref().and_then(|old| old.other_tools(&tools)) {
        println!("the old baseline is not of these tools ({other})");
    }
    let counts = count(false)?;
    judge(&old.map_or_else(Counts::new, |old| old.kernels), &counts, "baseline");
    let reason = match reason {
        Some(reason) => reason.trim().to_owned(),
        None => asked()?,
    };
    let path = baseline_path();
    fs::write(&path, Baseline::new(tools, &reason, counts).text()?)
        .map_err(|e| Trouble(format!("{}: {e}", path.display())))?;
    println!("{} is written: {reason}", path.display());
    Ok(true)
}

fn asked() -> Result<String, Trouble> {
    print!("Why may the counts change? ");
    std::io::stdout().flush()?;
    let mut line = String::new();
    std::io::stdin().read_line(&mut line)?;
    match line.trim() {
        "" => Err(Trouble("no reason was given; the baseline is as it was".to_owned())),
        reason => Ok(reason.to_owned()),
    }
}
