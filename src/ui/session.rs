//! The state of a player window, without the window.

mod act;
mod insight;
mod quality;
mod tick;

use super::history::History;
use super::insight::Insight;
use super::jobs::Jobs;
use super::notice::{self, Notice, NoticeKind};
use super::project_worker::ProjectWorker;
use super::requests::Requests;
use crate::camera::Camera;
use crate::look::{EnsembleChoice, Look, mapped_range};
use crate::pipeline::{FrameRequest, KeyedSurfaces, Series, SharedFrame, SurfaceLook};
use crate::playback::quality::{Family, Quality, QualityControl};
use crate::playback::{Player, State};
use crate::project::Project;
use crate::store::Store;
use crate::transfer::{MappedRange, RangePolicy};
pub(super) use quality::Drawing;
pub use quality::{DEFAULT_TARGET_FPS, MotionError, TARGET_FPS};
use std::cell::OnceCell;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// What a session begins with.
pub struct SessionOptions {
    /// Where other fields come from.
    pub store: Arc<Store>,
    /// What frames look like.
    pub look: Look,
    /// What is shown instead, from moment to moment.
    pub project: Option<Arc<Project>>,
    /// Whether somebody chose the camera; otherwise it frames the mesh in whatever window there is.
    pub camera_is_chosen: bool,
    /// Display-referred colour behind the volume.
    pub background: [f32; 3],
    /// Pixels of the image per pixel of the screen, along a side; within [`IMAGE_SCALES`].
    pub image_scale: f64,
    /// Frames per second to aim at while something moves, within [`TARGET_FPS`]; `None`: all frames are drawn in full.
    pub target_fps: Option<f64>,
    /// What is given up for that; `None`: what costs least.
    pub family: Option<Family>,
    /// Where images go.
    pub screenshot_folder: PathBuf,
}

/// A frame on the screen.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Its planes, counts and times.
    pub frame: SharedFrame,
    /// What was asked for.
    pub request: FrameRequest,
    /// Whether it was rendered earlier and kept.
    pub is_kept: bool,
    /// How it was drawn: a preview at its contrast.
    pub quality: Quality,
    /// How it will be drawn when nothing moves.
    pub at_rest: Quality,
    /// Whether nothing follows as an answer to the same request.
    pub is_final: bool,
}

/// What frames are asked for anew if it changes.
struct Asked {
    look: Look,
    /// Of an image in full.
    size_px: (usize, usize),
    quality: Quality,
}

/// A player, what its frames look like, and what the user is told.
///
/// [`Self::act`] follows the user, [`Self::tick`] brings the frame that is due. Neither waits but, with a project, a millisecond
/// for what a moment shows. `now` is the caller's monotonic time, the same as the player's.
pub struct Session {
    pub(super) player: Player,
    store: Arc<Store>,
    look: Look,
    requests: Requests,
    /// Requests of small pictures.
    previews: Requests,
    /// What the frames on their way look like.
    asked: Option<Asked>,
    home: Camera,
    camera_is_chosen: bool,
    /// While the camera moves: until when.
    moving_until: Option<Duration>,
    /// What decided how the last moment that was asked for is drawn.
    drawing: Option<Drawing>,
    /// The last picture while something moved.
    moved: Option<Shown>,
    motion_error: Option<MotionError>,
    viewport_px: Option<(usize, usize)>,
    image_scale: f64,
    background: [f32; 3],
    shown: Option<Shown>,
    kept_frames: u64,
    history: History,
    insight: Insight,
    /// Counts commands that went elsewhere.
    turns: u64,
    /// Until then the user has a core for themselves.
    busy_until: Duration,
    target_fps: Option<f64>,
    family: Option<Family>,
    pub(super) quality: QualityControl,
    /// Whether frames may stay on the GPU of the window.
    has_window_gpu: bool,
    notices: Vec<Notice>,
    help_is_open: bool,
    jobs: Jobs,
    opens_field: bool,
    wants_screenshot: bool,
    screenshot_folder: PathBuf,
    /// Found when they are first asked for: cells of each connected part of the mesh.
    part_sizes: OnceCell<Vec<usize>>,
}

/// Scales of the image that can be chosen.
pub const IMAGE_SCALES: std::ops::RangeInclusive<f64> = 0.25..=2.0;

/// Wider or higher images are not asked for, whatever the screen and the scale.
const SIDE_MAX_PX: f64 = 8192.0;

