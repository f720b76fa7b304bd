//! Applies user actions to a session.

use super::quality::{SETTLE, less_quality, more_quality};
use super::{IMAGE_SCALES, Session, TARGET_FPS};
use crate::camera::{Camera, CameraError};
use crate::files;
use crate::look::{EnsembleChoice, Followed};
use crate::pipeline::FrameTime;
use crate::playback::{Command, Loop, Mode, State, StepRange};
use crate::project::{Data, Edit, FlowSettings, Project, Timeline, is_project};
use crate::transfer::{
    ColorMap, ColorMapEntry, Function, Member, OpacityValues, PositionKind, TransferError, TransferFunction,
    color_maps_to_json,
};
use crate::ui::camera_history::{CameraTurn, Motion, Seen};
use crate::ui::document::Turn;
use crate::ui::{Action, FunctionFile};
use std::path::{Path, PathBuf, absolute};
use std::time::Duration;

/// Factor of a notch of speed: two of them double it.
const SPEED_NOTCH: f64 = std::f64::consts::SQRT_2;

/// Time after an input during which one core is reserved for the window.
const BUSY: Duration = Duration::from_millis(250);

impl Session {
    /// Applies a user action. Changes of what is shown can be undone.
    pub fn act(&mut self, action: Action, now: Duration) {
        // Pointing does not reserve the core.
        if !matches!(action, Action::PointAt(_)) {
            self.busy_until = now.saturating_add(BUSY);
        }
        let is_change = !matches!(action, Action::Undo | Action::Redo);
        let before = self.document.state(&self.look);
        let (seen, is_moving) = (self.seen(), self.moving_until.is_some_and(|until| now < until));
        let motion = self.motion_of(&action);
        self.apply(action, now);
        let is_changed = is_change && self.document.record(before, &self.look, self.gesture);
        if is_changed && self.gesture.is_some() {
            self.move_on(now);
        }
        if let Some(motion) = motion {
            self.cameras.record([seen, self.seen()], motion, is_moving);
        }
    }

    /// What a movement of the camera by an action belongs to; `None` for turns of its history.
    fn motion_of(&self, action: &Action) -> Option<Motion> {
        match (action, self.gesture) {
            (Action::TurnCamera(_), _) => None,
            (_, Some(gesture)) => Some(Motion::Gesture(gesture)),
            (Action::Zoom { .. }, None) => Some(Motion::Wheel),
            _ => Some(Motion::Alone),
        }
    }

    /// What the view looks through.
    fn seen(&self) -> Seen {
        if self.follows_path() { Seen::Path } else { Seen::Through(self.look.camera) }
    }

    fn turn_camera(&mut self, turn: CameraTurn) {
        match self.cameras.turn(turn, self.seen()) {
            None => {}
            Some(Seen::Path) => self.look.followed.camera = true,
            Some(Seen::Through(camera)) => {
                self.look.camera = camera;
                self.leave(|followed| followed.camera = false);
            }
        }
    }

