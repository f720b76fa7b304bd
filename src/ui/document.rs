//! What a window shows, as a project, and the way back from changes.
//!
//! A window always shows a project. One that was opened without a file has an ensemble of one member: the look's transfer function. Every
//! change is a new state; the states before it are kept whole, so that undoing gives back exactly what was there. The device and
//! the playback are no part of a state: they stay as they are. The camera has a history of its own (`camera_history`).

use crate::look::{EnsembleChoice, FlowLook, Followed, Look};
use crate::optics::OpticsKind;
use crate::pipeline::{FaceDetail, RenderMode, SurfaceLook};
use crate::project::{Data, Project};
use crate::render::points::PointStyle;
use crate::timeline::At;
use crate::transfer::{Ensemble, Function, Lengths, Member, OpacityKind};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest number of states to go back to.
const KEPT: usize = 1000;

/// Names of the ensemble and the member that a look without a project becomes.
const OWN: (&str, &str) = ("look", "colours");

/// What undoing brings back.
#[derive(Clone, Debug)]
pub(super) struct State {
    project: Arc<Project>,
    mode: RenderMode,
    faces: FaceDetail,
    points: PointStyle,
    optics: OpticsKind,
    opacity_kind: OpacityKind,
    lengths: Lengths,
    surfaces: SurfaceLook,
    flow: Option<FlowLook>,
    followed: Followed,
}

impl State {
    /// Copies the state to a look, which keeps its camera and its device.
    fn restore(self, look: &mut Look) {
        let Self { mode, faces, points, optics, opacity_kind, lengths, surfaces, flow, followed, .. } = self;
        let followed = Followed { camera: look.followed.camera, ..followed };
        *look = Look { mode, faces, points, optics, opacity_kind, lengths, surfaces, flow, followed, ..look.clone() };
    }

    fn is_same(&self, other: &Self) -> bool {
        let key = |state: &Self| {
            let Self { mode, faces, points, optics, opacity_kind, lengths, followed, .. } = *state;
            (mode, faces, points, optics, opacity_kind, lengths, Followed { camera: true, ..followed })
        };
        let is_same_project = Arc::ptr_eq(&self.project, &other.project) || self.project == other.project;
        is_same_project && key(self) == key(other) && self.surfaces == other.surfaces && self.flow == other.flow
    }
}

/// A way to another state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// Back to the state before the last change.
    Undo,
    /// On to the state that was undone last.
    Redo,
    /// To the state in the file, or with which the window was opened.
    Revert,
}

/// The project of a window, and its earlier states.
#[derive(Debug)]
pub(super) struct Document {
    project: Arc<Project>,
    /// States before changes, the last one last.
    undo: VecDeque<State>,
    /// States that were undone, the last one last.
    redo: Vec<State>,
    /// Number of the gesture of the last change.
    gesture: Option<u64>,
    /// Whether a project was opened, and not a look alone.
    is_of_file: bool,
    /// The project file; `None`: not saved yet.
    file: Option<PathBuf>,
    /// The state that is in the file, or with which the window was opened.
    saved: State,
}

impl Document {
    /// The document of a window: a project with its file, or a project of this data with the look's transfer function.
    pub(super) fn new(opened: Option<(Arc<Project>, Option<PathBuf>)>, look: &Look, data: Data) -> Self {
        let is_of_file = opened.is_some();
        let (project, file) = opened.unwrap_or_else(|| (Arc::new(Project::new(data)), None));
        let project = if project.ensembles.is_empty() { Arc::new(with_own(&project, look)) } else { project };
        let saved = state_of(&project, look);
        Self { project, undo: VecDeque::new(), redo: Vec::new(), gesture: None, is_of_file, file, saved }
    }

    /// The project that is shown.
    pub(super) fn project(&self) -> &Arc<Project> {
        &self.project
    }

    /// The state with this look.
    pub(super) fn state(&self, look: &Look) -> State {
        state_of(&self.project, look)
    }

    /// Replaces the project; [`Self::record`] makes it a change that can be undone.
    pub(super) fn set_project(&mut self, project: Project) {
        self.project = Arc::new(project);
    }

