//! The window: shows a [`Session`], and turns user input into [`Action`](super::Action)s.

mod axes;
mod beside;
mod blit;
mod cameras;
mod damage;
mod editor;
mod export;
mod files;
mod flow;
mod function_file;
mod input;
mod key_boxes;
mod layout;
mod members;
mod overlay;
mod painted;
mod path_field;
mod playing;
mod point;
mod popups;
mod preview;
mod project;
mod quality;
mod region_surfaces;
mod regions;
mod retained;
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

pub use path_field::{Answer, Choice, OpenDialog, system_dialogs};
pub use run::{WindowError, run, run_watched};

use super::notice::{self, Notice, NoticeKind};
use super::opening::{Opened, Opening, OpeningOptions};
use super::settings::SettingsFile;
use super::views::Views;
use super::{Session, SettingsKeeper};
use crate::field::FieldSelector;
use crate::look::Look;
use crate::pipeline::{PipelinedOptions, Series, WindowGpu};
use crate::project::Project;
use crate::render::RenderError;
use crate::render::gpu::context::ContextOptions;
use crate::task::Cancel;
use crossbeam::channel::Receiver;
use eframe::egui;
use eframe::egui_wgpu::{RenderState, wgpu};
use playing::Place;
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
    /// Shown beside the first series, once that is open.
    pub beside: Option<PathBuf>,
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
    /// Dialogs in which files are chosen.
    pub dialogs: OpenDialog,
}

