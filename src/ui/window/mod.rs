//! The window: shows a [`Session`], and turns user input into [`Action`]s.

mod axes;
mod blit;
mod cameras;
mod editor;
mod export;
mod files;
mod function_file;
mod input;
mod key_boxes;
mod members;
mod overlay;
mod painted;
mod point;
mod popups;
mod preview;
mod project;
mod quality;
mod region_surfaces;
mod regions;
mod run;
mod screen;
mod side;
mod statistics;
mod strip;
mod surfaces;
mod timeline;
mod tracks;
mod unsaved;
mod viewport;
mod waker;
mod welcome;
mod widgets;

pub use run::{WindowError, run, run_watched};

use super::exporting::NewPipeline;
use super::following::Follower;
use super::notice::{self, Notice, NoticeKind};
use super::opening::{Opened, Opening, OpeningOptions};
use super::settings::SettingsFile;
use super::{Action, Session, SessionOptions, SettingsKeeper};
use crate::field::FieldSelector;
use crate::look::Look;
use crate::pipeline::{Pipeline, Pipelined, PipelinedOptions, Series, WindowGpu};
use crate::playback::{Clock, Command, Loop, Player};
use crate::project::Project;
use crate::render::RenderError;
use crate::render::gpu::context::ContextOptions;
use crate::task::Cancel;
use blit::Backdrop;
use crossbeam::channel::Receiver;
use eframe::egui;
use eframe::egui_wgpu::{RenderState, wgpu};
use screen::Screen;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use unsaved::{Leaving, Unsaved};
use waker::Waker;
use welcome::{PathBox, Wish};

/// Initial look of a series.
pub struct Dressed {
    /// Settings of the frames.
    pub look: Look,
    /// Whether the user chose the camera: it is kept then, whatever the window's aspect ratio.
    pub camera_is_chosen: bool,
    /// The project, which overrides the look over time and sets the playback.
    pub project: Option<Arc<Project>>,
    /// Its file.
    pub file: Option<PathBuf>,
}

impl From<Look> for Dressed {
    /// A look with a camera that frames the mesh.
    fn from(look: Look) -> Self {
        Self { look, camera_is_chosen: false, project: None, file: None }
    }
}

/// Chooses the initial look of a series.
pub type Dress = Arc<dyn Fn(&Series) -> Result<Dressed, String> + Send + Sync>;

/// A project file that was read.
pub struct ReadProject {
    /// The store or source that it names.
    pub source: PathBuf,
    /// Its field.
    pub field: Option<FieldSelector>,
    /// Its look.
    pub dress: Dress,
}

/// Reads a project file.
pub type ProjectReader = Arc<dyn Fn(&Path) -> Result<ReadProject, String> + Send + Sync>;

/// Initial content of a window.
pub enum Start {
    /// Empty: the user is asked for a file.
    Nothing,
    /// These files, once they are open.
    Open(Vec<PathBuf>),
    /// An open series.
    Play(Box<Opened>),
}

/// Options of a window.
pub struct WindowOptions {
    /// Initial content.
    pub start: Start,
    /// Initial look.
    pub dress: Dress,
    /// Reads projects that are opened in the window.
    pub projects: ProjectReader,
    /// Whether camera, colours and range are restored, if the series was opened before.
    pub restores: bool,
    /// Whether steps added to a store are shown.
    pub follows: bool,
    /// Whether the first series plays at once, in a loop.
    pub plays: bool,
    /// Options of opening files.
    pub opening: OpeningOptions,
    /// Threads of the pipeline.
    pub threads: PipelinedOptions,
    /// Display-referred colour behind the volume; `None`: the saved one.
    pub background: Option<[f32; 3]>,
    /// Width and height in points; `None`: the saved ones.
    pub size: Option<[f32; 2]>,
    /// Folder for screenshots.
    pub screenshot_folder: PathBuf,
    /// GPU of the window and its frames.
    pub gpu: ContextOptions,
    /// File of the saved settings.
    pub settings: SettingsFile,
}

