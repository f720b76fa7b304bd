//! Checks that two threads have two free cores.

use std::hint::black_box;
use std::time::{Duration, Instant};

/// Duration of the check.
const LONG: Duration = Duration::from_millis(40);

/// Share of the time that each of two threads must have run.
const ENOUGH: f64 = 0.95;

/// Whether two busy threads both run nearly all of the time.
pub fn are_free() -> bool {
    std::thread::scope(|scope| {
        let threads = [scope.spawn(share), scope.spawn(share)];
        threads.into_iter().all(|thread| thread.join().ok().flatten().is_some_and(|share| share >= ENOUGH))
    })
}

/// Share of the time that this busy thread runs; `None` if the system does not report it.
fn share() -> Option<f64> {
    let (started, before) = (Instant::now(), processor_ns()?);
    while started.elapsed() < LONG {
        black_box(());
    }
    Some((processor_ns()? - before) as f64 / started.elapsed().as_nanos() as f64)
}

/// Processor time of this thread in nanoseconds.
fn processor_ns() -> Option<u64> {
    // The system updates the figure only when it reschedules.
    std::thread::yield_now();
    std::fs::read_to_string("/proc/thread-self/schedstat").ok()?.split(' ').next()?.parse().ok()
}
