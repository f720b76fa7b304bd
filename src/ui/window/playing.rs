//! Plays what was opened: in place of what is there, or beside it.

use super::welcome::Data;
use super::{Dress, Dressed, PlayerWindow, plain};
use crate::ingest::Origin;
use crate::look::{Look, mapped_range};
use crate::pipeline::{Pipeline, Pipelined, Series};
use crate::playback::{Clock, Command, Loop, Player};
use crate::project::Project;
use crate::transfer::RangePolicy;
use crate::ui::exporting::NewPipeline;
use crate::ui::following::Follower;
use crate::ui::opening::{Opened, Opening};
use crate::ui::views::Views;
use crate::ui::{Action, Session, SessionOptions};
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

/// Where what is opened is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// In place of what is there.
    Here,
    /// Beside it.
    Beside,
}

impl PlayerWindow {
    /// Plays an opened series in place of all views.
    pub(super) fn play(&mut self, opened: Opened, dress: &Dress) {
        let (name, path) = (opened.name.clone(), opened.path.clone());
        match self.session_of(opened, dress, None) {
            Ok(mut session) => {
                self.title = Some(format!("{name} - tetreel"));
                if std::mem::take(&mut self.options.plays) {
                    let now = self.started.elapsed();
                    for command in [Command::Loop(Loop::All), Command::Play] {
                        session.act(Action::Play(command), now);
                    }
                }
                self.remember_look();
                let opens = session.project_file().unwrap_or(&path).to_owned();
                self.keeper.settings_mut().remember_file(&opens);
                let last = self.views.replace(Views::of(session, Arc::new(self.waker.wake())));
                self.screens.iter_mut().for_each(super::Screen::forget);
                self.notices.clear();
                // Joins its threads and frees its memory in the background.
                std::thread::spawn(move || drop(last));
                if let Some(path) = self.options.beside.take() {
                    self.open_beside(Data::Files(vec![path]));
                }
            }
            Err(problem) => self.fail(format!("{name}: {problem}")),
        }
    }

    /// Plays an opened series beside the active view.
    pub(super) fn play_beside(&mut self, opened: Opened, dress: &Dress) {
        let name = opened.name.clone();
        let Some(views) = &self.views else { return self.play(opened, dress) };
        match self.session_of(opened, dress, Some(views.active())) {
            Ok(session) => {
                let now = self.started.elapsed();
                // The view that stays is the left one.
                if let Some(views) = &mut self.views {
                    self.screens.swap(0, views.place());
                    self.screens[1].forget();
                    views.put_beside(session, now);
                }
            }
            Err(problem) => self.fail(format!("{name}: {problem}")),
        }
    }

    /// Opens a second view, as [`Place::Beside`].
    pub(super) fn open_beside(&mut self, data: Data) {
        let Some(session) = self.views.as_ref().map(Views::active) else { return };
        let opened = Opened {
            store: session.store().clone(),
            series: session.series().clone(),
            path: session.source().to_owned(),
            name: crate::files::name_of(session.source()),
            origin: Origin::Store,
        };
        let dress = like(session);
        match data {
            Data::Same => self.play_beside(opened, &dress),
            Data::Field(field) => {
                let opening = Opening::start_field(opened, field, Arc::new(self.waker.wake()));
                self.opening = Some((opening, dress, Place::Beside));
            }
            Data::Files(paths) => self.open_at(paths, dress, Place::Beside),
        }
    }

    /// The session of an opened series; beside another one it shares that one's threads.
    fn session_of(&self, opened: Opened, dress: &Dress, beside: Option<&Session>) -> Result<Session, String> {
        let Opened { store, series, path: source, .. } = opened;
        let Dressed { look, camera_is_chosen, project, file } = dress(&series)?;
        let playback = project.as_ref().map_or_else(Default::default, |project| project.playback);
        let follower = self.options.follows.then(|| {
            let wake = Arc::new(self.waker.wake());
            Follower::start(store.clone(), series.clone(), wake)
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
        let pipelined = match beside {
            Some(beside) => beside.player.pipelined().start_beside(pipeline, self.waker.wake()),
            None => Pipelined::start(pipeline, &self.options.threads, self.waker.wake()),
        };
        let pipelined = pipelined.map_err(no_threads)?;
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
        session.use_window_gpu(self.screens[0].context().is_some());
        if let Some(follower) = follower {
            session.grow_with(follower);
        }
        Ok(session)
    }
}

/// The look of a session, for a view beside it: the same colours at the same values, if the field has the same name; else the first look of
/// its series.
fn like(session: &Session) -> Dress {
    let (look, series) = (session.look().clone(), session.series().clone());
    let project = Project::clone(session.project());
    Arc::new(move |other: &Series| {
        let first = plain(other)?;
        if other.field().name != series.field().name {
            return Ok(first);
        }
        let mut project = project.clone();
        let is_same = std::ptr::eq(other, &*series);
        for member in project.ensembles.iter_mut().flat_map(|ensemble| &mut ensemble.members).filter(|_| !is_same) {
            member.range = at_same_values(member.range, &series);
        }
        let look = Look { camera: first.look.camera, ..look.clone() };
        Ok(Dressed { look, project: Some(Arc::new(project)), ..first })
    })
}

/// The policy that gives another series the range of this one at all times. Where each step has a range of its own, so has the other's.
fn at_same_values(policy: RangePolicy, series: &Arc<Series>) -> RangePolicy {
    if policy == RangePolicy::Step {
        return policy;
    }
    match mapped_range(series, &policy, 0.into()) {
        Ok(range) if range.is_log() => RangePolicy::LogManual(range.lo(), range.hi()),
        Ok(range) => RangePolicy::Manual(range.lo(), range.hi()),
        Err(_) => policy,
    }
}

impl PlayerWindow {
    /// Opens files as [`Self::open_files`] does, or a project, at a place.
    pub(super) fn open_at(&mut self, paths: Vec<PathBuf>, dress: Dress, place: Place) {
        match &*paths {
            [path] if crate::project::is_project(path) => self.read_project(path.clone(), place),
            _ => self.open_files(paths, dress, place),
        }
    }
}