/// A followed store.
struct Followed {
    /// The followed field.
    series: Arc<Series>,
    follower: Follower,
}

/// The player window. [`Self::show`] lays it out in any host.
pub struct PlayerWindow {
    session: Option<Session>,
    opening: Option<(Opening, Dress)>,
    /// A project file that is being read.
    reading: Option<Receiver<Result<ReadProject, String>>>,
    followed: Option<Followed>,
    options: WindowOptions,
    keeper: SettingsKeeper,
    /// Path that opens the played series again.
    path: Option<PathBuf>,
    started: Instant,
    screen: Screen,
    waker: Waker,
    gpu: WindowGpu,
    side: side::Side,
    timeline: timeline::Pictures,
    overlays: overlay::Overlays,
    export: export::ExportDialog,
    path_box: PathBox,
    unsaved: Unsaved,
    /// Whether the window closes without a question.
    is_closing: bool,
    /// Messages that do not concern the session.
    notices: Vec<Notice>,
    /// New title of the system's window, sent once.
    title: Option<String>,
    /// Whether the panels around the picture have been laid out.
    is_laid_out: bool,
}

/// The default look of a series.
fn plain(series: &Series) -> Result<Dressed, String> {
    Ok(Look::first_for(series, &Cancel::new()).map_err(|error| error.to_string())?.into())
}

impl PlayerWindow {
    /// A window without a host yet.
    ///
    /// # Errors
    /// If the system gives no threads.
    pub fn open(mut options: WindowOptions) -> io::Result<Self> {
        let (waker, gpu) = (Waker::default(), WindowGpu::none());
        let start = std::mem::replace(&mut options.start, Start::Nothing);
        let file = std::mem::replace(&mut options.settings, SettingsFile::nowhere());
        let (keeper, told) = SettingsKeeper::open(file, waker.wake())?;
        let mut window = Self {
            session: None,
            opening: None,
            reading: None,
            followed: None,
            options,
            path: None,
            keeper,
            started: Instant::now(),
            screen: Screen::start(waker.wake())?,
            waker,
            gpu,
            side: Default::default(),
            timeline: Default::default(),
            overlays: Default::default(),
            export: Default::default(),
            path_box: Default::default(),
            unsaved: Default::default(),
            is_closing: false,
            notices: Vec::new(),
            title: None,
            is_laid_out: false,
        };
        if let Some(told) = told {
            window.fail(told);
        }
        match start {
            Start::Nothing => {}
            Start::Open(paths) => {
                let dress = window.first_dress(&paths);
                window.open_files(paths, dress);
            }
            Start::Play(opened) => {
                window.options.opening.field = None;
                let dress = window.first_dress(std::slice::from_ref(&opened.path));
                window.play(*opened, &dress);
            }
        }
        Ok(window)
    }

    /// Shows the window in this context from now on, which is woken when there is something to show; frames rendered on the GPU of
    /// `render_state` are shown without a copy.
    pub fn attach(&mut self, ctx: &egui::Context, render_state: Option<&RenderState>) {
        self.waker.attach(ctx);
        // Otherwise the window is repainted as long as the mouse moves over a button.
        ctx.all_styles_mut(|style| style.interaction.show_tooltips_only_when_still = false);
        if let Some(name) = self.path.as_ref().and_then(|path| path.file_name()).filter(|_| self.title.is_none()) {
            self.title = Some(format!("{} - tetreel", name.to_string_lossy()));
        }
        self.screen.detach();
        if let Some(render_state) = render_state {
            self.screen.attach(render_state, &self.gpu);
        }
        if let Some(session) = &mut self.session {
            session.use_window_gpu(render_state.is_some());
        }
    }

    /// Initial width and height, points.
    fn size(&self) -> [f32; 2] {
        self.options.size.unwrap_or(self.keeper.settings().window_size)
    }

    /// The session, if a series is played.
    pub fn session(&self) -> Option<&Session> {
        self.session.as_ref()
    }

