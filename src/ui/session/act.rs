//! Applies user actions to a session.

use super::quality::SETTLE;
use super::{IMAGE_SCALES, Session, TARGET_FPS};
use crate::camera::{Camera, CameraError};
use crate::look::{EnsembleChoice, Followed};
use crate::pipeline::FrameTime;
use crate::playback::{Command, Loop, Mode, State, StepRange};
use crate::transfer::{PositionKind, TransferError, TransferFunction};
use crate::ui::Action;
use std::time::Duration;

/// Factor of a notch of speed: two of them double it.
const SPEED_NOTCH: f64 = std::f64::consts::SQRT_2;

/// Time after an input during which one core is reserved for the window.
const BUSY: Duration = Duration::from_millis(250);

impl Session {
    /// Applies a user action.
    pub fn act(&mut self, action: Action, now: Duration) {
        // Pointing does not reserve the core.
        if !matches!(action, Action::PointAt(_)) {
            self.busy_until = now.saturating_add(BUSY);
        }
        let state = self.state();
        match action {
            Action::Play(command) => self.command(command, now),
            Action::Faster => self.change_speed(state.speed, SPEED_NOTCH, now),
            Action::Slower => self.change_speed(state.speed, 1.0 / SPEED_NOTCH, now),
            Action::NextLoop => self.command(Command::Loop(next_loop(state.settings.repeat)), now),
            Action::TogglePingPong => {
                let is_on = state.settings.repeat == Loop::PingPong;
                self.command(Command::Loop(if is_on { Loop::Off } else { Loop::PingPong }), now);
            }
            Action::ToggleDropping => {
                let drops = state.settings.mode == Mode::RealTime;
                self.command(Command::Mode(if drops { Mode::EveryStep } else { Mode::RealTime }), now);
            }
            Action::RangeFromHere => self.change_range(&state, |step, range| (step, range.b.max(step)), now),
            Action::RangeToHere => self.change_range(&state, |step, range| (range.a.min(step), step), now),
            Action::Orbit(by) => {
                // A drag over the height of the image is half a turn; the mesh follows the mouse.
                self.move_camera(|camera| camera.orbit(-180.0 * by.x, -180.0 * by.y), now);
            }
            Action::Pan(by) => self.move_camera(|camera| camera.pan(by), now),
            Action::Zoom { factor, cursor } => self.move_camera(|camera| camera.zoom_to_cursor(factor, cursor), now),
            Action::ResetView => {
                self.look.camera = self.home_camera();
                self.leave(|followed| followed.camera = false);
            }
            Action::ViewAlong { axis, from_positive } => {
                self.change_camera(|camera| camera.along(axis, from_positive));
            }
            Action::OtherProjection => self.change_camera(Camera::with_other_projection),
            Action::Ensembles(choice) => self.choose_ensembles(choice),
            Action::CameraPath(follows) => {
                self.look.camera = self.camera();
                self.leave(|followed| followed.camera = follows);
            }
            Action::Field(field) => {
                if !self.opens_field && field.to_string() != self.series().field().name {
                    self.opens_field = true;
                    let series = self.series().clone();
                    self.jobs.open(&self.store, &series, field);
                }
            }
            Action::Colors(map) => {
                let tf = &self.look.tf;
                self.set_tf(TransferFunction::new(map, tf.points().to_vec(), tf.positions(), tf.values()));
            }
            Action::Opacities(points) => {
                let tf = &self.look.tf;
                let map = tf.color_map().clone();
                self.set_tf(TransferFunction::new(map, points, PositionKind::Relative, tf.values()));
            }
            Action::Range(range) => {
                self.look.range = range;
                self.leave(|followed| followed.ensembles = EnsembleChoice::Own);
            }
            Action::Background(color) => self.background = color,
            Action::Backend(backend) => self.look.backend = backend,
            Action::Renderer(mode) => self.look.mode = mode,
            Action::Optics(optics) => {
                self.look.optics = optics;
                self.leave(|followed| followed.optics = false);
            }
            Action::Surfaces(surfaces) => {
                self.look.surfaces = surfaces;
                self.leave(|followed| followed.surfaces = false);
            }
            Action::NextShown => {
                if let Some((lo, hi)) = self.range_of_field() {
                    self.look.surfaces.show_next(0.5 * lo + 0.5 * hi);
                }
            }
            Action::MoveIsovalue(hundredths) => {
                if let Some((lo, hi)) = self.range_of_field() {
                    self.look.surfaces = self.shown_surfaces();
                    self.look.surfaces.move_isovalue(0.01 * hundredths * (hi - lo), (lo, hi));
                    self.leave(|followed| followed.surfaces = false);
                }
            }
            Action::MoveCut(by) => {
                self.look.surfaces = self.shown_surfaces();
                let camera = self.camera();
                if let Some(cut) = self.look.surfaces.cuts.last_mut() {
                    *cut = cut.moved(camera.length_along(cut.normal.into(), by));
                }
                self.leave(|followed| followed.surfaces = false);
            }
            Action::LevelOfDetail(lod) if lod.is_nan() => {}
            Action::LevelOfDetail(lod) => {
                self.look.faces.lod = lod.clamp(0.0, 1.0);
                self.leave(|followed| followed.lod = false);
            }
            Action::TargetRate(Some(fps)) if fps.is_nan() => {}
            Action::TargetRate(fps) => {
                self.target_fps = fps.map(|fps| fps.clamp(*TARGET_FPS.start(), *TARGET_FPS.end()));
            }
            Action::GiveUp(family) => self.family = family,
            Action::ImageScale(scale) => {
                self.image_scale = scale.clamp(*IMAGE_SCALES.start(), *IMAGE_SCALES.end());
            }
            Action::PointAt(place) => {
                let series = self.series().clone();
                self.insight.point_at(place, &series, self.shown.as_ref().map(|shown| &shown.request));
            }
            Action::Pick => self.insight.pick(),
            Action::ForgetPick => self.insight.forget_pick(),
            Action::Screenshot => self.wants_screenshot = true,
            Action::Help => self.help_is_open = !self.help_is_open,
            Action::Dismiss(index) => {
                if index < self.notices.len() {
                    self.notices.remove(index);
                }
            }
        }
    }

