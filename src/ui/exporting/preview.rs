//! A small picture of what is exported, made on a thread of its own.

use super::Job;
use crate::export::run::{PlannedFrame, RunOptions, picture};
use crate::pipeline::Backend;
use crate::task::Cancel;
use crate::ui::picture::{Picture, over_background};
use crate::ui::worker::{SeriesPipeline, Slot, Worker};
use std::io;
use std::sync::Arc;

/// Height at which text has the size of its share of the image, and not the smallest one (`export::annotate`): above it, small images look
/// as large ones do. Three quarters of the width count as height.
const HEIGHT_PX: f64 = 396.0;

/// A picture to be made.
#[derive(Clone)]
pub(super) struct PreviewJob {
    pub(super) job: Job,
    pub(super) frame: PlannedFrame,
    /// Colour behind the volume.
    pub(super) background: [f32; 3],
}

/// A picture, or why there is none.
pub type PreviewOutcome = Result<Arc<Picture>, String>;

/// Makes previews; of waiting ones, only the newest.
pub(super) struct Preview {
    worker: Worker<PreviewJob>,
    slot: Arc<Slot<PreviewOutcome>>,
}

impl Preview {
    /// Starts the thread, which ends with its owner. `wake` is called when there is a picture.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub(super) fn start(wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let slot = Arc::<Slot<PreviewOutcome>>::default();
        let work = |pipeline: &mut SeriesPipeline, job: PreviewJob, cancel: &Cancel, put: &dyn Fn(PreviewOutcome)| {
            let made = make(pipeline, &job, cancel);
            if !cancel.is_cancelled() {
                put(made);
            }
        };
        let worker = Worker::start("export preview", slot.filler(wake), work, |_, text| Err(text))?;
        Ok(Self { worker, slot })
    }

    /// Requests a picture; the current one is finished.
    pub(super) fn want(&self, job: PreviewJob) {
        self.worker.give(job);
    }

    /// The newest picture.
    pub(super) fn get(&self) -> Option<PreviewOutcome> {
        self.slot.get()
    }
}

/// Renders the frame as an export does, but small and on this thread.
fn make(pipeline: &mut SeriesPipeline, job: &PreviewJob, cancel: &Cancel) -> PreviewOutcome {
    let PreviewJob { job, frame, background } = job;
    let options = RunOptions { size_px: small(job.options.size_px), ..job.options.clone() };
    let mut small = Job { options, ..job.clone() };
    small.look.backend = Backend::Cpu;
    let mut scene = small.scene(pipeline.take(&job.series), cancel);
    let annotator = small.options.annotator(&scene, &small.dataset);
    let made = picture(&mut scene, frame, annotator.as_ref());
    pipeline.put(&job.series, scene.pipeline);
    let image = made.map_err(|error| error.to_string())?;
    let pixels = over_background(&image.pixels, *background);
    Ok(Arc::new(Picture { size: [image.width, image.height], pixels }))
}

/// A size with the same aspect ratio that is not larger than needed.
fn small((width, height): (usize, usize)) -> (usize, usize) {
    let scale = (HEIGHT_PX / (height as f64).min(0.75 * width as f64)).min(1.0);
    let side = |px: usize| ((px as f64 * scale).round() as usize).max(1);
    (side(width), side(height))
}

#[cfg(test)]
mod tests {
    use super::small;

    #[test]
    fn large_sizes_come_down_and_small_ones_stay() {
        assert_eq!(small((3840, 2160)), (704, 396));
        assert_eq!(small((2160, 3840)), (528, 939));
        assert_eq!(small((320, 240)), (320, 240));
    }
}