    /// Records that there was a change since `before`, and returns whether there was one. Changes of one gesture, such as a drag, are undone
    /// together.
    pub(super) fn record(&mut self, before: State, look: &Look, gesture: Option<u64>) -> bool {
        if before.is_same(&self.state(look)) {
            return false;
        }
        self.redo.clear();
        if gesture.is_none() || self.gesture != gesture {
            if self.undo.len() == KEPT {
                self.undo.pop_front();
            }
            self.undo.push_back(before);
        }
        self.gesture = gesture;
        true
    }

    /// The project of the state that a turn leads to; `None`: there is none.
    pub(super) fn project_after(&self, turn: Turn) -> Option<&Project> {
        let state = match turn {
            Turn::Undo => self.undo.back(),
            Turn::Redo => self.redo.last(),
            Turn::Revert => Some(&self.saved),
        };
        state.map(|state| &*state.project)
    }

    /// Turns to another state, if there is one; of [`Turn::Revert`], [`Self::record`] makes a change that can be undone.
    pub(super) fn turn(&mut self, turn: Turn, look: &mut Look) {
        match turn {
            Turn::Undo => self.undo(look),
            Turn::Redo => self.redo(look),
            Turn::Revert => self.revert(look),
        }
    }

    /// Returns to the state before the last change, if there is one.
    fn undo(&mut self, look: &mut Look) {
        if let Some(before) = self.undo.pop_back() {
            self.redo.push(self.state(look));
            self.turn_to(before, look);
        }
    }

    /// Returns to the state that was undone last, if there is one.
    fn redo(&mut self, look: &mut Look) {
        if let Some(after) = self.redo.pop() {
            self.undo.push_back(self.state(look));
            self.turn_to(after, look);
        }
    }

    /// Returns to the state of [`Self::is_changed`].
    fn revert(&mut self, look: &mut Look) {
        let saved = self.saved.clone();
        self.project = saved.project.clone();
        saved.restore(look);
    }

    fn turn_to(&mut self, state: State, look: &mut Look) {
        self.gesture = None;
        self.project = state.project.clone();
        state.restore(look);
    }

    /// Numbers of changes that can be undone and done again.
    pub(super) fn changes(&self) -> (usize, usize) {
        (self.undo.len(), self.redo.len())
    }

    /// Whether the state differs from that in the file, or from that with which the window was opened.
    pub(super) fn is_changed(&self, look: &Look) -> bool {
        !self.saved.is_same(&self.state(look))
    }

    /// Whether a project was opened, and not a look alone.
    pub(super) fn is_of_file(&self) -> bool {
        self.is_of_file
    }

    /// The project file; `None`: not saved yet.
    pub(super) fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    /// Names the file that has this state.
    pub(super) fn set_file(&mut self, file: PathBuf, saved: State) {
        (self.file, self.saved) = (Some(file), saved);
    }

    /// Index of the ensemble that is edited: the one chosen, or, on the timeline at a time, the one that weighs more.
    pub(super) fn edited(&self, choice: EnsembleChoice, at: Option<f64>) -> usize {
        let project = &self.project;
        let name = match choice {
            EnsembleChoice::One(index) => return index.min(project.ensembles.len().saturating_sub(1)),
            EnsembleChoice::Project => at.and_then(|at| project.timeline.ensembles.at(at)).map(At::nearer),
        };
        let name = name.or_else(|| project.shown_without_keys().map(|ensemble| &ensemble.name));
        project.ensembles.iter().position(|ensemble| Some(&ensemble.name) == name).unwrap_or(0)
    }
}

fn state_of(project: &Arc<Project>, look: &Look) -> State {
    let Look { mode, faces, points, optics, opacity_kind, lengths, followed, .. } = *look;
    let (project, surfaces, flow) = (project.clone(), look.surfaces.clone(), look.flow.clone());
    State { project, mode, faces, points, optics, opacity_kind, lengths, surfaces, flow, followed }
}

/// A project without ensembles, with the transfer function of a look.
fn with_own(project: &Project, look: &Look) -> Project {
    let (name, member) = OWN;
    let member = Member { range: look.range, ..Member::new(member, Function::TransferFunction(look.tf.clone())) };
    let ensemble = Ensemble { name: name.to_owned(), members: vec![member], ..Ensemble::default() };
    Project { ensembles: vec![ensemble], ..project.clone() }
}