impl Session {
    /// A session of a player whose first frame has not been asked for. `wake` is called when something that takes a while is
    /// done.
    ///
    /// # Errors
    /// If the system gives no threads.
    pub fn new(player: Player, options: SessionOptions, wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let insight = Insight::of(player.pipelined().series().clone(), wake.clone())?;
        let SessionOptions { store, look, camera_is_chosen, background, image_scale, .. } = options;
        let SessionOptions { target_fps, family, screenshot_folder, project, .. } = options;
        let requests = || -> io::Result<Requests> {
            let worker = project.clone().map(|project| ProjectWorker::start(project, wake.clone()));
            Ok(Requests::of(worker.transpose()?))
        };
        Ok(Self {
            player,
            store,
            home: look.camera,
            look,
            requests: requests()?,
            previews: requests()?,
            asked: None,
            camera_is_chosen,
            moving_until: None,
            drawing: None,
            moved: None,
            motion_error: None,
            viewport_px: None,
            image_scale,
            background,
            shown: None,
            kept_frames: 0,
            history: History::default(),
            insight,
            turns: 0,
            busy_until: Duration::ZERO,
            target_fps,
            family,
            quality: QualityControl::default(),
            has_window_gpu: false,
            notices: Vec::new(),
            help_is_open: false,
            jobs: Jobs::new(wake),
            opens_field: false,
            wants_screenshot: false,
            screenshot_folder,
            part_sizes: OnceCell::new(),
        })
    }

    /// Where the playback is.
    pub fn state(&self) -> State {
        self.player.clock().state()
    }

    /// What is played.
    pub fn series(&self) -> &Arc<Series> {
        self.player.pipelined().series()
    }

    /// Number of cells of each connected part of the mesh, that with most cells first.
    pub fn part_sizes(&self) -> &[usize] {
        self.part_sizes.get_or_init(|| self.series().mesh().topology.parts().1)
    }

    /// Where other fields come from.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// What frames look like.
    pub fn look(&self) -> &Look {
        &self.look
    }

    /// What is shown instead, from moment to moment.
    pub fn project(&self) -> Option<&Arc<Project>> {
        self.requests.project()
    }

    /// Whether colours come from ensembles of the project.
    pub fn shows_ensembles(&self) -> bool {
        let has_ensembles = self.project().is_some_and(|project| !project.ensembles.is_empty());
        has_ensembles && self.look.followed.ensembles != EnsembleChoice::Own
    }

    /// Whether the camera goes along the path of the project.
    pub fn follows_path(&self) -> bool {
        let has_path = self.project().is_some_and(|project| !project.timeline.cameras.keys().is_empty());
        has_path && self.look.followed.camera
    }

    /// Where from: on the path of the project, as the picture on the screen.
    pub fn camera(&self) -> Camera {
        let on_path = self.shown.as_ref().filter(|_| self.follows_path());
        on_path.map_or(self.look.camera, |shown| shown.request.camera)
    }

    /// Whether what the project shows is being worked out.
    pub fn is_working_out(&self) -> bool {
        self.requests.is_waiting()
    }

    /// Display-referred colour behind the volume.
    pub fn background(&self) -> [f32; 3] {
        self.background
    }

    /// Pixels of the image per pixel of the screen, along a side.
    pub fn image_scale(&self) -> f64 {
        self.image_scale
    }

    /// What is on the screen.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }

    /// Whether a frame is on its way.
    pub fn is_waiting(&self) -> bool {
        self.player.pipelined().wanted() > 0 || self.requests.is_waiting()
    }

    /// How many frames were shown that had been kept.
    pub fn kept_frames(&self) -> u64 {
        self.kept_frames
    }

    /// What the last frames cost.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Frames per second that are aimed at while something moves; `None`: all frames are drawn in full.
    pub fn target_fps(&self) -> Option<f64> {
        self.target_fps
    }

    /// What is given up for that; `None`: what costs least.
    pub fn family(&self) -> Option<Family> {
        self.family
    }

    /// How often a command has gone elsewhere: no frame that was delivered before the last one may come onto the screen any
    /// more.
    pub fn turns(&self) -> u64 {
        self.turns
    }

    /// Whether frames may stay on the GPU of the window. What is on the screen is asked for again: the window may be another.
    pub fn use_window_gpu(&mut self, has_window_gpu: bool) {
        self.has_window_gpu = has_window_gpu;
        self.ask_again();
    }

    /// What is on the screen is asked for again.
    pub fn ask_again(&mut self) {
        if self.asked.is_some() {
            self.player.redraw();
        }
    }

