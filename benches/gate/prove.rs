//! What the gate notices: each kernel and each ratio with its own place slowed down, and nothing slowed down.

use crate::baseline::{Change, compare};
use crate::counts::{committed, count};
use crate::table::{grouped, print, row};
use crate::tools::tools;
use crate::{Trouble, Verdict, ratios};

/// Shows that all trip if they are slowed down, and none does otherwise.
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
    // With other tools what is not slowed down is the measure, and nothing is said about it.
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
