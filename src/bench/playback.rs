//! The playback suite: the cost of moving time, and the latency of a seek.

use super::{Paired, Spread, Timings};
use crate::pipeline::{FrameRequest, Pipeline, PipelineError, Pipelined, PipelinedOptions};
use crate::task::{Cancel, Progress};
use serde::{Deserialize, Serialize};
use std::io;
use std::time::{Duration, Instant};

/// Frames timed together. The first has nothing prepared: its decoding and ordering overlap nothing.
const BURST: usize = 30;

/// Untimed rounds: caches, page tables, lazy initialisation.
const WARM_UP: usize = 2;

/// Timeout longer than any frame; a hang is noticed elsewhere.
const LONG: Duration = Duration::from_secs(3600);

/// Input of a run.
#[derive(Clone, Debug)]
pub struct PlaybackBench {
    /// Name of the data set.
    pub dataset: String,
    /// Request of the first frame; others differ in their step.
    pub request: FrameRequest,
    /// Number of measured pairs, and of seeks.
    pub pairs: usize,
}

/// Result of a run: the cost of moving time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaybackRun {
    /// Name of the data set.
    pub dataset: String,
    /// Cells of its mesh.
    pub cells: u64,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// `cpu` or `gpu`.
    pub backend: String,
    /// `raw` or `vq`.
    pub codec: String,
    /// Threads in use.
    pub threads: usize,
    /// Frames timed together; 2 in reports without it.
    #[serde(default = "frames_of_old_reports")]
    pub frames: usize,
    /// B: this number of frames of successive steps, prepared while others are rendered. A: as many frames with every step twice in a
    /// row, so that time moves half as often. (With 2 frames, A repeats the first: time stands still.)
    pub pipelined: Paired,
    /// [`Self::pipelined`] with sequential stages in B.
    pub sequential: Paired,
    /// Seeks to steps whose block is in memory, requested while another frame is rendered.
    pub seek: SeekTimes,
}

/// Latency of seeks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeekTimes {
    /// Milliseconds from the request to the frame.
    pub ms: Spread,
    /// Latency over the sum of all stages for that frame.
    pub ratio: Spread,
    /// Latency minus that sum: mainly the time until the frame in progress has stopped.
    pub beyond_ms: Spread,
}

