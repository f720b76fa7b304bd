//! The closing line of a run.

use super::{FrameRecord, Origin, Output};

/// What is said of frames whose flow has nothing to show.
const STILL: &str = "nothing flows, since all vectors are 0 or not finite";

/// Number of frames in which nothing flows, of those that are not kept.
fn still(records: &[FrameRecord]) -> usize {
    let mut is_still = false;
    let counts = |record: &&FrameRecord| {
        // A frame that is repeated is as the one before.
        is_still = record.stats.as_ref().map_or(is_still, |stats| stats.flow_still);
        is_still && record.origin != Origin::Kept
    };
    records.iter().filter(counts).count()
}

impl Output {
    /// What a run with this output has written, for the user.
    pub fn summary(&self, records: &[FrameRecord]) -> String {
        let kept = records.iter().filter(|record| record.origin == Origin::Kept).count();
        let count = records.len();
        let first = self.path(0).display().to_string();
        let all = format!("{first} to {}", self.path(count.saturating_sub(1)).display());
        let empty = match records.iter().filter(|record| record.empty == Some(true)).count() {
            0 => String::new(),
            1 if count == 1 => "; it shows nothing".to_owned(),
            1 => "; 1 of them shows nothing".to_owned(),
            empty => format!("; {empty} of them show nothing"),
        };
        let written = match (self, count - kept) {
            (Self::Movie { .. }, written) => format!("wrote {first}, {written} frames"),
            (Self::Images { .. }, 0) if count == 1 => format!("{first} was there already"),
            (Self::Images { .. }, 1) if count == 1 => format!("wrote {first}"),
            (Self::Images { .. }, 0) => format!("all {count} frames were there already, {all}"),
            (Self::Images { .. }, written) if kept == 0 => format!("wrote {written} frames, {all}"),
            (Self::Images { .. }, written) => {
                format!("wrote {written} of {count} frames, {all}; {kept} were there already")
            }
        };
        let still = match still(records) {
            0 => String::new(),
            _ if count == 1 => format!("; {STILL}"),
            still => format!("; in {still} of them {STILL}"),
        };
        written + &empty + &still
    }
}