    fn apply(&mut self, action: Action, now: Duration) {
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
            Action::TurnCamera(turn) => self.turn_camera(turn),
            Action::GoToCamera(index) => {
                if let Some(camera) = self.project().cameras.get(index).map(|named| named.camera) {
                    self.change_camera(|_| Ok(camera));
                }
            }
            Action::Ensembles(choice) => self.choose_ensembles(choice),
            Action::CameraPath(follows) => {
                self.look.camera = self.camera();
                self.leave(|followed| followed.camera = follows);
            }
            Action::Field(field) => {
                if field.to_string() != self.series().field().name {
                    self.open_field(field, None);
                }
            }
            Action::Colors(map) => self.apply_colors(map),
            Action::Opacities(points) => {
                let relative = PositionKind::Relative;
                self.set_tf(|tf| TransferFunction::new(tf.color_map().clone(), points, relative, tf.values()));
            }
            Action::LoadFunction { from, colors_only } => self.jobs.read_function(from, colors_only),
            Action::SaveFunction { to, format, may_replace } => self.save_function(to, format, may_replace),
            Action::OpacityKind(kind) => self.look.opacity_kind = kind,
            Action::UnitDistance(distance) => {
                if distance.is_finite() && distance > 0.0 {
                    self.look.lengths.unit_distance = distance;
                }
            }
            Action::Range(range) => self.edit_member(|member| member.range = range),
            Action::Edit(edit) => self.edit(*edit),
            Action::Keys(action) => self.act_on_keys(action, now),
            Action::Undo => self.turn(Turn::Undo),
            Action::Redo => self.turn(Turn::Redo),
            Action::SaveProject { to, may_replace } => self.save_project(to, may_replace),
            Action::Member(index) => self.member = index,
            Action::Background(color) => self.background = color,
            Action::Backend(backend) => self.look.backend = backend,
            Action::Renderer(mode) => self.look.mode = mode,
            Action::Representation(of) => self.look.representation = of,
            Action::Points(style) => {
                if style.check().is_ok() {
                    self.look.points = style;
                }
            }
            Action::Optics(optics) => {
                self.look.optics = optics;
                self.leave(|followed| followed.optics = false);
            }
            Action::Surfaces(surfaces) => {
                self.look.surfaces = *surfaces;
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
            Action::Flow(flow) => self.set_flow(flow.map(|flow| *flow)),
            Action::FlowOpacity(opacity) => self.set_flow_opacity(opacity),
            Action::FlowColors(by) => self.color_flow(by),
            Action::ToggleFlow => self.toggle_flow(),
            Action::NextIcon => self.next_icon(),
            Action::LevelOfDetail(lod) if lod.is_nan() => {}
            Action::LevelOfDetail(lod) => {
                self.look.faces.lod = lod.clamp(0.0, 1.0);
                self.leave(|followed| followed.lod = false);
            }
            Action::Sampling(sampling) => self.look.faces.sampling = sampling,
            Action::TargetRate(Some(fps)) if fps.is_nan() => {}
            Action::TargetRate(fps) => {
                self.target_fps = fps.map(|fps| fps.clamp(*TARGET_FPS.start(), *TARGET_FPS.end()));
            }
            Action::LessQuality => self.target_fps = less_quality(self.target_fps),
            Action::MoreQuality => self.target_fps = more_quality(self.target_fps),
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
            Action::Export(action) => self.export(action),
            Action::Help => self.help_is_open = !self.help_is_open,
            Action::Fullscreen => self.is_fullscreen = !self.is_fullscreen,
            Action::Close => self.close(),
            Action::Revert => self.turn(Turn::Revert),
            Action::View(_) => {}
            Action::Dismiss(index) => {
                if index < self.notices.len() {
                    self.notices.remove(index);
                }
            }
        }
    }

    /// Closes what is open, one after the other.
    fn close(&mut self) {
        if std::mem::take(&mut self.help_is_open) {
            return;
        }
        if self.notices.pop().is_none() {
            self.insight.forget_pick();
        }
    }

