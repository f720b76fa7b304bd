//! The state of a player window, without the window.

mod act;
mod export;
mod field;
mod flow;
mod growth;
mod insight;
mod led;
mod quality;
mod tick;
mod tracks;

use super::camera_history::CameraHistory;
use super::document::Document;
use super::exporting::Exports;
use super::following::Follower;
use super::history::History;
use super::insight::Insight;
use super::jobs::Jobs;
use super::members;
use super::motion::{Drawing, MotionError};
use super::notice::{self, Notice, NoticeKind};
use super::project_worker::ProjectWorker;
use super::requests::Requests;
use super::tracks::KeyChoice;
use crate::camera::Camera;
use crate::look::{FlowLook, Look, mapped_range};
use crate::pipeline::{FrameRequest, KeyedSurfaces, Series, SharedFrame, SurfaceLook};
use crate::playback::quality::{Family, Quality, QualityControl};
use crate::playback::{Player, Settings, State};
use crate::project::{Data, Edit, Project};
use crate::store::Store;
use crate::timeline::At;
use crate::transfer::{Function, MappedRange, Member, RangeMap, RangePolicy, TransferFunction};
pub use export::ExportCommand;
pub use quality::{DEFAULT_TARGET_FPS, TARGET_FPS};
use std::cell::OnceCell;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Initial state of a session.
pub struct SessionOptions {
    /// Store of the series and other fields.
    pub store: Arc<Store>,
    /// The path that opens the store or its source again.
    pub source: PathBuf,
    /// Settings of the frames.
    pub look: Look,
    /// The project, which overrides the look over time; `None`: one with the look's transfer function.
    pub project: Option<Arc<Project>>,
    /// File of the project.
    pub file: Option<PathBuf>,
    /// Whether the user chose the camera; otherwise it frames the mesh in any window.
    pub camera_is_chosen: bool,
    /// Display-referred colour behind the volume.
    pub background: [f32; 3],
    /// Pixels of the image per pixel of the screen, along a side; within [`IMAGE_SCALES`].
    pub image_scale: f64,
    /// Frames per second to aim at while something moves, within [`TARGET_FPS`]; `None`: all frames are drawn in full.
    pub target_fps: Option<f64>,
    /// Family of lower qualities for that; `None`: the one with the least error.
    pub family: Option<Family>,
    /// Folder for screenshots.
    pub screenshot_folder: PathBuf,
}

/// A frame on the screen.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Planes, counts and times.
    pub frame: SharedFrame,
    /// Request of the frame.
    pub request: FrameRequest,
    /// Whether it came from the cache.
    pub is_kept: bool,
    /// Quality of the frame; of a preview, its contrast.
    pub quality: Quality,
    /// Quality when nothing moves.
    pub at_rest: Quality,
    /// Whether no better frame follows for the same request.
    pub is_final: bool,
}

/// Inputs of requests; frames are requested again if they change.
struct Asked {
    project: Arc<Project>,
    look: Look,
    /// Size of an image in full.
    size_px: (usize, usize),
    quality: Quality,
}

/// A player, the look of its frames, and the user's messages.
///
/// [`Self::act`] applies user actions, [`Self::tick`] shows the due frame. Neither blocks, except a millisecond for a project's table.
/// `now` is the caller's monotonic time, the same as the player's.
pub struct Session {
    pub(super) player: Player,
    store: Arc<Store>,
    /// Settings of the frames. Transfer function and range are those with which the window was opened: those shown are the document's.
    look: Look,
    document: Document,
    /// The path that opens the store or its source again.
    source: PathBuf,
    /// Number of the gesture that is under way, such as a drag.
    gesture: Option<u64>,
    gestures: u64,
    /// Index of the member that is edited, in each ensemble.
    member: usize,
    keys: KeyChoice,
    requests: Requests,
    /// Requests of thumbnails.
    previews: Requests,
    /// Inputs of the pending requests.
    asked: Option<Asked>,
    home: Camera,
    camera_is_chosen: bool,
    cameras: CameraHistory,
    /// End of the current motion of the camera.
    moving_until: Option<Duration>,
    /// Inputs of the quality of the last request.
    drawing: Option<Drawing>,
    /// The last frame shown while something moved.
    moved: Option<Shown>,
    motion_error: Option<MotionError>,
    drift: flow::Drift,
    /// The flow that was shown last, while none is.
    flow_before: Option<FlowLook>,
    viewport_px: Option<(usize, usize)>,
    image_scale: f64,
    background: [f32; 3],
    shown: Option<Shown>,
    kept_frames: u64,
    history: History,
    insight: Insight,
    /// Number of commands that jumped in time.
    turns: u64,
    /// Until this time one core is reserved for the window.
    busy_until: Duration,
    target_fps: Option<f64>,
    family: Option<Family>,
    pub(super) quality: QualityControl,
    /// Whether frames may stay on the GPU of the window.
    has_window_gpu: bool,
    notices: Vec<Notice>,
    help_is_open: bool,
    is_fullscreen: bool,
    jobs: Jobs,
    exports: Exports,
    opens_field: bool,
    /// Name of the field with which the session began.
    first_field: String,
    is_saving: bool,
    wants_screenshot: bool,
    screenshot_folder: PathBuf,
    /// Number of cells of each connected part of the mesh; computed at first use.
    part_sizes: OnceCell<Vec<usize>>,
    shared: led::Share,
    /// Watches a store that grows.
    follower: Option<Follower>,
    /// Time and settings of the clock that leads this one.
    led_to: Option<(f64, Settings)>,
    /// The time of the series that a frame of a clock lasts that leads this one and plays; 0 if none does.
    led_shutter: f64,
    /// Whether the next viewport of another shape is fitted to the whole mesh.
    refits: bool,
}