/// Why the suite failed.
#[derive(Debug, thiserror::Error)]
pub enum PlaybackBenchError {
    /// A frame could not be rendered.
    #[error(transparent)]
    Frame(#[from] PipelineError),
    /// Threads could not be started.
    #[error("cannot start threads: {0}")]
    Threads(#[from] io::Error),
}

fn frames_of_old_reports() -> usize {
    2
}

/// The three ways to render frames.
struct Ways {
    request: FrameRequest,
    steps: usize,
    held: Pipelined,
    moving: Pipelined,
    sequential: Pipeline,
    on_gpu: bool,
}

/// Plays at two speeds in turn, and seeks; `progress` is told of each pair and each seek. `open` makes identical pipelines of one series.
///
/// # Errors
/// If a step cannot be read, the camera has no view, or `cancel` was raised.
pub fn run_playback(
    open: &dyn Fn() -> Pipeline,
    bench: &PlaybackBench,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<PlaybackRun, PlaybackBenchError> {
    let start = || Pipelined::start(open(), &PipelinedOptions { frame_cache_bytes: 0, ..Default::default() }, || ());
    let sequential = open();
    let series = sequential.series().clone();
    let steps = series.times().len();
    let mut ways =
        Ways { request: bench.request.clone(), steps, held: start()?, moving: start()?, sequential, on_gpu: false };
    let (mut pipelined, mut one_by_one) = (Timings::default(), Timings::default());
    for round in 0..WARM_UP + bench.pairs.max(1) {
        if cancel.is_cancelled() {
            return Err(PipelineError::Cancelled.into());
        }
        let ms = ways.round(round)?;
        if round >= WARM_UP {
            for (timings, b) in [(&mut pipelined, ms[1]), (&mut one_by_one, ms[2])] {
                timings.a.push(ms[0]);
                timings.b.push(b);
            }
            progress.advance(1);
        }
    }
    let seek = ways.seeks(bench.pairs.max(1), progress, cancel)?;
    const SEED: u64 = 1;
    Ok(PlaybackRun {
        dataset: bench.dataset.clone(),
        cells: series.mesh().topology.tets.len() as u64,
        size: [bench.request.size_px.0 as u32, bench.request.size_px.1 as u32],
        backend: if ways.on_gpu { "gpu" } else { "cpu" }.to_owned(),
        codec: series.field().codec.clone(),
        threads: rayon::current_num_threads(),
        frames: BURST,
        pipelined: Paired::of(&pipelined, SEED),
        sequential: Paired::of(&one_by_one, SEED),
        seek,
    })
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

impl Ways {
    fn request(&self, step: usize) -> FrameRequest {
        FrameRequest { time: (step % self.steps.max(1)).into(), ..self.request.clone() }
    }

    /// Times of the three ways in milliseconds; their order rotates from round to round.
    fn round(&mut self, round: usize) -> Result<[f64; 3], PipelineError> {
        let first = round * BURST / 2;
        let steps = first..first + BURST / 2;
        let mut ms = [0.0; 3];
        for turn in 0..3 {
            let way = (round + turn) % 3;
            let started = Instant::now();
            match way {
                0 => self.on_gpu = self.burst(&self.held, steps.clone().flat_map(|step| [step; 2]))?,
                1 => {
                    self.burst(&self.moving, steps.clone().chain(steps.clone()))?;
                }
                _ => {
                    for step in steps.clone().chain(steps.clone()) {
                        let request = self.request(step);
                        std::hint::black_box(self.sequential.render(&request)?);
                    }
                }
            }
            ms[way] = milliseconds(started);
        }
        Ok(ms)
    }

    /// Renders some steps; returns whether the GPU did.
    fn burst(&self, pipelined: &Pipelined, steps: impl IntoIterator<Item = usize>) -> Result<bool, PipelineError> {
        for step in steps {
            // A burst is shorter than the queue.
            let _ = pipelined.push(self.request(step));
        }
        let mut on_gpu = false;
        while let Some(delivery) = pipelined.wait(LONG) {
            on_gpu = std::hint::black_box(delivery.frame?).stats.on_gpu;
        }
        Ok(on_gpu)
    }

    /// Reads as many blocks as fit in memory; returns their steps.
    fn resident_steps(&self) -> Vec<usize> {
        /// Longer than reading a block: after this time without a new one, all are read.
        const SETTLED: Duration = Duration::from_millis(500);
        let all: Vec<usize> = (0..self.steps).collect();
        let resident = || all.iter().copied().filter(|&step| self.moving.series().is_resident(step)).collect();
        self.moving.expect(&all);
        let mut before: Vec<usize> = Vec::new();
        loop {
            std::thread::sleep(SETTLED);
            let now: Vec<usize> = resident();
            if now == before {
                return now;
            }
            before = now;
        }
    }

    /// Seeks up and down the series while frames are in flight.
    fn seeks(&self, count: usize, progress: &dyn Progress, cancel: &Cancel) -> Result<SeekTimes, PipelineError> {
        let resident = self.resident_steps();
        let [mut ms, mut ratios, mut beyond] = [const { Vec::new() }; 3];
        for seek in 0..count {
            if cancel.is_cancelled() {
                return Err(PipelineError::Cancelled);
            }
            let Some(&target) = resident.get((seek * 7 + 3) % resident.len().max(1)) else { break };
            let _ = self.moving.push(self.request(target + 1));
            let _ = self.moving.push(self.request(target + 2));
            while self.moving.preparations().now > 1 {
                std::thread::yield_now();
            }
            // At a varying time within a frame.
            std::thread::sleep(Duration::from_millis(3 + (seek % 10) as u64));
            let started = Instant::now();
            let _ = self.moving.seek(self.request(target));
            if let Some(delivery) = self.moving.wait(LONG) {
                let took = milliseconds(started);
                let stats = delivery.frame?.stats.clone();
                let worked = stats.ms_worked();
                ms.push(took);
                ratios.push(took / worked.max(f64::MIN_POSITIVE));
                beyond.push(took - worked);
            }
            progress.advance(1);
        }
        Ok(SeekTimes { ms: Spread::of(&ms), ratio: Spread::of(&ratios), beyond_ms: Spread::of(&beyond) })
    }
}
