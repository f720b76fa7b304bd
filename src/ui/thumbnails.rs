//! Thumbnails of steps, for hovering over the timeline: rendered on a thread of their own.

use super::picture::Picture;
use super::worker::{SeriesPipeline, Worker, lock};
use crate::pipeline::{Backend, FrameRequest, FrameTime, PipelineError, Series, TetDraw};
use crate::task::Cancel;
use std::io;
use std::sync::{Arc, Mutex};

/// Width of the timeline's thumbnails, pixels.
pub const WIDTH_PX: usize = 160;

/// Number of thumbnails kept.
pub const KEPT: usize = 64;

/// A thumbnail to be made.
#[derive(Clone)]
struct Job {
    series: Arc<Series>,
    request: FrameRequest,
    background: [f32; 3],
}

/// Makes thumbnails and keeps those of one look. No call blocks.
pub struct Thumbnails {
    width_px: usize,
    worker: Worker<Job>,
    kept: Arc<Mutex<Kept>>,
}

/// Thumbnails of one look at one series.
#[derive(Default)]
struct Kept {
    of: Option<Job>,
    pictures: Vec<Made>,
    /// The pending thumbnail.
    wanted: Option<FrameTime>,
    uses: u64,
}

/// A thumbnail, or why there is none.
pub type Outcome = Result<Arc<Picture>, String>;

/// What was made of a job.
struct Made {
    time: FrameTime,
    picture: Outcome,
    /// Time of the last use, counted in uses.
    used: u64,
}

impl Thumbnails {
    /// Starts the thread, which ends with its owner. `wake` is called when there is another thumbnail. Thumbnails fit into a square of
    /// this width in pixels.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start(width_px: usize, wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let kept: Arc<Mutex<Kept>> = Arc::default();
        let of_thread = kept.clone();
        let put = move |(time, picture), cancel: &Cancel| {
            lock(&of_thread).put(time, picture, cancel);
            wake();
        };
        let work = |pipeline: &mut SeriesPipeline, job: Job, cancel: &Cancel, put: &dyn Fn((FrameTime, Outcome))| {
            let outcome = match pipeline.of(&job.series).render_unless(&job.request, cancel) {
                Ok(frame) => Ok(Arc::new(Picture::of(frame, job.background))),
                Err(PipelineError::Cancelled) => return,
                Err(error) => Err(error.to_string()),
            };
            put((job.request.time, outcome));
        };
        let worker = Worker::start("thumbnails", put, work, |job, text| (job.request.time, Err(text)))?;
        Ok(Self { width_px, worker, kept })
    }

    /// Requests the thumbnail of a frame, replacing a pending request. If look, series or background are not those of the last call, all
    /// thumbnails are dropped. Does nothing if the thumbnail is there or pending.
    pub fn want(&self, series: &Arc<Series>, request: &FrameRequest, background: [f32; 3]) {
        let job = Job { series: series.clone(), request: self.reduced(request), background };
        let time = job.request.time;
        let mut kept = lock(&self.kept);
        if !kept.of.as_ref().is_some_and(|of| of.looks_like(&job)) {
            *kept = Kept { of: Some(job.clone()), ..Kept::default() };
        } else if kept.wanted == Some(time) {
            return;
        }
        self.worker.stop();
        kept.wanted = None;
        if kept.find(time).is_none() {
            kept.wanted = Some(time);
            self.worker.give(job);
        }
    }

    /// Drops the pending request.
    pub fn forget_wanted(&self) {
        let mut kept = lock(&self.kept);
        self.worker.stop();
        kept.wanted = None;
    }

    /// The thumbnail of a frame of the series that was last wanted, or why there is none; `None`: it is pending, or was not wanted.
    pub fn get(&self, request: &FrameRequest) -> Option<Outcome> {
        let request = self.reduced(request);
        let mut kept = lock(&self.kept);
        kept.of.as_ref().filter(|of| of.request.same_view(&request))?;
        kept.find(request.time)
    }

    /// The request of the thumbnail: with the same aspect ratio, rendered on this thread.
    fn reduced(&self, request: &FrameRequest) -> FrameRequest {
        let (width, height) = request.size_px;
        let scale = self.width_px as f64 / width.max(height).max(1) as f64;
        let side = |px: usize| ((px as f64 * scale).round() as usize).max(1);
        let size_px = (side(width), side(height));
        FrameRequest { size_px, backend: Backend::Cpu, ..request.clone().with_draw(TetDraw::Auto) }
    }
}

impl Job {
    fn looks_like(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.series, &other.series)
            && self.background == other.background
            && self.request.same_view(&other.request)
    }
}

impl Kept {
    fn find(&mut self, time: FrameTime) -> Option<Outcome> {
        self.uses += 1;
        let made = self.pictures.iter_mut().find(|made| made.time == time)?;
        made.used = self.uses;
        Some(made.picture.clone())
    }

    /// Keeps a thumbnail, unless it was cancelled, which happens under the same lock.
    fn put(&mut self, time: FrameTime, picture: Outcome, cancel: &Cancel) {
        if cancel.is_cancelled() {
            return;
        }
        self.wanted = None;
        if self.pictures.len() >= KEPT
            && let Some(oldest) = (0..self.pictures.len()).min_by_key(|&i| self.pictures[i].used)
        {
            self.pictures.swap_remove(oldest);
        }
        self.uses += 1;
        self.pictures.push(Made { time, picture, used: self.uses });
    }
}

#[cfg(test)]
mod tests {
    use super::super::picture::over_background;
    use super::super::worker::tests::wait_for;
    use super::*;
    use crate::camera::Camera;
    use crate::node_table::{Node, NodeTable};
    use crate::pipeline::Pipeline;
    use crate::pipeline::test_series::{jet, logged};

