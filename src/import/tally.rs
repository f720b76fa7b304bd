//! Counts of values that were changed or are missing, for the notes of a source.

use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Most steps that a note lists.
const STEPS_MAX: usize = 8;

/// A count for each field and step; reading a step again does not count it again.
#[derive(Default)]
pub(super) struct Tally(Mutex<BTreeMap<(String, usize), u64>>);

impl Tally {
    /// Notes the count of a field at a step, unless it is 0.
    pub(super) fn note(&self, field: &str, step: usize, count: u64) {
        if count > 0 {
            let mut counts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let known = counts.entry((field.to_owned(), step)).or_default();
            *known = count.max(*known);
        }
    }

    /// All counts of steps up to `last`.
    pub(super) fn counted(&self, last: usize) -> Value {
        let counts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let counts = counts.iter().filter(|((_, step), _)| *step <= last);
        counts.map(|((name, step), count)| serde_json::json!([name, step, count])).collect()
    }

    /// Adds counts of [`Self::counted`].
    pub(super) fn count_on(&self, counted: &Value) {
        let counts: Vec<(String, usize, u64)> = serde_json::from_value(counted.clone()).unwrap_or_default();
        counts.iter().for_each(|(name, step, count)| self.note(name, *step, *count));
    }

    /// A line for each field: `line` has its name, the sum of its counts and its steps, as `3 steps (0, 4, 5)`.
    pub(super) fn lines(&self, line: impl Fn(&str, u64, &str) -> String) -> Vec<String> {
        let mut by_field: BTreeMap<String, (u64, Vec<usize>)> = BTreeMap::new();
        for ((name, step), count) in self.0.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            let (sum, steps) = by_field.entry(name.clone()).or_default();
            *sum += count;
            steps.push(*step);
        }
        let of_field = |(name, (sum, steps)): (String, (u64, Vec<usize>))| {
            let mut listed: Vec<String> = steps.iter().take(STEPS_MAX).map(usize::to_string).collect();
            if steps.len() > STEPS_MAX {
                listed.push("...".to_owned());
            }
            let word = if steps.len() == 1 { "step" } else { "steps" };
            line(&name, sum, &format!("{} {word} ({})", steps.len(), listed.join(", ")))
        };
        by_field.into_iter().map(of_field).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_counts_once_and_long_lists_are_cut() {
        let tally = Tally::default();
        tally.note("a", 3, 2);
        tally.note("a", 3, 2);
        tally.note("a", 1, 5);
        tally.note("b", 0, 0);
        (0..20).for_each(|step| tally.note("c", step, 1));
        let lines = tally.lines(|name, sum, steps| format!("{name} {sum} in {steps}"));
        let resumed = Tally::default();
        resumed.count_on(&tally.counted(10));
        resumed.count_on(&serde_json::json!({"no": "counts"}));
        (11..20).for_each(|step| resumed.note("c", step, 1));
        assert_eq!(lines, resumed.lines(|name, sum, steps| format!("{name} {sum} in {steps}")));
        assert_eq!(lines, ["a 7 in 2 steps (1, 3)", "c 20 in 20 steps (0, 1, 2, 3, 4, 5, 6, 7, ...)"]);
    }
}
