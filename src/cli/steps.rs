//! Step ranges on the command line that extend beyond the series.

use super::progress::Terminal;
use crate::ingest::StepRange;

/// The range up to the last of `count` steps; reports steps beyond it. A range that begins beyond it stays unchanged, and is an error
/// later.
pub(super) fn within_series(range: StepRange, count: usize, terminal: &Terminal) -> StepRange {
    let cut = cut(range, count);
    if cut != range {
        terminal.say(&format!("--steps {range}: the last step of the series is {}", count.saturating_sub(1)));
    }
    cut
}

/// The range without steps beyond the last of `count`.
pub(super) fn cut(range: StepRange, count: usize) -> StepRange {
    let is_too_long = range.first < count && range.last.is_some_and(|last| last >= count);
    if is_too_long { StepRange { last: None, ..range } } else { range }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_ends_with_the_series_but_does_not_begin_behind_it() {
        let steps = |text: &str| cut(text.parse().unwrap(), 5).select(5).ok();
        assert_eq!(steps("0..99:2"), Some(vec![0, 2, 4]));
        assert_eq!(steps("3..5"), Some(vec![3, 4]));
        assert_eq!((steps("1..4:3"), steps("2..")), (Some(vec![1, 4]), Some(vec![2, 3, 4])));
        assert_eq!([steps("5"), steps("5.."), steps("7..9")], [None, None, None]);
    }
}