    const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

    fn frame(series: &Series, time: impl Into<FrameTime>) -> FrameRequest {
        let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
        let node = |scalar, red| Node { scalar, rgb: [red, 0.5, 0.0], tau: 2.0 };
        let table = NodeTable::new(vec![node(-0.5, 0.0), node(1.5, 1.0)]).unwrap();
        FrameRequest::new(time, camera, Arc::new(table), (640, 320))
    }

    fn silent() -> Thumbnails {
        Thumbnails::start(32, Arc::new(|| ())).unwrap()
    }

    fn made(thumbnails: &Thumbnails, request: &FrameRequest) -> Arc<Picture> {
        wait_for("picture", || thumbnails.get(request)?.ok())
    }

    #[test]
    fn a_small_picture_has_the_pixels_of_a_frame_of_its_size() {
        let (series, thumbnails) = (jet(), silent());
        let mut seen = Vec::new();
        for time in [0.into(), 2.into(), FrameTime::between(1, 2, 0.4)] {
            let request = frame(&series, time);
            thumbnails.want(&series, &request, BACKGROUND);
            let picture = made(&thumbnails, &request);
            let small = FrameRequest { size_px: (32, 16), backend: Backend::Cpu, ..request };
            let color = &Pipeline::new(series.clone()).render(&small).unwrap().planes.color.clone();
            assert_eq!(picture.size, [32, 16]);
            assert_eq!(picture.pixels, over_background(&color.pixels, BACKGROUND), "{time:?}");
            seen.push(picture);
        }
        assert_ne!(seen[0], seen[1], "the test can fail");
    }

    #[test]
    fn scrubbing_renders_only_what_is_wanted_last() {
        let (series, log) = logged(100);
        let thumbnails = silent();
        log.hang(true);
        (0..100).for_each(|step| thumbnails.want(&series, &frame(&series, step), BACKGROUND));
        log.hang(false);
        made(&thumbnails, &frame(&series, 99));
        assert_eq!(log.decoded(), [99]);
        assert!((0..99).all(|step| thumbnails.get(&frame(&series, step)).is_none()));
    }

    #[test]
    fn a_picture_that_is_kept_is_not_made_again_until_the_look_changes() {
        let (series, log) = logged(10);
        let thumbnails = silent();
        let want = |request: &FrameRequest| {
            thumbnails.want(&series, request, BACKGROUND);
            made(&thumbnails, request)
        };
        let first = want(&frame(&series, 3));
        want(&frame(&series, 4));
        assert!(Arc::ptr_eq(&first, &want(&frame(&series, 3))));
        assert_eq!(log.decoded(), [3, 4]);
        let turned = FrameRequest { camera: frame(&series, 3).camera.orbit(40.0, 10.0).unwrap(), ..frame(&series, 3) };
        assert!(thumbnails.get(&turned).is_none());
        want(&turned);
        assert!(thumbnails.get(&frame(&series, 4)).is_none(), "those of the look before are gone");
        thumbnails.want(&series, &turned, [1.0; 3]);
        let white = wait_for("picture", || thumbnails.get(&turned)?.ok());
        assert_eq!(white.pixels[0], [255; 4], "on another background");
        let (other, _) = logged(10);
        thumbnails.want(&other, &turned, [1.0; 3]);
        assert!(!Arc::ptr_eq(&white, &made(&thumbnails, &turned)), "of another series");
    }

    #[test]
    fn the_pictures_used_last_are_kept() {
        let (series, log) = logged(KEPT + 2);
        let thumbnails = silent();
        let want = |step: usize| {
            thumbnails.want(&series, &frame(&series, step), BACKGROUND);
            made(&thumbnails, &frame(&series, step));
        };
        (0..KEPT).for_each(want);
        want(0);
        want(KEPT);
        let is_there = |step: usize| thumbnails.get(&frame(&series, step)).is_some();
        assert_eq!([0, 1, 2, KEPT].map(is_there), [true, false, true, true]);
        assert_eq!(log.decoded().len(), KEPT + 1);
    }

    #[test]
    fn what_fails_is_said_and_not_tried_all_the_time() {
        let (series, log) = logged(5);
        log.fail_at(1);
        log.panic_at(2);
        let thumbnails = silent();
        for (step, word) in [(1, "damaged"), (2, "not meant")] {
            let request = frame(&series, step);
            thumbnails.want(&series, &request, BACKGROUND);
            let problem = wait_for("problem", || thumbnails.get(&request)?.err());
            assert!(problem.contains(word), "{problem}");
            assert_eq!(thumbnails.get(&request), Some(Err(problem)));
            thumbnails.want(&series, &request, BACKGROUND);
            assert_eq!(lock(&thumbnails.kept).wanted, None);
        }
        thumbnails.want(&series, &frame(&series, 3), BACKGROUND);
        made(&thumbnails, &frame(&series, 3));
    }

    #[test]
    fn what_nobody_wants_any_more_does_not_come_and_the_thread_ends() {
        let (series, log) = logged(5);
        let thumbnails = silent();
        log.hang(true);
        thumbnails.want(&series, &frame(&series, 1), BACKGROUND);
        thumbnails.forget_wanted();
        log.hang(false);
        thumbnails.want(&series, &frame(&series, 2), BACKGROUND);
        made(&thumbnails, &frame(&series, 2));
        assert_eq!(log.decoded(), [2]);
        log.hang(true);
        thumbnails.want(&series, &frame(&series, 3), BACKGROUND);
        drop(thumbnails);
        wait_for("end", || (Arc::strong_count(&series) == 1).then_some(()));
    }
}
