//! The part of rendering that all renderers share: a frame from its job to its last pixel.

use super::{Advance, Contrast, Frame, RenderError, RenderJob, Renderer};
use crate::stats::FrameStats;
use crate::task::Cancel;
use std::time::{Duration, Instant};

/// Draws one kind of layer on one device, slice by slice. Its owner ([`FrameRun`]) keeps the clock, the cancel flag, the frame and its
/// times.
pub trait LayerRenderer: Send {
    /// A job under way: its state beyond the renderer's buffers.
    type Job: Send;

    /// Prepares a checked job; `None` if no pixel is left to draw. Sizes the planes (or the texture) to the image with all pixels
    /// transparent, and adds its counts to the statistics.
    ///
    /// # Errors
    /// If the job lacks what this renderer needs, or is beyond the device.
    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<Self::Job>, RenderError>;

    /// Draws for about `budget`, at least one unit of work; true once all pixels are final. May leave work undone once the job is
    /// cancelled.
    ///
    /// # Errors
    /// If the device is lost or fails.
    fn advance(&mut self, budget: Duration, job: &mut Self::Job, frame: &mut Frame) -> Result<bool, RenderError>;

    /// Whether it draws splats of flow itself ([`RenderJob::flow`]). Otherwise its jobs have their fragments.
    fn draws_flow(&self) -> bool {
        false
    }

    /// The contrast of the preview that the last slice completed, if better ones follow ([`RenderJob::previews`]).
    fn preview(&self) -> Option<Contrast> {
        None
    }

    /// Drops the work that an unwanted job has in flight on the device.
    ///
    /// # Errors
    /// If the device is lost or fails.
    fn abandon(&mut self) -> Result<(), RenderError> {
        Ok(())
    }

    /// The longest slice, as [`Renderer::slice`].
    fn slice(&self) -> Duration {
        Duration::MAX
    }
}

/// A renderer of frames of one layer.
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
    /// Milliseconds spent on the frame before `begin`.
    ms_before: f64,
}

impl<L: LayerRenderer> FrameRun<L> {
    /// A renderer with this layer, without a job.
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
        let job = job.with_optics_of_joint_table().with_flow_for(self.layer.draws_flow())?;
        let (cancel, ms_before) = (job.cancel.clone(), job.stats.ms_worked());
        self.frame.stats = FrameStats {
            cells_active: job.active.count() as u64,
            cells_total: job.active.universe() as u64,
            ..job.stats.clone()
        };
        let ms_placed_before = self.frame.stats.ms_place;
        let begun = {
            let _span = tracing::info_span!("begin").entered();
            self.layer.begin(job, &mut self.frame)?
        };
        let stats = &mut self.frame.stats;
        stats.ms_begin = milliseconds_since(started) - (stats.ms_place - ms_placed_before);
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
        // Pixels drawn while the job was cancelled may be wrong.
        let is_done = matches!(advanced, Ok(true)) && !cancel.is_cancelled();
        if is_done || advanced.is_err() {
            self.under_way = None;
        }
        if let Err(failed) = advanced {
            // The first error is the one to report.
            let _ = self.layer.abandon();
            return Err(failed);
        }
        Ok(match self.layer.preview() {
            _ if is_done => Advance::Done(&self.frame),
            Some(contrast) => Advance::Preview(&self.frame, contrast),
            None => Advance::Partial(&self.frame),
        })
    }

    fn take_frame(&mut self, replacement: Frame) -> Frame {
        std::mem::replace(&mut self.frame, replacement)
    }

    fn frame_mut(&mut self) -> &mut Frame {
        &mut self.frame
    }

    fn slice(&self) -> Duration {
        self.layer.slice()
    }
}