/// Valid image scales.
pub const IMAGE_SCALES: std::ops::RangeInclusive<f64> = 0.25..=2.0;

/// Largest width or height of a requested image, whatever the screen and the scale.
const SIDE_MAX_PX: f64 = 8192.0;

impl Session {
    /// A session of a player whose first frame has not been requested. `wake` is called when a background job is done.
    ///
    /// # Errors
    /// If the system gives no threads.
    pub fn new(player: Player, options: SessionOptions, wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let insight = Insight::of(player.pipelined().series().clone(), wake.clone())?;
        let SessionOptions { store, look, camera_is_chosen, background, image_scale, .. } = options;
        let SessionOptions { target_fps, family, screenshot_folder, project, file, source, .. } = options;
        let requests = || -> io::Result<Requests> { Ok(Requests::of(ProjectWorker::start(wake.clone())?)) };
        let first_field = player.pipelined().series().field().name.clone();
        let field = first_field.parse().ok();
        let document =
            Document::new(project.map(|project| (project, file)), &look, Data { source: source.clone(), field });
        Ok(Self {
            player,
            store,
            home: look.camera,
            look,
            document,
            source,
            gesture: None,
            gestures: 0,
            member: 0,
            keys: KeyChoice::default(),
            requests: requests()?,
            previews: requests()?,
            asked: None,
            camera_is_chosen,
            cameras: CameraHistory::default(),
            moving_until: None,
            drawing: None,
            moved: None,
            motion_error: None,
            drift: flow::Drift::default(),
            flow_before: None,
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
            is_fullscreen: false,
            exports: Exports::new(wake.clone()),
            jobs: Jobs::new(wake),
            opens_field: false,
            first_field,
            is_saving: false,
            wants_screenshot: false,
            screenshot_folder,
            part_sizes: OnceCell::new(),
            shared: Default::default(),
            follower: None,
            led_to: None,
            led_shutter: 0.0,
            refits: false,
        })
    }

    /// State of the playback.
    pub fn state(&self) -> State {
        self.player.clock().state()
    }

    /// The series played.
    pub fn series(&self) -> &Arc<Series> {
        self.player.pipelined().series()
    }

    /// Number of cells of each connected part of the mesh, the largest first; a mesh without connectivity is one part.
    pub fn part_sizes(&self) -> &[usize] {
        self.part_sizes.get_or_init(|| {
            let mesh = self.series().mesh();
            let topology = &mesh.topology;
            if mesh.is_connected { topology.connectivity().parts().1 } else { vec![topology.tets.len()] }
        })
    }

    /// The path that opens the store or its source again.
    pub fn source(&self) -> &Path {
        &self.source
    }

    /// Store of the series and other fields.
    pub fn store(&self) -> &Arc<Store> {
        &self.store
    }

    /// Settings of the frames, but for colours, opacities and range: those are [the project's](Self::project).
    pub fn look(&self) -> &Look {
        &self.look
    }

    /// What is shown, as a project: it has an ensemble at least.
    pub fn project(&self) -> &Arc<Project> {
        self.document.project()
    }

    /// Index of the ensemble that is edited: the one chosen, or, on the timeline, the one that weighs more in the picture.
    pub fn edited_ensemble(&self) -> usize {
        self.document.edited(self.look.followed.ensembles, self.shown_time())
    }