    /// Whether the session's frame is on the screen, and none is pending.
    pub fn is_up_to_date(&self) -> bool {
        let shown = self.session.as_ref().and_then(Session::shown).map(|shown| shown.request.time);
        let is_expected = self.session.as_ref().is_some_and(Session::is_waiting);
        let painted = self.screen.painted().map(|painted| painted.time);
        self.screen.is_up_to_date() && !is_expected && shown.is_some() && painted == shown
    }

    /// Messages that do not concern the session.
    pub fn notices(&self) -> &[Notice] {
        &self.notices
    }

    /// The error if the window's GPU was lost; nothing can be painted any more then.
    fn lost(&self) -> Option<RenderError> {
        let context = self.screen.context()?;
        // Losses are reported by the next poll.
        let _ = context.device.poll(wgpu::PollType::Poll);
        context.check().err().filter(|error| matches!(error, RenderError::DeviceLost { .. }))
    }

    /// Plays an opened series in place of the current one.
    fn play(&mut self, opened: Opened, dress: &Dress) {
        let (name, path) = (opened.name.clone(), opened.path.clone());
        match self.session_of(opened, dress) {
            Ok((mut session, followed)) => {
                self.title = Some(format!("{name} - tetreel"));
                self.followed = followed;
                if std::mem::take(&mut self.options.plays) {
                    let now = self.started.elapsed();
                    for command in [Command::Loop(Loop::All), Command::Play] {
                        session.act(Action::Play(command), now);
                    }
                }
                self.remember_look();
                let opens = session.project_file().unwrap_or(&path).to_owned();
                self.keeper.settings_mut().remember_file(&opens);
                self.path = Some(path);
                let last = self.session.replace(session);
                self.screen.forget();
                self.notices.clear();
                // Joins its threads and frees its memory in the background.
                std::thread::spawn(move || drop(last));
            }
            Err(problem) => self.fail(format!("{name}: {problem}")),
        }
    }

    fn session_of(&self, opened: Opened, dress: &Dress) -> Result<(Session, Option<Followed>), String> {
        let Opened { store, series, path: source, .. } = opened;
        let Dressed { look, camera_is_chosen, project, file } = dress(&series)?;
        let playback = project.as_ref().map_or_else(Default::default, |project| project.playback);
        let followed = self.options.follows.then(|| {
            let wake = Arc::new(self.waker.wake());
            Followed { series: series.clone(), follower: Follower::start(store.clone(), series.clone(), wake) }
        });
        let (gpu, of_window) = (self.options.gpu.clone(), self.gpu.clone());
        let new_pipeline: NewPipeline = Arc::new(move |series| {
            let mut pipeline = Pipeline::new(series);
            pipeline.choose_gpu(gpu.clone());
            pipeline.share_gpu(of_window.clone());
            pipeline
        });
        let pipeline = new_pipeline(series);
        let clock = Clock::with_settings(pipeline.times().clone(), playback).map_err(|error| error.to_string())?;
        let no_threads = |error: io::Error| format!("the system gives no threads: {error}");
        let pipelined = Pipelined::start(pipeline, &self.options.threads, self.waker.wake()).map_err(no_threads)?;
        let settings = self.keeper.settings();
        let screenshot_folder = self.options.screenshot_folder.clone();
        let background = self.options.background.unwrap_or(settings.background);
        let (image_scale, family) = (settings.image_scale, settings.gives_up);
        let target_fps = Some(settings.target_rate).filter(|rate| *rate > 0.0);
        let options = SessionOptions {
            store,
            source,
            look,
            project,
            file,
            camera_is_chosen,
            background,
            image_scale,
            target_fps,
            family,
            screenshot_folder,
        };
        let player = Player::new(clock, pipelined);
        let mut session = Session::new(player, options, Arc::new(self.waker.wake())).map_err(no_threads)?;
        session.export_with(new_pipeline);
        session.use_window_gpu(self.screen.context().is_some());
        Ok((session, followed))
    }

