//! A frame from its job to its last pixel: what all renderers have in common.

use super::{Advance, Frame, RenderError, RenderJob, Renderer};
use crate::stats::FrameStats;
use crate::task::Cancel;
use std::time::{Duration, Instant};

/// Draws one kind of layer on one device, slice by slice. Whoever has it ([`FrameRun`]) keeps the clock, the flag that cancels,
/// the frame and its times.
pub trait LayerRenderer: Send {
    /// A job under way: what it needs beyond the renderer's buffers.
    type Job: Send;

    /// Prepares a job whose parts belong together; `None` if no pixel is left to be drawn. Makes the planes (or the texture) as
    /// large as the image, all pixels clear, and adds to the statistics what it counts.
    ///
    /// # Errors
    /// If the job lacks what this renderer needs, or is beyond the device.
    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<Self::Job>, RenderError>;

    /// Draws for about `budget`, at least one unit of work; whether all pixels are there. May leave work undone once the job
    /// is cancelled.
    ///
    /// # Errors
    /// If the device is lost or fails.
    fn advance(&mut self, budget: Duration, job: &mut Self::Job, frame: &mut Frame) -> Result<bool, RenderError>;

    /// Forgets what a job that is not wanted any more has under way outside of it.
    ///
    /// # Errors
    /// If the device is lost or fails.
    fn abandon(&mut self) -> Result<(), RenderError> {
        Ok(())
    }

    /// As [`Renderer::slice`].
    fn slice(&self) -> Duration {
        Duration::MAX
    }
}

/// A renderer of frames that are one layer.
pub struct FrameRun<L: LayerRenderer> {
    pub(in crate::render) layer: L,
    frame: Frame,
    under_way: Option<UnderWay<L::Job>>,
}

/// A frame that is not done.
struct UnderWay<J> {
    job: J,
    cancel: Cancel,
    started: Instant,
    /// Milliseconds that the frame took before it came here.
    ms_before: f64,
}

impl<L: LayerRenderer> FrameRun<L> {
    /// A renderer of such layers, without a job.
    pub fn of(layer: L) -> Self {
        Self { layer, frame: Frame::default(), under_way: None }
    }
}

impl<L: LayerRenderer + Default> Default for FrameRun<L> {
    fn default() -> Self {
        Self::of(L::default())
    }
}

impl<L: LayerRenderer> Renderer for FrameRun<L> {
    fn begin(&mut self, job: RenderJob) -> Result<(), RenderError> {
        job.check()?;
        self.under_way = None;
        self.layer.abandon()?;
        let started = Instant::now();
        let job = job.with_optics_of_joint_table();
        let (cancel, ms_before) = (job.cancel.clone(), job.stats.ms_decode + job.stats.ms_order);
        self.frame.stats = FrameStats {
            cells_active: job.active.count() as u64,
            cells_total: job.active.universe() as u64,
            ..job.stats.clone()
        };
        let begun = self.layer.begin(job, &mut self.frame)?;
        self.frame.stats.ms_order += milliseconds_since(started);
        self.under_way = begun.map(|job| UnderWay { job, cancel, started, ms_before });
        Ok(())
    }

    fn advance(&mut self, budget: Duration) -> Result<Advance<'_>, RenderError> {
        let Some(UnderWay { job, cancel, started, ms_before }) = &mut self.under_way else {
            return Ok(Advance::Done(&self.frame));
        };
        if cancel.is_cancelled() {
            return Ok(Advance::Partial(&self.frame));
        }
        let slice_started = Instant::now();
        let advanced = self.layer.advance(budget, job, &mut self.frame);
        let stats = &mut self.frame.stats;
        stats.ms_render += milliseconds_since(slice_started);
        stats.ms_frame = *ms_before + milliseconds_since(*started);
        // What was under way when the job was cancelled may not be what it should be.
        let is_done = matches!(advanced, Ok(true)) && !cancel.is_cancelled();
        if is_done || advanced.is_err() {
            self.under_way = None;
        }
        if let Err(failed) = advanced {
            // What failed is said once.
            let _ = self.layer.abandon();
            return Err(failed);
        }
        Ok(if is_done { Advance::Done(&self.frame) } else { Advance::Partial(&self.frame) })
    }

    fn take_frame(&mut self, replacement: Frame) -> Frame {
        std::mem::replace(&mut self.frame, replacement)
    }

    fn slice(&self) -> Duration {
        self.layer.slice()
    }
}

fn milliseconds_since(earlier: Instant) -> f64 {
    earlier.elapsed().as_secs_f64() * 1e3
}