    /// Indices of the ensemble and of its member that is edited; `None` if the ensemble is empty.
    pub fn edited_member(&self) -> Option<(usize, usize)> {
        let ensemble = self.edited_ensemble();
        let members = self.project().ensembles.get(ensemble).map_or(0, |ensemble| ensemble.members.len());
        Some((ensemble, self.member.min(members.checked_sub(1)?)))
    }

    /// The member that is edited.
    pub fn member(&self) -> Option<&Member> {
        let (ensemble, member) = self.edited_member()?;
        self.project().ensembles.get(ensemble)?.members.get(member)
    }

    /// The range map of that member, on the timeline at the time shown.
    pub fn range_map(&self) -> RangeMap {
        let place = self.edited_member();
        place.map(|place| members::map_at(self.project(), place, self.shown_time())).unwrap_or_default()
    }

    /// The change that gives that member another range map, on the timeline at the time shown.
    pub fn range_map_edit(&self, map: RangeMap) -> Option<Edit> {
        members::with_map(self.project(), self.edited_member()?, self.shown_time(), map)
    }

    /// The transfer function of the member that is edited; `None` if it has shapes over a histogram.
    pub fn function(&self) -> Option<&TransferFunction> {
        self.member().and_then(|member| match &member.function {
            Function::TransferFunction(function) => Some(function),
            Function::Widgets(_) => None,
        })
    }

    /// Transfer function and range of a project that says no more about colours: it was not opened from a file, and has one member.
    pub fn plain_colors(&self) -> Option<(&TransferFunction, RangePolicy)> {
        let [ensemble] = self.project().ensembles.as_slice() else { return None };
        let is_own = !self.document.is_of_file() && ensemble.members.len() == 1;
        Some((self.function()?, self.member()?.range)).filter(|_| is_own)
    }

    /// Numbers of changes that can be undone and done again.
    pub fn changes(&self) -> (usize, usize) {
        self.document.changes()
    }

    /// Whether what is shown differs from the project file, or from that with which the window was opened.
    pub fn is_changed(&self) -> bool {
        self.document.is_changed(&self.look)
    }

    /// The file of the project; `None`: not saved yet.
    pub fn project_file(&self) -> Option<&Path> {
        self.document.file()
    }

    /// Whether the project is being written.
    pub fn is_saving(&self) -> bool {
        self.is_saving
    }

    /// Begins or ends a gesture: changes within it are undone together.
    pub fn hold(&mut self, is_held: bool) {
        if is_held && self.gesture.is_none() {
            self.gestures += 1;
        }
        self.gesture = is_held.then_some(self.gestures);
    }

    /// Time of the picture on the screen, in the unit of the series.
    fn shown_time(&self) -> Option<f64> {
        self.shown.as_ref().map(|shown| shown.request.time.time(self.series().times()))
    }

    /// The transfer function of the picture, if it is that of a single member whose range is not stretched.
    fn only_function(&self) -> Option<&TransferFunction> {
        let mixed = self.shown_time().and_then(|at| self.project().timeline.ensembles.at(at));
        let is_mixed = self.look.followed.ensembles == Default::default() && matches!(mixed, Some(At::Between { .. }));
        let ensemble = self.project().ensembles.get(self.edited_ensemble())?;
        let is_stretched = self.project().timeline.maps.iter().any(|track| track.ensemble == ensemble.name);
        let [member] = ensemble.members.as_slice() else { return None };
        let is_plain = member.enabled && member.map == Default::default() && !is_stretched && !is_mixed;
        self.function().filter(|_| is_plain)
    }

    /// Whether the camera follows the project's path.
    pub fn follows_path(&self) -> bool {
        !self.project().timeline.cameras.keys().is_empty() && self.look.followed.camera
    }

    /// The camera: on the project's path, that of the picture on the screen.
    pub fn camera(&self) -> Camera {
        let on_path = self.shown.as_ref().filter(|_| self.follows_path());
        on_path.map_or(self.look.camera, |shown| shown.request.camera)
    }

    /// Numbers of movements of the camera that can be taken back and made again.
    pub fn camera_turns(&self) -> [usize; 2] {
        self.cameras.counts()
    }

    /// Whether a result of the project is pending.
    pub fn is_working_out(&self) -> bool {
        self.requests.worker.is_waiting()
    }

    /// Display-referred colour behind the volume.
    pub fn background(&self) -> [f32; 3] {
        self.background
    }

    /// Pixels of the image per pixel of the screen, along a side.
    pub fn image_scale(&self) -> f64 {
        self.image_scale
    }

    /// The frame on the screen.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }

    /// Whether a frame is pending.
    pub fn is_waiting(&self) -> bool {
        self.player.pipelined().wanted() > 0 || self.is_working_out()
    }

    /// Number of shown frames that came from the cache.
    pub fn kept_frames(&self) -> u64 {
        self.kept_frames
    }

    /// Costs of the last frames.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Target frame rate while something moves; `None`: all frames are drawn in full.
    pub fn target_fps(&self) -> Option<f64> {
        self.target_fps
    }

    /// Family of lower qualities for that; `None`: the one with the least error.
    pub fn family(&self) -> Option<Family> {
        self.family
    }

    /// Number of commands that jumped in time: no frame delivered before the last one may be shown any more.
    pub fn turns(&self) -> u64 {
        self.turns
    }

    /// Sets whether frames may stay on the GPU of the window. The frame on the screen is requested again: the window may be another.
    pub fn use_window_gpu(&mut self, has_window_gpu: bool) {
        self.has_window_gpu = has_window_gpu;
        self.ask_again();
    }

    /// Requests the frame on the screen again.
    pub fn ask_again(&mut self) {
        if self.asked.is_some() {
            self.player.redraw();
        }
    }

    /// Restarts the background work for another series.
    fn study(&mut self) {
        let series = self.series().clone();
        if let Err(error) = self.insight.turn_to(&series) {
            self.fail(format!("cannot look at the values of this field: {error}"));
        }
    }

    /// Messages to the user.
    pub fn notices(&self) -> &[Notice] {
        &self.notices
    }

    /// Whether the help is on the screen.
    pub fn help_is_open(&self) -> bool {
        self.help_is_open
    }

    /// Whether the window should fill the screen.
    pub fn is_fullscreen(&self) -> bool {
        self.is_fullscreen
    }

    /// Whether another field is being opened.
    pub fn opens_field(&self) -> bool {
        self.opens_field
    }

    /// Adds an error message.
    pub fn fail(&mut self, text: String) {
        self.tell(NoticeKind::Error, text);
    }

    /// Adds a message.
    pub(super) fn tell(&mut self, kind: NoticeKind, text: String) {
        notice::add(&mut self.notices, kind, text);
    }

    /// The scalars that the edited member covers on the screen (or else in the next picture); `None` if there are none.
    pub fn shown_range(&self) -> Option<MappedRange> {
        let time = self.shown.as_ref().map(|shown| shown.request.time).or(self.state().frame)?;
        mapped_range(self.series(), &self.member()?.range, time).ok()
    }

    /// Surfaces and cuts of the look, the last ones as the project's timeline has them on the screen.
    pub fn shown_surfaces(&self) -> SurfaceLook {
        let timeline = &self.project().timeline;
        let has_keys = [&timeline.isovalue, &timeline.iso_opacity, &timeline.cut].iter().any(|t| !t.keys().is_empty());
        let follows = self.look.followed.surfaces && has_keys;
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
        // The colours of a table are undefined where it is transparent.
        let formula = tets.formula.as_ref().and_then(|source| source.formula().ok());
        formula.map_or_else(|| tets.table.over_scalars().eval(scalar).rgb, |formula| formula.eval(scalar).0)
    }

    /// The scalars that a legend covers, and their colours by positions 0..=1.
    pub fn legend(&self) -> Option<(MappedRange, impl Fn(f64) -> [f64; 3])> {
        let function = self.only_function();
        // Members have ranges of their own.
        let series = || mapped_range(self.series(), &RangePolicy::Series, 0.into()).ok();
        let range = if function.is_some() { self.shown_range() } else { series() }?;
        let tets = self.shown.as_ref().and_then(|shown| shown.request.tets());
        let colors = move |position| match (function, tets) {
            (Some(function), _) => function.color_map().eval(position),
            (None, Some(tets)) => tets.table.over_scalars().eval(range.scalar_at(position)).rgb,
            (None, None) => [1.0; 3],
        };
        Some((range, colors))
    }

    /// Sets the size of the viewport in pixels of the screen; 0: nothing is rendered.
    pub fn set_viewport(&mut self, width_px: usize, height_px: usize) {
        let (before, was_framed) = (self.viewport_px, self.refits && self.look.camera == self.home_camera());
        self.viewport_px = Some((width_px, height_px)).filter(|_| width_px > 0 && height_px > 0);
        let is_other = before != self.viewport_px;
        if (before.is_none() || (was_framed && is_other)) && !self.camera_is_chosen {
            self.look.camera = self.home_camera();
        }
        self.refits &= !is_other;
    }

    /// Width and height of images in full; those in motion may be smaller.
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
