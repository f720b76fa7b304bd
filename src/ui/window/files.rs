//! Opens files and projects in a window, and leaves those that are open.

use super::playing::Place;
use super::unsaved::{Leaving, Unsaved};
use super::{Dress, Dressed, PlayerWindow, ReadProject, plain};
use crate::look::Look;
use crate::pipeline::Series;
use crate::project::is_project;
use crate::ui::opening::{FirstPicture, Opening, OpeningEnd};
use crossbeam::channel::bounded;
use eframe::egui;
use std::path::PathBuf;
use std::sync::Arc;

impl PlayerWindow {
    /// Opens files in the background, while the current series plays on.
    pub(super) fn open_files(&mut self, paths: Vec<PathBuf>, dress: Dress, place: Place) {
        let mut options = self.options.opening.clone();
        if let Some(session) = self.session().filter(|_| place == Place::Beside) {
            options.blocks = Some(session.series().blocks().clone());
        }
        options.first_picture = self.views.is_none().then(|| self.first_picture(dress.clone()));
        // Other files need not have the requested field.
        self.options.opening.field = None;
        let opening = Opening::start(paths, options, Arc::new(self.waker.wake()));
        self.opening = Some((opening, dress, place));
    }

    /// The picture of a source that is shown while it is imported, as large as the window.
    fn first_picture(&self, dress: Dress) -> FirstPicture {
        let size = self.size().map(|side| side.max(1.0) as usize);
        let look = move |series: &Series| {
            let Dressed { look, camera_is_chosen, .. } = dress(series).ok()?;
            let camera = if camera_is_chosen { look.camera } else { look.camera.fit_to_aspect(size[0], size[1]) };
            Some(Look { camera, ..look })
        };
        let background = self.options.background.unwrap_or(self.keeper.settings().background);
        FirstPicture { look: Arc::new(look), size_px: size.into(), background }
    }

    /// Opens what the user names: a project with its look, other files with the look that they had last.
    fn open_wish(&mut self, paths: Vec<PathBuf>) {
        match &*paths {
            [path] if is_project(path) => self.read_project(path.clone(), Place::Here),
            paths if paths.iter().any(|path| is_project(path)) => {
                self.fail("a project is opened alone: drop or name it without other files".to_owned());
            }
            _ => {
                let dress = self.as_last(&paths, Arc::new(plain));
                self.open_files(paths, dress, Place::Here);
            }
        }
    }

    /// Reads a project file in the background.
    pub(super) fn read_project(&mut self, path: PathBuf, place: Place) {
        let (to, from) = bounded(1);
        let (read, wake) = (self.options.projects.clone(), self.waker.wake());
        let thread = std::thread::Builder::new().name("project file".to_owned()).spawn(move || {
            // The window may be closed by then.
            let _ = to.send(read(&path));
            wake();
        });
        match thread {
            Ok(_) => self.reading = Some((from, place)),
            Err(error) => self.fail(format!("the system gives no thread: {error}")),
        }
    }

    /// Opens the source of a project that has been read.
    pub(super) fn finish_reading(&mut self) {
        let read = self.reading.as_ref().and_then(|(reading, place)| Some((reading.try_recv().ok()?, *place)));
        let Some((read, place)) = read else { return };
        self.reading = None;
        match read {
            Ok(ReadProject { source, field, dress }) => {
                self.options.opening.field = field;
                self.open_files(vec![source], dress, place);
            }
            Err(problem) => self.fail(problem),
        }
    }

    /// Plays what has been opened.
    pub(super) fn finish_opening(&mut self) {
        let Some((opening, dress, place)) = &self.opening else { return };
        let (Some(ended), dress, place) = (opening.take(), dress.clone(), *place) else { return };
        self.opening = None;
        let would_lose = place == Place::Here && self.views.as_ref().is_some_and(Unsaved::would_lose);
        let are_discarded = std::mem::take(&mut self.unsaved.are_discarded);
        match ended {
            // Made while it was opened.
            OpeningEnd::Opened(opened) if would_lose && !are_discarded => {
                self.unsaved.ask(Leaving::Play(opened, dress));
            }
            OpeningEnd::Opened(opened) if place == Place::Beside => self.play_beside(*opened, &dress),
            OpeningEnd::Opened(opened) => self.play(*opened, &dress),
            OpeningEnd::Cancelled => {}
            OpeningEnd::Failed(problem) => self.fail(problem),
        }
    }

    /// Leaves the session for what the user wants, unless changes would be lost: these are asked about first.
    pub(super) fn leave(&mut self, ctx: &egui::Context, leaving: Leaving) {
        if !self.is_closing && self.views.as_ref().is_some_and(Unsaved::would_lose) {
            self.unsaved.ask(leaving);
            return;
        }
        self.leave_now(ctx, leaving);
    }

    pub(super) fn leave_now(&mut self, ctx: &egui::Context, leaving: Leaving) {
        match leaving {
            Leaving::Open(paths) => self.open_wish(paths),
            Leaving::Play(opened, dress) => self.play(*opened, &dress),
            Leaving::Close => {
                self.is_closing = true;
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
        }
    }

    /// Keeps the window open while there are unsaved changes, and shows the question about them.
    pub(super) fn guard_changes(&mut self, ctx: &egui::Context) {
        let would_lose = self.views.as_ref().is_some_and(Unsaved::would_lose);
        if would_lose && !self.is_closing && ctx.input(|input| input.viewport().close_requested()) {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.unsaved.ask(Leaving::Close);
        }
        let now = self.started.elapsed();
        let leaving = self.views.as_mut().and_then(|views| self.unsaved.show(ctx, views, now));
        if let Some(leaving) = leaving {
            self.leave_now(ctx, leaving);
        }
    }

    /// Lets the window close without a question, as after an interrupt.
    pub(super) fn close_at_once(&mut self) {
        self.is_closing = true;
    }
}
