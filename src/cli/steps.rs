//! Step ranges on the command line that extend beyond the series.

use super::progress::Terminal;
use crate::ingest::StepRange;

/// The range up to the last of `count` steps; reports steps beyond it. A range that begins beyond it stays unchanged, and is an error
/// later.
pub(super) fn within_series(range: StepRange, count: usize, terminal: &Terminal) -> StepRange {
    let cut = range.within(count);
    if cut != range {
        terminal.say(&format!("--steps {range}: the last step of the series is {}", count.saturating_sub(1)));
    }
    cut
}