    fn command(&mut self, command: Command, now: Duration) {
        let before = self.state().frame;
        if let Err(error) = self.player.apply(command, now) {
            self.fail(error.to_string());
        }
        self.turns += u64::from(self.state().frame != before);
    }

    fn change_speed(&mut self, speed: Option<f64>, factor: f64, now: Duration) {
        // The mode as fast as possible has no speed.
        if let Some(speed) = speed {
            self.command(Command::Speed(speed * factor), now);
        }
    }

    fn change_range(&mut self, state: &State, change: impl Fn(usize, StepRange) -> (usize, usize), now: Duration) {
        let Some(step) = state.frame.map(FrameTime::step) else { return };
        let range = state.settings.range.unwrap_or(StepRange { a: 0, b: state.steps.saturating_sub(1) });
        let (a, b) = change(step, range);
        self.command(Command::Range(Some(StepRange { a, b })), now);
    }

    /// Moves the camera; a lower quality is used meanwhile if frames take too long. At the limits of coordinates the camera stays.
    fn move_camera(&mut self, moved: impl FnOnce(&Camera) -> Result<Camera, CameraError>, now: Duration) {
        if let Ok(camera) = moved(&self.camera()) {
            self.look.camera = camera;
            self.leave(|followed| followed.camera = false);
            self.moving_until = Some(now.saturating_add(SETTLE));
        }
    }

    fn change_camera(&mut self, changed: impl FnOnce(&Camera) -> Result<Camera, CameraError>) {
        match changed(&self.camera()) {
            Ok(camera) => {
                self.look.camera = camera;
                self.leave(|followed| followed.camera = false);
            }
            Err(error) => self.fail(format!("{error}; R shows the whole mesh again")),
        }
    }

    fn set_tf(&mut self, tf: Result<TransferFunction, TransferError>) {
        match tf {
            Ok(tf) => {
                self.look.tf = tf;
                self.leave(|followed| followed.ensembles = EnsembleChoice::Own);
            }
            Err(error) => self.fail(error.to_string()),
        }
    }

    /// Stops following some settings of the project, if there is one.
    fn leave(&mut self, change: impl FnOnce(&mut Followed)) {
        if self.project().is_some() {
            change(&mut self.look.followed);
        }
    }

    /// Chooses ensembles; does nothing if the project has no such ensemble.
    fn choose_ensembles(&mut self, choice: EnsembleChoice) {
        let count = self.project().map_or(0, |project| project.ensembles.len());
        let followed = &mut self.look.followed;
        match choice {
            EnsembleChoice::One(index) if index >= count => {}
            EnsembleChoice::Project => *followed = Followed { camera: followed.camera, ..Followed::default() },
            EnsembleChoice::One(_) | EnsembleChoice::Own => followed.ensembles = choice,
        }
    }

    /// Least and greatest value of the field in all steps; `None` if none is finite.
    pub fn range_of_field(&self) -> Option<(f64, f64)> {
        self.series().field().range.map(|[lo, hi]| (f64::from(lo), f64::from(hi)))
    }
}

/// The loop after off, all, range, cyclically; ping-pong has its own key.
fn next_loop(repeat: Loop) -> Loop {
    match repeat {
        Loop::Off => Loop::All,
        Loop::All => Loop::Range,
        Loop::Range | Loop::PingPong => Loop::Off,
    }
}