/// The player window. [`Self::show`] lays it out in any host.
pub struct PlayerWindow {
    views: Option<Views>,
    opening: Option<(Opening, Dress, Place)>,
    /// A project file that is being read.
    reading: Option<(Receiver<Result<ReadProject, String>>, Place)>,
    options: WindowOptions,
    keeper: SettingsKeeper,
    started: Instant,
    /// The pictures of the left, or only, view and of the right one.
    screens: [Screen; 2],
    waker: Waker,
    gpu: WindowGpu,
    side: side::Side,
    timeline: timeline::Pictures,
    overlays: overlay::Overlays,
    export: export::ExportDialog,
    path_box: PathBox,
    first_picture: welcome::FirstPicture,
    unsaved: Unsaved,
    /// Whether the window closes without a question.
    is_closing: bool,
    /// Messages that do not concern the session.
    notices: Vec<Notice>,
    /// New title of the system's window, sent once.
    title: Option<String>,
    /// Whether the press under way turned to another view.
    has_turned: bool,
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
        let dialogs = options.dialogs.clone();
        let (keeper, told) = SettingsKeeper::open(file, waker.wake())?;
        let mut window = Self {
            views: None,
            opening: None,
            reading: None,
            options,
            keeper,
            started: Instant::now(),
            screens: [Screen::start(waker.wake())?, Screen::start(waker.wake())?],
            waker,
            gpu,
            side: side::Side::new(&dialogs),
            timeline: Default::default(),
            overlays: Default::default(),
            export: Default::default(),
            path_box: PathBox::new(&dialogs),
            first_picture: Default::default(),
            unsaved: Default::default(),
            is_closing: false,
            notices: Vec::new(),
            title: None,
            has_turned: false,
            is_laid_out: false,
        };
        if let Some(told) = told {
            window.fail(told);
        }
        match start {
            Start::Nothing => {}
            Start::Open(paths) => {
                let dress = window.first_dress(&paths);
                window.open_files(paths, dress, Place::Here);
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
        let name = self.session().and_then(|session| session.source().file_name()).filter(|_| self.title.is_none());
        if let Some(name) = name {
            self.title = Some(format!("{} - tetreel", name.to_string_lossy()));
        }
        self.screens.iter_mut().for_each(Screen::detach);
        if let Some(render_state) = render_state {
            let context = Arc::new(screen::context_of(render_state));
            self.gpu.set(context.clone());
            self.screens.iter_mut().for_each(|screen| screen.attach(render_state, &context));
        }
        let sessions = self.views.iter_mut().flat_map(Views::sessions_mut);
        sessions.for_each(|session| session.use_window_gpu(render_state.is_some()));
    }

    /// Initial width and height, points.
    fn size(&self) -> [f32; 2] {
        self.options.size.unwrap_or(self.keeper.settings().window_size)
    }

    /// The session of the active view, if a series is played.
    pub fn session(&self) -> Option<&Session> {
        self.views.as_ref().map(Views::active)
    }

    /// The views, if a series is played.
    pub fn views(&self) -> Option<&Views> {
        self.views.as_ref()
    }

    /// Whether the frames of all views are on the screen, and none is pending.
    pub fn is_up_to_date(&self) -> bool {
        let Some(views) = &self.views else { return false };
        let is_painted = |(screen, session): (&Screen, &Session)| {
            let shown = session.shown().map(|shown| shown.request.time);
            screen.is_up_to_date() && shown.is_some() && screen.painted().map(|painted| painted.time) == shown
        };
        let screens = [views.place(), 1 - views.place()].map(|place| &self.screens[place]);
        !views.is_waiting() && screens.into_iter().zip(views.sessions()).all(is_painted)
    }

    /// Messages that do not concern the session.
    pub fn notices(&self) -> &[Notice] {
        &self.notices
    }

    /// The error if the window's GPU was lost; nothing can be painted any more then.
    fn lost(&self) -> Option<RenderError> {
        let context = self.screens[0].context()?;
        // Losses are reported by the next poll.
        let _ = context.device.poll(wgpu::PollType::Poll);
        context.check().err().filter(|error| matches!(error, RenderError::DeviceLost { .. }))
    }

    /// Updates the settings to the current state.
    fn remember(&mut self, ctx: &egui::Context) {
        let settings = self.keeper.settings_mut();
        if let Some(size) = ctx.input(|input| input.viewport().inner_rect).map(|rect| rect.size()) {
            settings.window_size = [size.x, size.y];
        }
        if let Some(session) = self.views.as_ref().map(Views::active) {
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

    /// Saves the looks of the series.
    fn remember_look(&mut self) {
        let settings = self.keeper.settings_mut();
        for session in self.views.iter().flat_map(Views::sessions) {
            let Some((tf, range)) = session.plain_colors() else { continue };
            let look = Look { tf: tf.clone(), range, ..session.look().clone() };
            settings.remember_look(session.source(), &session.series().field().name, &look);
        }
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
        match &mut self.views {
            Some(views) => views.active_mut().fail(text),
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
        let dropped = ctx.input(|input| input.raw.dropped_files.clone());
        let dropped: Vec<PathBuf> = dropped.iter().map(|file| file.path().to_owned()).collect();
        let mut wish = (!dropped.is_empty()).then_some(Wish::Open(dropped));
        if let Some((opening, ..)) = &self.opening {
            egui::Panel::top("opening").show(ui, |ui| {
                wish = welcome::opening(ui, opening.paths(), &opening.progress()).or(wish.take());
            });
        }
        popups::messages(ui, "window messages", &mut self.notices);
        if self.views.is_some() {
            self.show_views(ui, &mut wish);
        } else {
            egui::CentralPanel::default().show(ui, |ui| {
                let recent = &self.keeper.settings().recent;
                match self.opening.as_ref().and_then(|(opening, ..)| opening.picture()) {
                    Some(picture) => self.first_picture.show(ui, &picture),
                    None => wish = welcome::show(ui, &mut self.path_box, recent).or(wish.take()),
                }
            });
        }
        popups::drop_hint(&ctx);
        self.remember(&ctx);
        match wish {
            Some(Wish::Open(paths)) => self.leave(&ctx, Leaving::Open(paths)),
            Some(Wish::Beside(data)) => self.open_beside(data),
            Some(Wish::Stop) => self.opening = None,
            None => {}
        }
        self.guard_changes(&ctx);
    }
}

impl Drop for PlayerWindow {
    fn drop(&mut self) {
        self.remember_look();
    }
}
