//! Benchmarks of time and error: paired timings with their uncertainty, and the record of a benchmark.
//!
//! Claims of "no slower than" go through [`paired`]: the two sides run alternately, so that a machine that slows down or
//! heats up slows both, and the ratio comes with an interval.

pub mod accuracy;
mod frames;
mod held;
mod machine;
mod paired;
mod pareto;
mod playback;
#[cfg(feature = "cli")]
pub mod plot;
mod points;
mod report;
mod statistics;
mod still;
#[cfg(test)]
mod test_runs;

pub use frames::{FrameBench, MOTIONS, Motion, run_frames};
pub use held::{HeldBench, HeldRun, run_held};
pub use machine::Machine;
pub use paired::{Paired, Timings, paired};
pub use pareto::pareto_front;
pub use playback::{PlaybackBench, PlaybackBenchError, PlaybackRun, SeekTimes, run_playback};
pub use points::{PointsRow, PointsRun, points_progress, run_points};
pub use report::{BenchReport, BenchRun, JUDGE_RAW, JUDGE_REFERENCE, JUDGE_TABLE, RunError, RunTimes, SceneName};
pub use statistics::{Spread, median, percentile};
pub use still::{StillRow, StillRun, run_still};
