//! [`Scene`]: a field of a store, the look of its frames, and a project that changes it over time.
//!
//! ```no_run
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut scene = tetreel::scene::Scene::open("jet.zarr")?;
//! let frame = scene.render(7)?;
//! tetreel::image::write_png("step7.png".as_ref(), &frame.planes.color, None, Default::default())?;
//! # Ok(())
//! # }
//! ```

use crate::camera::CameraError;
use crate::error::FileError;
use crate::look::{ColorBar, Colors, Look, colors_of, mapped_range};
use crate::pipeline::{FrameRequest, FrameTime, Pipeline, PipelineError, SampleSet, Upsampling};
use crate::project::{Animation, Project, ProjectError};
use crate::render::Frame;
use crate::store::Store;
use crate::task::Cancel;
use crate::transfer::{ColorMap, FirstLook, MappedRange, RangePolicy, TransferError};
use crossbeam::channel::{RecvTimeoutError, bounded};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// A series, ready to be asked for frames.
pub struct Scene {
    /// Renders the frames.
    pub pipeline: Pipeline,
    /// Settings that the frames share.
    pub look: Look,
    /// The transfer function of the look as text, as written in files.
    pub tf_text: String,
    /// Width and height of a frame, pixels.
    pub size_px: (usize, usize),
    /// Whether frames have planes of normals and surface numbers.
    pub guides: bool,
    /// The pixels that rays are cast for.
    pub samples: SampleSet,
    /// The smaller image that is rendered and enlarged to a frame, if any.
    pub upsampling: Option<Upsampling>,
    /// The project, whose settings replace those of the look.
    animation: Option<Animation>,
    /// Colours of the last request.
    last: Option<LastColors>,
    cancel: Cancel,
}

/// Colours of a request.
struct LastColors {
    /// The scalars that the colours cover; `None` if the field has no finite value.
    range: Option<MappedRange>,
    colors: Colors,
    /// Whether the colours are those of a project's ensembles, not of the look.
    of_project: bool,
}

/// Why a scene has no request or no frame.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The store cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The mesh has no extent that a camera can frame.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The look has no colours at the time of the request.
    #[error("field {field}: {problem}")]
    Colors {
        /// Name of the field.
        field: String,
        /// What is wrong.
        problem: Box<TransferError>,
    },
    /// The look has no table over a range.
    #[error(transparent)]
    Table(#[from] TransferError),
    /// The project cannot be evaluated at the time of the request.
    #[error(transparent)]
    Project(#[from] ProjectError),
    /// The frame could not be rendered.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The scene's `cancel` was raised.
    #[error("cancelled")]
    Cancelled,
}

impl SceneError {
    /// Whether the only reason is a cancel.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Cancelled | Self::Pipeline(PipelineError::Cancelled))
    }
}

impl Scene {
    /// Default width and height, pixels.
    pub const SIZE_PX: (usize, usize) = (1280, 720);

    /// A series with a look; raising `cancel` ends long operations.
    pub fn new(pipeline: Pipeline, look: Look, cancel: &Cancel) -> Self {
        Self {
            pipeline,
            tf_text: look.tf.color_map().name().to_owned(),
            look,
            size_px: Self::SIZE_PX,
            guides: false,
            samples: SampleSet::All,
            upsampling: None,
            animation: None,
            last: None,
            cancel: cancel.clone(),
        }
    }

    /// The first field of a store, framed, with colours and opacities that suit its values
    /// ([`Series::first_look`](crate::pipeline::Series::first_look)).
    ///
    /// # Errors
    /// If there is no store, or its mesh has no extent.
    pub fn open(store: impl AsRef<Path>) -> Result<Self, SceneError> {
        let (pipeline, cancel) = (Pipeline::open(&Store::open(store)?, None)?, Cancel::new());
        let FirstLook { tf, range, text } = pipeline.series().first_look(None, &cancel);
        let look = Look { range, ..Look::default_for(pipeline.series(), tf)? };
        Ok(Self { tf_text: text, ..Self::new(pipeline, look, &cancel) })
    }

    /// Overrides the look with a project from now on.
    pub fn set_project(&mut self, project: Arc<Project>) {
        let Look { opacity_kind, lengths, .. } = self.look;
        self.animation = Some(Animation::new(project, self.pipeline.series().clone(), opacity_kind, lengths));
    }

    /// The project, if there is one.
    pub fn project(&self) -> Option<&Arc<Project>> {
        self.animation.as_ref().map(Animation::project)
    }

