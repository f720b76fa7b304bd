//! The priority of render threads while a window is painted.

#[cfg(feature = "gui")]
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// Priority out of 100: niceness 9 on Linux, below normal on Windows.
#[cfg(feature = "gui")]
const BACKGROUND_PRIORITY: u8 = 23;

/// Lowers the priority of this thread below those that paint a window. Where the system does not allow it, or there is no window to build,
/// all keep the same priority.
pub(crate) fn give_way() {
    #[cfg(feature = "gui")]
    if let Ok(priority) = ThreadPriorityValue::try_from(BACKGROUND_PRIORITY) {
        // Best effort: without it everything works, only less smoothly.
        let _ = ThreadPriority::Crossplatform(priority).set_for_current();
    }
}

#[cfg(all(test, feature = "gui"))]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_thread_that_gives_way_is_nicer() {
        // Niceness is field 19; field 2, in parentheses, may contain spaces.
        let niceness = || -> i32 {
            let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
            stat.rsplit_once(')').unwrap().1.split_whitespace().nth(16).unwrap().parse().unwrap()
        };
        let after = std::thread::spawn(move || (give_way(), niceness()).1).join().unwrap();
        assert_eq!(after, 9, "was {}", niceness());
    }
}