    /// Updates the settings to the current state.
    fn remember(&mut self, ctx: &egui::Context) {
        let settings = self.keeper.settings_mut();
        if let Some(size) = ctx.input(|input| input.viewport().inner_rect).map(|rect| rect.size()) {
            settings.window_size = [size.x, size.y];
        }
        if let Some(session) = &self.session {
            settings.background = session.background();
            (settings.image_scale, settings.target_rate) = (session.image_scale(), session.target_fps().unwrap_or(0.0));
            settings.gives_up = session.family();
        }
        let (told, wait) = self.keeper.tick(self.started.elapsed());
        if let Some(told) = told {
            self.fail(told);
        }
        if let Some(wait) = wait {
            ctx.request_repaint_after(wait);
        }
    }

    /// Saves the look of the current series.
    fn remember_look(&mut self) {
        let Some((session, path)) = self.session.as_ref().zip(self.path.as_ref()) else { return };
        let Some((tf, range)) = session.plain_colors() else { return };
        let look = Look { tf: tf.clone(), range, ..session.look().clone() };
        self.keeper.settings_mut().remember_look(path, &session.series().field().name, &look);
    }

    fn first_dress(&self, paths: &[PathBuf]) -> Dress {
        let dress = self.options.dress.clone();
        if self.options.restores { self.as_last(paths, dress) } else { dress }
    }

    /// Restores the saved look of files opened before.
    fn as_last(&self, paths: &[PathBuf], dress: Dress) -> Dress {
        let known = paths.first().filter(|_| paths.len() == 1).and_then(|path| self.keeper.settings().look_of(path));
        let known = known.cloned();
        Arc::new(move |series: &Series| {
            let mut dressed = dress(series)?;
            let known = known.as_ref().filter(|known| known.field == series.field().name);
            known.inspect(|known| known.apply_to(&mut dressed.look));
            dressed.camera_is_chosen |= known.is_some();
            Ok(dressed)
        })
    }

    /// Adds an error message.
    fn fail(&mut self, text: String) {
        match &mut self.session {
            Some(session) => session.fail(text),
            None => notice::add(&mut self.notices, NoticeKind::Error, text),
        }
    }

    /// Lays out the window, applies user input, and requests the next repaint.
    pub fn show(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        if let Some(title) = self.title.take() {
            ctx.send_viewport_cmd(egui::ViewportCommand::Title(title));
        }
        self.finish_reading();
        self.finish_opening();
        self.take_growth();
        let dropped = ctx.input(|input| input.raw.dropped_files.clone());
        let dropped: Vec<PathBuf> = dropped.iter().map(|file| file.path().to_owned()).collect();
        let mut wish = (!dropped.is_empty()).then_some(Wish::Open(dropped));
        if let Some((opening, _)) = &self.opening {
            egui::Panel::top("opening").show(ui, |ui| {
                wish = welcome::opening(ui, opening.paths(), &opening.progress()).or(wish.take());
            });
        }
        popups::messages(ui, "window messages", &mut self.notices);
        if self.session.is_some() {
            self.show_session(ui, &mut wish);
        } else {
            egui::CentralPanel::default().show(ui, |ui| {
                let recent = &self.keeper.settings().recent;
                wish = welcome::show(ui, &mut self.path_box, recent).or(wish.take());
            });
        }
        popups::drop_hint(&ctx);
        self.remember(&ctx);
        match wish {
            Some(Wish::Open(paths)) => self.leave(&ctx, Leaving::Open(paths)),
            Some(Wish::Stop) => self.opening = None,
            None => {}
        }
        self.guard_changes(&ctx);
    }

    /// Shows steps added to the store.
    fn take_growth(&mut self) {
        let (Some(followed), Some(session)) = (&mut self.followed, &mut self.session) else { return };
        if !Arc::ptr_eq(&followed.series, session.series()) {
            followed.series = session.series().clone();
            followed.follower.set_field(followed.series.clone());
        }
        let now = self.started.elapsed();
        while let Some(grown) = followed.follower.take() {
            match grown {
                Ok(grown) => {
                    session.grow(grown.store, grown.series, now);
                    followed.series = session.series().clone();
                }
                Err(problem) => session.fail(problem),
            }
        }
    }