fn milliseconds_since(earlier: Instant) -> f64 {
    earlier.elapsed().as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::mesh::Mesh;
    use crate::mesh::test_meshes::kuhn_grid;
    use crate::node_table::{Node, NodeTable};
    use crate::render::testing;
    use std::sync::Arc;

    /// Draws one pixel per call, and can be told to fail or to be cancelled.
    #[derive(Default)]
    struct PixelByPixel {
        /// The pixel at which it fails.
        fails_at: Option<usize>,
        /// The pixel before which it is cancelled.
        cancelled_at: Option<usize>,
        abandoned: usize,
    }

    impl LayerRenderer for PixelByPixel {
        type Job = (RenderJob, usize);

        fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<Self::Job>, RenderError> {
            frame.clear(job.view.plane_px());
            Ok((job.active.count() > 0).then_some((job, 0)))
        }

        fn advance(
            &mut self,
            _: Duration,
            (job, next): &mut Self::Job,
            frame: &mut Frame,
        ) -> Result<bool, RenderError> {
            if self.fails_at == Some(*next) {
                return Err(RenderError::NoFaces);
            }
            if self.cancelled_at == Some(*next) {
                job.cancel.cancel();
            }
            frame.planes.color.pixels[*next] = [1.0; 4];
            *next += 1;
            Ok(*next == frame.planes.color.pixels.len())
        }

        fn abandon(&mut self) -> Result<(), RenderError> {
            self.abandoned += 1;
            Ok(())
        }
    }

    /// A job of 2 x 2 pixels.
    fn job() -> RenderJob {
        let mesh = Arc::new(Mesh::build(kuhn_grid([1; 3])).unwrap().0);
        let camera = Camera::default_for(mesh.positions.world_bounds()).unwrap();
        let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau: 1.0 }]).unwrap();
        let scalars = vec![0.0; mesh.positions.local.len()];
        testing::job(&mesh, scalars, &camera, (2, 2), Arc::new(table))
    }

    /// Number of pixels drawn, and whether the frame is done.
    fn drawn(advance: Advance<'_>) -> (usize, bool) {
        let is_done = matches!(advance, Advance::Done(_));
        let frame = advance.frame();
        (frame.planes.color.pixels.iter().filter(|p| p[3] > 0.0).count(), is_done)
    }

    #[test]
    fn a_frame_is_partial_until_its_layer_is_done_and_then_stays_done() {
        let mut run = FrameRun::<PixelByPixel>::default();
        assert_eq!(drawn(run.advance(Duration::ZERO).unwrap()), (0, true));
        let mut job = job();
        (job.stats.ms_decode, job.stats.ms_order) = (500.0, 300.0);
        run.begin(job.clone()).unwrap();
        let shown: Vec<_> = (0..6).map(|_| drawn(run.advance(Duration::ZERO).unwrap())).collect();
        assert_eq!(shown, [(1, false), (2, false), (3, false), (4, true), (4, true), (4, true)]);
        let stats = run.take_frame(Frame::default()).stats;
        assert_eq!(stats.cells_active, job.active.count() as u64);
        assert_eq!(stats.ms_order, 300.0, "only what is ordered counts as that");
        assert!(stats.ms_begin > 0.0 && stats.ms_render > 0.0 && stats.ms_frame > 800.0);
    }

    #[test]
    fn a_frame_without_anything_to_draw_is_done_at_once() {
        let mut run = FrameRun::<PixelByPixel>::default();
        let nothing = Arc::new(crate::visibility::CellSet::none(job().active.universe()));
        run.begin(RenderJob { active: nothing, ..job() }).unwrap();
        assert_eq!(drawn(run.advance(Duration::ZERO).unwrap()), (0, true));
    }

    #[test]
    fn a_cancelled_frame_stays_partial_even_if_its_last_pixel_is_there() {
        for (at, pixels) in [(1, 2), (3, 4)] {
            let mut run = FrameRun::of(PixelByPixel { cancelled_at: Some(at), ..Default::default() });
            assert!(run.render_unless_cancelled(job()).unwrap().is_none());
            assert_eq!(drawn(run.advance(Duration::MAX).unwrap()), (pixels, false));
        }
    }

    #[test]
    fn a_layer_that_fails_loses_its_job_and_what_it_has_under_way() {
        let mut run = FrameRun::of(PixelByPixel { fails_at: Some(1), ..Default::default() });
        run.begin(job()).unwrap();
        assert_eq!(run.layer.abandoned, 1, "of the job before");
        assert_eq!(drawn(run.advance(Duration::ZERO).unwrap()), (1, false));
        assert_eq!(run.advance(Duration::ZERO).unwrap_err(), RenderError::NoFaces);
        assert_eq!(run.layer.abandoned, 2);
        assert_eq!(drawn(run.advance(Duration::ZERO).unwrap()), (1, true), "there is no job any more");
    }
}