    /// Checks that there are requests for the first step and for all that the project's timeline names.
    ///
    /// # Errors
    /// As [`Self::request`], or if there is no view through the look's camera.
    pub fn check(&mut self) -> Result<(), SceneError> {
        if self.pipeline.times().is_empty() {
            return Ok(());
        }
        for at in self.project().map(|project| project.timeline.places()).unwrap_or_default() {
            self.request_at(0.into(), at)?;
        }
        self.request(0)?;
        self.look.camera.view(self.size_px.0, self.size_px.1)?;
        Ok(())
    }

    /// The flag that ends long operations.
    pub fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// Renders a step, or a time between two steps.
    ///
    /// # Errors
    /// As [`Self::request`] and [`Pipeline::render`].
    pub fn render(&mut self, time: impl Into<FrameTime>) -> Result<&Frame, SceneError> {
        let request = self.request(time)?;
        Ok(self.pipeline.render_unless(&request, &self.cancel)?)
    }

    /// The request for a step, or for a time between two steps.
    ///
    /// # Errors
    /// If the look has no colours or the project cannot be evaluated there, or the scene is cancelled.
    pub fn request(&mut self, time: impl Into<FrameTime>) -> Result<FrameRequest, SceneError> {
        let time = time.into();
        self.request_at(time, time.time(self.pipeline.times()))
    }

    /// A request of a step that has been held for `since_s` seconds, with frames of `frame_s` seconds: its flow has gone on. Chooses the
    /// look's rate of flow if it has none.
    ///
    /// # Errors
    /// If the vectors cannot be read, or the scene is cancelled.
    pub fn holding(&mut self, request: FrameRequest, since_s: f64, frame_s: f64) -> Result<FrameRequest, SceneError> {
        let Some(flow) = &mut self.look.flow else { return Ok(request) };
        let rate = match flow.rate {
            Some(rate) => rate,
            None => {
                let measure = flow.layer.measure(self.pipeline.series(), &self.cancel)?;
                let measure = measure.ok_or(SceneError::Cancelled)?;
                *flow.rate.insert(measure.rate(&flow.layer.style, frame_s.recip()))
            }
        };
        Ok(request.holding(rate * since_s, rate * frame_s))
    }

    /// The request for `time` of the series, with the project's timeline at `at`, in the unit of the series.
    ///
    /// # Errors
    /// As [`Self::request`].
    pub fn request_at(&mut self, time: FrameTime, at: f64) -> Result<FrameRequest, SceneError> {
        let Look { opacity_kind, lengths, .. } = self.look;
        let keyed = self.animation.as_mut().map(|animation| {
            animation.set_opacities(opacity_kind, lengths);
            animation.at(time, at, &self.cancel)
        });
        if self.cancel.is_cancelled() {
            return Err(SceneError::Cancelled);
        }
        let keyed = keyed.transpose()?.unwrap_or_default();
        match &keyed.colors {
            Some(colors) => {
                // The range of the legend.
                let range = mapped_range(self.pipeline.series(), &RangePolicy::Series, 0.into()).ok();
                self.last = Some(LastColors { range, colors: colors.clone(), of_project: true });
            }
            None => self.find_colors(time)?,
        }
        let own = || self.last.as_ref().map(|last| last.colors.clone()).ok_or(SceneError::Cancelled);
        let request = self.look.request(time, self.size_px, &keyed, own)?;
        let has_surfaces = request.tets().is_some_and(|tets| !tets.surfaces.is_empty() || !tets.cuts.is_empty());
        Ok(FrameRequest {
            guides: self.guides && has_surfaces,
            samples: self.samples.clone(),
            upsampling: self.upsampling,
            ..request
        })
    }

    /// Makes the look's own colours at a time, unless those of the last request have the same source.
    fn find_colors(&mut self, time: FrameTime) -> Result<(), SceneError> {
        let field = &self.pipeline.field().name;
        let failed = |problem| SceneError::Colors { field: field.clone(), problem: Box::new(problem) };
        let range = mapped_range(self.pipeline.series(), &self.look.range, time).map_err(failed)?;
        let source = self.look.source(&range);
        if self.last.as_ref().is_some_and(|last| !last.of_project && last.colors.formula.as_deref() == Some(&source)) {
            return Ok(());
        }
        let look = self.look.clone();
        let colors = unless_cancelled(&self.cancel, move || look.colors(&range)).ok_or(SceneError::Cancelled)?;
        self.last = Some(LastColors { range: Some(range), colors: colors?, of_project: false });
        Ok(())
    }

    /// Whether the colours of the last request are those of a project's ensembles.
    pub fn shows_ensembles(&self) -> bool {
        self.last.as_ref().is_some_and(|last| last.of_project)
    }

    /// A text that describes the transfer function of the last request.
    pub fn transfer_function(&self) -> String {
        match self.project().filter(|_| self.shows_ensembles()).map(|project| project.ensembles.len()) {
            Some(1) => "an ensemble".to_owned(),
            Some(count) => format!("{count} ensembles on a timeline"),
            None => self.tf_text.clone(),
        }
    }

