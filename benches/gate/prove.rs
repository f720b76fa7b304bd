//! Proves the gate's sensitivity: each kernel and each ratio with its own place slowed down, and without slow-down.

use crate::baseline::{Change, compare};
use crate::counts::{committed, count};
use crate::table::{grouped, print, row};
use crate::tools::tools;
use crate::{Trouble, Verdict, ratios};

/// Shows that every check fails if slowed down, and none otherwise.
pub fn prove() -> Verdict {
    if !cfg!(feature = "slowdown") {
        return Err(Trouble(
            "nothing here can be slowed down; build it with: cargo bench --bench gate --features slowdown -- prove"
                .to_owned(),
        ));
    }
    let counts = prove_counts()?;
    Ok(ratios::prove()? && counts)
}

fn prove_counts() -> Verdict {
    let (tools, baseline) = (tools()?, committed()?);
    let plain = count(false)?;
    // With other tools, the counts without slow-down are the reference and not checked themselves.
    let old = if baseline.other_tools(&tools).is_none() { baseline.kernels } else { plain.clone() };
    let slowed = count(true)?;
    let mut rows = vec![row(["kernel", "as it is", "change", "slowed down", "change", "verdict"])];
    let mut all = true;
    for (name, &plain) in &plain {
        let old = old.get(name).copied();
        let slow = slowed.get(name).copied().unwrap_or(0);
        let ((more, change), (more_slow, change_slow)) = (compare(old, plain), compare(old, slow));
        let verdict = match (change, change_slow) {
            (Change::Same, Change::Slower) => "trips",
            (Change::Same, _) => "DOES NOT TRIP",
            _ => "TRIPS AS IT IS",
        };
        all &= verdict == "trips";
        let [more, more_slow] = [more, more_slow].map(|more| format!("{:+.2} %", 100.0 * more));
        rows.push(row([name, &grouped(plain), &more, &grouped(slow), &more_slow, verdict]));
    }
    print(&rows);
    Ok(all)
}