    /// Goes on with the series in its store, to which steps were added.
    pub fn grow(&mut self, store: Arc<Store>, series: Arc<Series>) {
        match self.player.grow(series) {
            Ok(()) => {
                self.store = store;
                self.study();
            }
            Err(error) => self.fail(error.to_string()),
        }
    }

    /// Another series is played.
    fn study(&mut self) {
        let series = self.series().clone();
        if let Err(error) = self.insight.turn_to(&series) {
            self.fail(format!("cannot look at the values of this field: {error}"));
        }
    }

    /// What the user is told.
    pub fn notices(&self) -> &[Notice] {
        &self.notices
    }

    /// Whether the help is on the screen.
    pub fn help_is_open(&self) -> bool {
        self.help_is_open
    }

    /// Whether another field is being opened.
    pub fn opens_field(&self) -> bool {
        self.opens_field
    }

    /// Says that something failed.
    pub fn fail(&mut self, text: String) {
        notice::add(&mut self.notices, NoticeKind::Error, text);
    }

    /// The scalars that the colours of what is on the screen (or else will be) cover; `None` if there are none.
    pub fn shown_range(&self) -> Option<MappedRange> {
        let time = self.shown.as_ref().map(|shown| shown.request.time).or(self.state().frame)?;
        mapped_range(self.series(), &self.look.range, time).ok()
    }

    /// The surfaces and cuts of the look, the last ones where the timeline of a project has them on the screen.
    pub fn shown_surfaces(&self) -> SurfaceLook {
        let follows = self.look.followed.surfaces && self.project().is_some();
        let tets = self.shown.as_ref().filter(|_| follows).and_then(|shown| shown.request.tets());
        let last = tets.and_then(|tets| tets.surfaces.last());
        let (isovalue, opacity) = (last.map(|surface| surface.value), last.map(|surface| surface.opacity));
        let mut look = self.look.surfaces.at(KeyedSurfaces { isovalue, opacity, cut: None });
        let shown = tets.and_then(|tets| tets.cuts.get(..look.cuts.len()));
        look.cuts.copy_from_slice(shown.unwrap_or(&self.look.surfaces.cuts));
        look
    }

    /// The colour that the transfer function on the screen has at a scalar.
    pub fn color_at(&self, scalar: f64) -> [f64; 3] {
        let Some(tets) = self.shown.as_ref().and_then(|shown| shown.request.tets()) else { return [1.0; 3] };
        // A table has no colours where it is transparent.
        let formula = tets.formula.as_ref().and_then(|source| source.formula().ok());
        formula.map_or_else(|| tets.table.over_scalars().eval(scalar).rgb, |formula| formula.eval(scalar).0)
    }

    /// The scalars that a legend covers, and their colours by positions 0..=1.
    pub fn legend(&self) -> Option<(MappedRange, impl Fn(f64) -> [f64; 3])> {
        // Members of ensembles have ranges of their own.
        let ensembles = self.shown.as_ref().filter(|_| self.shows_ensembles()).and_then(|shown| shown.request.tets());
        let series = || mapped_range(self.series(), &RangePolicy::Series, 0.into()).ok();
        let range = if ensembles.is_some() { series() } else { self.shown_range() }?;
        let colors = move |position| match ensembles {
            Some(tets) => tets.table.over_scalars().eval(range.scalar_at(position)).rgb,
            None => self.look.tf.color_map().eval(position),
        };
        Some((range, colors))
    }

    /// The place for the image has so many pixels of the screen; none: nothing is rendered.
    pub fn set_viewport(&mut self, width_px: usize, height_px: usize) {
        let is_first = self.viewport_px.is_none();
        self.viewport_px = Some((width_px, height_px)).filter(|_| width_px > 0 && height_px > 0);
        if is_first && !self.camera_is_chosen {
            self.look.camera = self.home_camera();
        }
    }

    /// Width and height of images in full; those while something moves may be smaller.
    pub fn size_px(&self) -> Option<(usize, usize)> {
        let (width, height) = self.viewport_px?;
        let scale = self.image_scale.min(SIDE_MAX_PX / width.max(height) as f64);
        let side = |px: usize| ((px as f64 * scale).round() as usize).max(1);
        Some((side(width), side(height)))
    }

    fn home_camera(&self) -> Camera {
        match self.viewport_px {
            Some((width, height)) if !self.camera_is_chosen => self.home.fit_to_aspect(width, height),
            _ => self.home,
        }
    }
}