    fn show_session(&mut self, ui: &mut egui::Ui, wish: &mut Option<Wish>) {
        let Some(session) = &mut self.session else { return };
        let ctx = ui.ctx().clone();
        // Behind all widgets, whose positions are not known yet.
        let (backdrop, whole) = (ui.painter().add(egui::Shape::Noop), ui.available_rect_before_wrap());
        let panel = egui::Frame::side_top_panel(ui.style()).fill(egui::Color32::TRANSPARENT);
        if ctx.current_pass_index() == 0 {
            let [begins, goes_on] = ctx.input(|input| {
                // What a widget does with the release belongs to the gesture.
                [input.pointer.any_pressed(), input.pointer.any_down() || input.pointer.any_released()]
            });
            if begins {
                session.hold(false);
            }
            session.hold(goes_on);
        }
        let mut actions = input::pressed(&ctx, session.selected_key().is_some());
        popups::notices(ui, session, &mut actions);
        let shows_side = &mut self.keeper.settings_mut().shows_side;
        egui::Panel::bottom("timeline").frame(panel).show(ui, |ui| {
            timeline::show(ui, session, shows_side, &mut self.timeline, &mut actions);
        });
        if *shows_side {
            let side = egui::Panel::right("side").frame(panel).default_size(side::WIDTH).min_size(side::WIDTH);
            side.resizable(true).show(ui, |ui| {
                let recent = &self.keeper.settings().recent;
                let files = (&mut self.path_box, recent.as_slice());
                *wish = self.side.files(ui, files, session, &mut actions).or(wish.take());
                self.side.show(ui, session, &mut self.overlays, &mut actions);
            });
        }
        session.want_histogram(self.side.take_histogram());
        let painted = self.screen.painted();
        let viewport = egui::CentralPanel::default()
            .frame(egui::Frame::NONE)
            .show(ui, |ui| viewport::show(ui, session, painted, self.overlays, &mut actions));
        let viewport = viewport.inner;
        let (background, panels) = (widgets::color(session.background()), ui.visuals().panel_fill);
        let behind = Backdrop { window: whole, viewport, background, panels };
        ui.painter().set(backdrop, self.screen.behind(&behind));
        popups::help(&ctx, session, &mut actions);
        self.export.show(&ctx, session, &mut actions);
        if !self.is_laid_out {
            // Panels do not know their sizes before their first layout, and a frame of another size would be discarded.
            self.is_laid_out = true;
            ctx.request_discard("panels have sizes now");
            ctx.request_repaint();
            return;
        }
        if ctx.current_pass_index() > 0 {
            // The first pass has applied the input; this one shows the effect.
            return;
        }
        let size = (viewport.size() * ctx.pixels_per_point()).round().max(egui::Vec2::ZERO);
        session.set_viewport(size.x as usize, size.y as usize);
        self.follow(&ctx, actions);
    }

    fn follow(&mut self, ctx: &egui::Context, actions: Vec<Action>) {
        let Some(session) = &mut self.session else { return };
        let now = self.started.elapsed();
        if !actions.is_empty() {
            // The widgets show the old state: they are laid out again before painting, if there may be another pass.
            ctx.request_discard("the user did something");
            if !ctx.will_discard() {
                ctx.request_repaint();
            }
        }
        let was_fullscreen = session.is_fullscreen();
        actions.into_iter().for_each(|action| session.act(action, now));
        if session.is_fullscreen() != was_fullscreen {
            ctx.send_viewport_cmd(egui::ViewportCommand::Fullscreen(session.is_fullscreen()));
        }
        let (is_new, wait) = session.tick(now);
        if self.screen.update(ctx, session, is_new) {
            session.ask_again();
            ctx.request_repaint();
        }
        if is_new {
            ctx.request_repaint();
        }
        if let Some(wait) = wait {
            ctx.request_repaint_after(wait);
        }
    }
}

impl Drop for PlayerWindow {
    fn drop(&mut self) {
        self.remember_look();
    }
}