    /// The scalars that the colours of the last request cover; `None` if the field has no finite value.
    pub fn range(&self) -> Option<MappedRange> {
        self.last.as_ref().and_then(|last| last.range)
    }

    /// The colour map and scalar range of the last request.
    pub fn color_scale(&self) -> Option<(ColorMap, MappedRange)> {
        let LastColors { range, colors, of_project } = self.last.as_ref()?;
        let range = (*range)?;
        let of_look = || Some(self.look.tf.color_map().clone());
        let map = if *of_project { colors_of(colors.table.over_scalars(), &range) } else { of_look() };
        Some((map?, range))
    }

    /// What the colours of the last request mean: those of the field, and of the flow if a field colours it.
    pub fn color_bars(&self) -> Vec<ColorBar> {
        let title = self.pipeline.field().titled();
        let of_field = self.color_scale().map(|(map, range)| ColorBar { title, map, range });
        let of_flow = self.look.flow.as_ref().and_then(|flow| {
            let field = flow.layer.colors.as_ref()?.field.parse().ok()?;
            flow.color_bar(self.pipeline.series().beside(&field).ok()?.field())
        });
        of_field.into_iter().chain(of_flow).collect()
    }
}

/// Interval at which a wait checks for a cancel.
const TICK: Duration = Duration::from_millis(50);

/// Runs `work` on a new thread; returns `None` if `cancel` is raised before it ends. `work` sees no flag, continues after a cancel and must
/// write nothing. A panic of `work` resumes on the caller.
pub fn unless_cancelled<T: Send + 'static>(cancel: &Cancel, work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    let (say, heard) = bounded(1);
    // After a cancel the receiver is gone.
    let thread = std::thread::spawn(move || _ = say.send(work()));
    loop {
        match heard.recv_timeout(TICK) {
            Ok(done) => return Some(done),
            Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => return None,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => match thread.join() {
                Err(panic) => std::panic::resume_unwind(panic),
                Ok(()) => return None, // not reached: a thread that ends without a panic has sent
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::{IngestOptions, ingest};
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::Silent;
    use crate::transfer::TransferFunction;

    #[test]
    fn work_that_looks_at_no_flag_is_waited_for_until_somebody_cancels() {
        let cancel = Cancel::new();
        assert_eq!(unless_cancelled(&cancel, || 7), Some(7));
        let (end, ended) = bounded::<()>(0);
        cancel.cancel();
        assert_eq!(unless_cancelled(&cancel, move || ended.recv().is_ok()), None, "before the work has ended");
        drop(end);
        let panic = std::panic::catch_unwind(|| unless_cancelled(&Cancel::new(), || -> u8 { panic!("on purpose") }));
        assert!(panic.is_err());
    }

    #[test]
    fn a_store_is_opened_and_rendered_by_two_calls_as_by_hand() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("jet.zarr");
        let series = generate(&SynthSpec { cells: 2000, steps: 2, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        ingest(&series, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        let mut scene = Scene::open(&path).unwrap();
        scene.size_px = (32, 24);
        let frame = scene.render(1).unwrap().planes.color.clone();
        assert!(frame.pixels.iter().any(|pixel| pixel[3] > 0.1));
        assert!(scene.color_scale().is_some() && !scene.shows_ensembles());

        let mut pipeline = Pipeline::open(&Store::open(&path).unwrap(), None).unwrap();
        let look = Look::first_for(pipeline.series(), &Cancel::new()).unwrap();
        let range = mapped_range(pipeline.series(), &look.range, 1.into()).unwrap();
        let table = Arc::new(look.table(&range).unwrap());
        let request = FrameRequest::new(1, look.camera, table, (32, 24));
        assert_eq!(pipeline.render(&request).unwrap().planes.color, frame);

        // The user may change the look: derived colours follow it.
        scene.look.tf = TransferFunction::parse("gray@0:0.5,1:0.5").unwrap();
        let colored = scene.render(1).unwrap().planes.color.clone();
        assert_ne!(colored, frame);
        scene.look.lengths.unit_distance *= 10.0;
        let thinner = scene.render(1).unwrap().planes.color.clone();
        assert_ne!(thinner, colored);
        let again = Scene::new(Pipeline::new(scene.pipeline.series().clone()), scene.look.clone(), &Cancel::new());
        let mut again = Scene { size_px: (32, 24), ..again };
        assert_eq!(again.render(1).unwrap().planes.color, thinner);

        assert!(matches!(Scene::open(dir.path().join("other.zarr")), Err(SceneError::File(_))));
        scene.cancel().cancel();
        assert!(scene.render(0).unwrap_err().is_cancelled());
    }
}
