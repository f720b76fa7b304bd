//! Whether there are two cores for two threads.

use std::hint::black_box;
use std::time::{Duration, Instant};

/// How long is looked.
const LONG: Duration = Duration::from_millis(40);

/// Part of the time that each of two threads must have run.
const ENOUGH: f64 = 0.95;

/// Whether two threads that never wait both run nearly all of the time.
pub fn are_free() -> bool {
    std::thread::scope(|scope| {
        let threads = [scope.spawn(share), scope.spawn(share)];
        threads.into_iter().all(|thread| thread.join().ok().flatten().is_some_and(|share| share >= ENOUGH))
    })
}

/// The part of the time that this thread runs, if it wants to all the time; `None` where the system does not tell.
fn share() -> Option<f64> {
    let (started, before) = (Instant::now(), processor_ns()?);
    while started.elapsed() < LONG {
        black_box(());
    }
    Some((processor_ns()? - before) as f64 / started.elapsed().as_nanos() as f64)
}

/// Nanoseconds that this thread has run.
fn processor_ns() -> Option<u64> {
    // What the system tells is of the last time that it looked.
    std::thread::yield_now();
    std::fs::read_to_string("/proc/thread-self/schedstat").ok()?.split(' ').next()?.parse().ok()
}