    pub(super) fn command(&mut self, command: Command, now: Duration) {
        let before = self.state().frame;
        if let Err(error) = self.player.apply(command, now) {
            self.fail(error.to_string());
        }
        if self.state().frame != before {
            self.turns += 1;
            self.move_on(now);
        }
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
            self.move_on(now);
        }
    }

    /// Something moves until some time after now: frames are drawn at the target rate meanwhile, and in full afterwards.
    fn move_on(&mut self, now: Duration) {
        self.moving_until = Some(now.saturating_add(SETTLE));
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

    /// Changes the transfer function of the edited member, unless that has shapes over a histogram.
    fn set_tf(&mut self, changed: impl FnOnce(&TransferFunction) -> Result<TransferFunction, TransferError>) {
        let Some(tf) = self.function() else { return };
        match changed(tf) {
            Ok(tf) => self.edit_member(|member| member.function = Function::TransferFunction(tf)),
            Err(error) => self.fail(error.to_string()),
        }
    }

    /// Takes over a transfer function that was read, or its colours, as a change of its own.
    pub(super) fn take_function(&mut self, tf: TransferFunction, colors_only: bool) {
        let before = self.document.state(&self.look);
        match self.member() {
            Some(member) if member.space.axes() == 2 => {
                self.fail(format!("'{}' is over two quantities, where a transfer function is over one", member.name));
            }
            _ if colors_only && self.function().is_some() => self.apply_colors(tf.color_map().clone()),
            _ => self.edit_member(|member| member.function = Function::TransferFunction(tf)),
        }
        self.document.record(before, &self.look, None);
    }

    fn apply_colors(&mut self, map: ColorMap) {
        self.set_tf(|tf| TransferFunction::new(map, tf.points().to_vec(), tf.positions(), tf.values()));
    }

    /// Writes the transfer function of the edited member, on another thread.
    fn save_function(&mut self, to: PathBuf, format: FunctionFile, may_replace: bool) {
        let Some(tf) = self.function() else {
            self.fail("shapes are no transfer function: save the project, or turn them into a curve".to_owned());
            return;
        };
        let text = match format {
            FunctionFile::Tetreel => Ok(tf.to_json()),
            FunctionFile::ParaView => paraview_text(tf),
        };
        match text {
            Ok(text) => {
                let to = if to.extension().is_some() { to } else { to.with_extension("json") };
                self.jobs.write_text(text, absolute(&to).unwrap_or(to), may_replace);
            }
            Err(problem) => self.fail(problem.to_owned()),
        }
    }

    /// Changes the edited member.
    pub(super) fn edit_member(&mut self, change: impl FnOnce(&mut Member)) {
        let (Some((ensemble, index)), Some(member)) = (self.edited_member(), self.member()) else { return };
        let mut changed = member.clone();
        change(&mut changed);
        if changed != *member {
            self.edit(Edit::SetMember { ensemble, index, member: Box::new(changed) });
        }
    }

    /// Applies a change of the project, or says why that cannot be.
    pub(super) fn edit(&mut self, edit: Edit) {
        let mut project = Project::clone(self.document.project());
        match edit.apply(&mut project) {
            Ok(()) => {
                // The chosen ensemble may be gone.
                if let EnsembleChoice::One(index) = &mut self.look.followed.ensembles {
                    *index = (*index).min(project.ensembles.len().saturating_sub(1));
                }
                self.document.set_project(project);
            }
            Err(error) => self.fail(error.to_string()),
        }
    }

    /// Writes what is shown to a project file, on another thread.
    fn save_project(&mut self, to: Option<PathBuf>, may_replace: bool) {
        let own = self.document.file().map(Path::to_owned);
        let Some(file) = to.or(own.clone()) else {
            self.fail("the project has no file yet: name one by Save..., above the side panel".to_owned());
            return;
        };
        let file = absolute(&file).unwrap_or(file);
        let file = if is_project(&file) { file } else { file.with_added_extension("toml") };
        let project = self.to_project(&file);
        let state = self.document.state(&self.look);
        let may_replace = may_replace || own.as_ref() == Some(&file);
        self.jobs.write_project(project, file, may_replace, state);
        self.is_saving = true;
    }

    /// What is shown, as a project in this file. Where the timeline has keys it is the timeline's, whatever the user turned to meanwhile.
    pub fn to_project(&self, file: &Path) -> Project {
        let project = Project::clone(self.project());
        let folder = files::parent_of(file);
        // A source beside the file, or below, may move with it.
        let source = self.source.strip_prefix(folder).unwrap_or(&self.source).to_owned();
        let beside = |path: PathBuf| path.strip_prefix(folder).map(Path::to_owned).unwrap_or(path);
        let look = self.look_settings(&project, false);
        // That which is hidden is kept if the timeline has keys of it.
        let hidden = project.flow.filter(|_| !project.timeline.flow.keys().is_empty());
        let flow = self.look.flow.as_ref().map(|flow| FlowSettings::of(flow).with_paths(beside)).or(hidden);
        Project { data: Data { source, ..project.data }, look, flow, playback: self.state().settings, ..project }
    }

    /// Stops following some settings of the project, if it has a timeline.
    pub(super) fn leave(&mut self, change: impl FnOnce(&mut Followed)) {
        if self.project().timeline != Timeline::default() {
            change(&mut self.look.followed);
        }
    }

    /// Chooses ensembles; does nothing if the project has no such ensemble, or no other one.
    fn choose_ensembles(&mut self, choice: EnsembleChoice) {
        let count = self.project().ensembles.len();
        let followed = &mut self.look.followed;
        match choice {
            EnsembleChoice::One(index) if index >= count || count == 1 => {}
            EnsembleChoice::Project => {
                *followed = Followed { camera: followed.camera, ..Followed::default() };
                self.put_cut_back();
            }
            EnsembleChoice::One(_) => followed.ensembles = choice,
        }
    }

    /// Least and greatest value of the field in all steps; `None` if none is finite.
    pub fn range_of_field(&self) -> Option<(f64, f64)> {
        self.series().field().range.map(|[lo, hi]| (f64::from(lo), f64::from(hi)))
    }
}

/// A transfer function as ParaView reads it.
fn paraview_text(tf: &TransferFunction) -> Result<String, &'static str> {
    if tf.positions() == PositionKind::Absolute {
        return Err("its points are at scalars, which ParaView's colour maps do not have: save it as tetreel's");
    }
    if tf.values() == OpacityValues::Extinction {
        return Err("its values are extinctions, which ParaView's opacities are not: save it as tetreel's");
    }
    let entry = ColorMapEntry { map: tf.color_map().clone(), opacity: Some(tf.points().to_vec()) };
    Ok(color_maps_to_json(&[entry]))
}

/// The loop after off, all, range, cyclically; ping-pong has its own key.
fn next_loop(repeat: Loop) -> Loop {
    match repeat {
        Loop::Off => Loop::All,
        Loop::All => Loop::Range,
        Loop::Range | Loop::PingPong => Loop::Off,
    }
}
