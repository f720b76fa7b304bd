//! The priority of threads that render while a window is painted.

use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// Of 100: niceness 9 on Linux, below normal on Windows.
const BACKGROUND_PRIORITY: u8 = 23;

/// Lets this thread give way to others from now on that want the same core, as those do that paint a window. Where the system
/// does not allow it, all stay equals.
pub(super) fn give_way() {
    if let Ok(priority) = ThreadPriorityValue::try_from(BACKGROUND_PRIORITY) {
        // A courtesy: without it everything works, only less smoothly.
        let _ = ThreadPriority::Crossplatform(priority).set_for_current();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_thread_that_gives_way_is_nicer() {
        // The nineteenth field; the second, in parentheses, may have spaces.
        let niceness = || -> i32 {
            let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
            stat.rsplit_once(')').unwrap().1.split_whitespace().nth(16).unwrap().parse().unwrap()
        };
        let after = std::thread::spawn(move || (give_way(), niceness()).1).join().unwrap();
        assert_eq!(after, 9, "was {}", niceness());
    }
}
