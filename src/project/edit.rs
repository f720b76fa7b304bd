//! Changes of a project as commands that can be undone, independent of any user interface.

use super::{Data, LookSettings, MapTrack, Output, Project, ProjectError};
use crate::camera::Camera;
use crate::optics::OpticsKind;
use crate::playback::Settings;
use crate::timeline::{Key, Keyframed, Transition};
use crate::transfer::{ColorWeighting, Ensemble, Member, RangeMap};
use serde::{Deserialize, Serialize};

/// A change of a project. Indices count from 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Edit {
    /// Shows another dataset or field.
    SetData(Data),
    /// Replaces the look.
    SetLook(Box<LookSettings>),
    /// Replaces the playback settings.
    SetPlayback(Settings),
    /// Replaces the output settings.
    SetOutput(Box<Output>),
    /// Inserts an ensemble.
    InsertEnsemble {
        /// Index of the element.
        index: usize,
        /// The new element.
        ensemble: Ensemble,
    },
    /// Removes an ensemble; refused if a key or the look names it.
    RemoveEnsemble {
        /// Index of the element.
        index: usize,
    },
    /// Renames an ensemble and all references to it.
    RenameEnsemble {
        /// Index of the element.
        index: usize,
        /// The new name.
        name: String,
    },
    /// Changes how an ensemble blends colours.
    SetColors {
        /// Index of the ensemble.
        ensemble: usize,
        /// Weighting of colours.
        colors: ColorWeighting,
    },
    /// Inserts a member into an ensemble.
    InsertMember {
        /// Index of the ensemble.
        ensemble: usize,
        /// Index of the member.
        index: usize,
        /// The new element.
        member: Box<Member>,
    },
    /// Removes a member from an ensemble.
    RemoveMember {
        /// Index of the ensemble.
        ensemble: usize,
        /// Index of the member.
        index: usize,
    },
    /// Replaces a member; references follow its new name.
    SetMember {
        /// Index of the ensemble.
        ensemble: usize,
        /// Index of the member.
        index: usize,
        /// The new member.
        member: Box<Member>,
    },
    /// Moves a member to another index.
    MoveMember {
        /// Index of the ensemble.
        ensemble: usize,
        /// Index before.
        from: usize,
        /// Index afterwards.
        to: usize,
    },
    /// Changes how colours blend between two ensembles on the timeline.
    SetTimelineColors(ColorWeighting),
    /// Changes which ensembles are shown when.
    Ensembles(TrackEdit<String>),
    /// Changes the path of the camera.
    Cameras(TrackEdit<Camera>),
    /// Changes levels of detail.
    Lod(TrackEdit<f64>),
    /// Changes the isovalue of the last surface.
    Isovalue(TrackEdit<f64>),
    /// Changes the opacity of that surface.
    IsoOpacity(TrackEdit<f64>),
    /// Moves the last cut.
    Cut(TrackEdit<f64>),
    /// Changes how segments are integrated over time.
    Optics(TrackEdit<OpticsKind>),
    /// Changes the range maps of a member.
    Maps {
        /// Index of the track.
        track: usize,
        /// Change of its keys.
        edit: TrackEdit<RangeMap>,
    },
    /// Inserts a track of range maps.
    InsertMapTrack {
        /// Index of the element.
        index: usize,
        /// The new element.
        track: MapTrack,
    },
    /// Removes a track of range maps.
    RemoveMapTrack {
        /// Index of the element.
        index: usize,
    },
}

/// A change of the keys of a track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum TrackEdit<T> {
    /// Inserts a key, replacing one at the same time.
    Insert(Key<T>),
    /// Removes a key.
    Remove {
        /// Index of the element.
        index: usize,
    },
    /// Moves a key in time.
    Move {
        /// Index of the element.
        index: usize,
        /// The new time.
        time: f64,
    },
    /// Changes the transition from a key to the next.
    SetTransition {
        /// Index of the element.
        index: usize,
        /// The new transition.
        transition: Transition,
    },
}

impl Edit {
    /// Applies the change; returns its inverse.
    ///
    /// # Errors
    /// If an index is out of range, or the project would no longer be consistent ([`Project::check`]). Nothing has changed then.
    pub fn apply(self, project: &mut Project) -> Result<Edit, ProjectError> {
        let back = self.apply_unchecked(project)?;
        if let Err(error) = project.check() {
            // The inverse restores the state before, which was consistent.
            back.apply_unchecked(project)?;
            return Err(error);
        }
        Ok(back)
    }

    fn apply_unchecked(self, project: &mut Project) -> Result<Edit, ProjectError> {
        let timeline = &mut project.timeline;
        Ok(match self {
            Self::SetData(data) => Self::SetData(std::mem::replace(&mut project.data, data)),
            Self::SetLook(look) => Self::SetLook(Box::new(std::mem::replace(&mut project.look, *look))),
            Self::SetPlayback(settings) => Self::SetPlayback(std::mem::replace(&mut project.playback, settings)),
            Self::SetOutput(output) => Self::SetOutput(Box::new(std::mem::replace(&mut project.output, *output))),
            Self::InsertEnsemble { index, ensemble } => {
                insert(&mut project.ensembles, index, ensemble, "place for an ensemble")?;
                Self::RemoveEnsemble { index }
            }
            Self::RemoveEnsemble { index } => {
                let ensemble = remove(&mut project.ensembles, index, "ensemble")?;
                Self::InsertEnsemble { index, ensemble }
            }
            Self::RenameEnsemble { index, name } => rename_ensemble(project, index, name)?,
            Self::SetColors { ensemble, colors } => {
                let old = std::mem::replace(&mut ensemble_at(project, ensemble)?.colors, colors);
                Self::SetColors { ensemble, colors: old }
            }
            Self::InsertMember { ensemble, index, member } => {
                insert(&mut ensemble_at(project, ensemble)?.members, index, *member, "place for a member")?;
                Self::RemoveMember { ensemble, index }
            }
            Self::RemoveMember { ensemble, index } => {
                let member = Box::new(remove(&mut ensemble_at(project, ensemble)?.members, index, "member")?);
                Self::InsertMember { ensemble, index, member }
            }
            Self::SetMember { ensemble, index, member } => set_member(project, ensemble, index, *member)?,
            Self::MoveMember { ensemble, from, to } => {
                let members = &mut ensemble_at(project, ensemble)?.members;
                if to >= members.len() {
                    return Err(ProjectError::NoElement { what: "place for a member", index: to });
                }
                let member = remove(members, from, "member")?;
                insert(members, to, member, "place for a member")?;
                Self::MoveMember { ensemble, from: to, to: from }
            }
            Self::SetTimelineColors(colors) => Self::SetTimelineColors(std::mem::replace(&mut timeline.colors, colors)),
            Self::Ensembles(edit) => Self::Ensembles(edit.apply(&mut timeline.ensembles)?),
            Self::Cameras(edit) => Self::Cameras(edit.apply(&mut timeline.cameras)?),
            Self::Lod(edit) => Self::Lod(edit.apply(&mut timeline.lod)?),
            Self::Isovalue(edit) => Self::Isovalue(edit.apply(&mut timeline.isovalue)?),
            Self::IsoOpacity(edit) => Self::IsoOpacity(edit.apply(&mut timeline.iso_opacity)?),
            Self::Cut(edit) => Self::Cut(edit.apply(&mut timeline.cut)?),
            Self::Optics(edit) => Self::Optics(edit.apply(&mut timeline.optics)?),
            Self::Maps { track, edit } => {
                let missing = ProjectError::NoElement { what: "track of range maps", index: track };
                let edit = edit.apply(&mut timeline.maps.get_mut(track).ok_or(missing)?.keys)?;
                Self::Maps { track, edit }
            }
            Self::InsertMapTrack { index, track } => {
                insert(&mut timeline.maps, index, track, "place for a track")?;
                Self::RemoveMapTrack { index }
            }
            Self::RemoveMapTrack { index } => {
                let track = remove(&mut timeline.maps, index, "track of range maps")?;
                Self::InsertMapTrack { index, track }
            }
        })
    }
}

impl<T: Clone> TrackEdit<T> {
    /// Applies the change to keys; returns its inverse.
    fn apply(self, keys: &mut Keyframed<T>) -> Result<Self, ProjectError> {
        let missing = |index| ProjectError::NoElement { what: "key", index };
        Ok(match self {
            Self::Insert(key) => match keys.insert(key)? {
                (_, Some(old)) => Self::Insert(old),
                (index, None) => Self::Remove { index },
            },
            Self::Remove { index } => Self::Insert(keys.remove(index).ok_or_else(|| missing(index))?),
            Self::Move { index, time } => {
                let from = keys.keys().get(index).ok_or_else(|| missing(index))?.time;
                Self::Move { index: keys.move_to(index, time)?, time: from }
            }
            Self::SetTransition { index, transition } => {
                let key = keys.keys().get(index).ok_or_else(|| missing(index))?.clone();
                let old = key.transition;
                keys.insert(Key { transition, ..key })?;
                Self::SetTransition { index, transition: old }
            }
        })
    }
}

fn insert<T>(list: &mut Vec<T>, index: usize, element: T, what: &'static str) -> Result<(), ProjectError> {
    if index > list.len() {
        return Err(ProjectError::NoElement { what, index });
    }
    list.insert(index, element);
    Ok(())
}

fn remove<T>(list: &mut Vec<T>, index: usize, what: &'static str) -> Result<T, ProjectError> {
    if index >= list.len() {
        return Err(ProjectError::NoElement { what, index });
    }
    Ok(list.remove(index))
}

fn ensemble_at(project: &mut Project, index: usize) -> Result<&mut Ensemble, ProjectError> {
    project.ensembles.get_mut(index).ok_or(ProjectError::NoElement { what: "ensemble", index })
}

/// Renames an ensemble, in the look and on the timeline too.
fn rename_ensemble(project: &mut Project, index: usize, name: String) -> Result<Edit, ProjectError> {
    if project.ensembles.iter().enumerate().any(|(i, other)| i != index && other.name == name) {
        return Err(ProjectError::NameTaken(name));
    }
    let old = std::mem::replace(&mut ensemble_at(project, index)?.name, name.clone());
    let timeline = &mut project.timeline;
    let keys = timeline.ensembles.values_mut();
    let tracks = timeline.maps.iter_mut().map(|track| &mut track.ensemble);
    for named in keys.chain(tracks).chain(&mut project.look.ensemble).filter(|named| **named == old) {
        named.clone_from(&name);
    }
    Ok(Edit::RenameEnsemble { index, name: old })
}

/// Replaces a member; tracks follow its name.
fn set_member(project: &mut Project, ensemble: usize, index: usize, member: Member) -> Result<Edit, ProjectError> {
    let of = ensemble_at(project, ensemble)?;
    let missing = ProjectError::NoElement { what: "member", index };
    if of.members.iter().enumerate().any(|(i, other)| i != index && other.name == member.name) {
        return Err(ProjectError::MemberTaken(of.name.clone(), member.name));
    }
    let (ensemble_name, name) = (of.name.clone(), member.name.clone());
    let old = std::mem::replace(of.members.get_mut(index).ok_or(missing)?, member);
    for track in &mut project.timeline.maps {
        if track.ensemble == ensemble_name && track.member == old.name {
            track.member.clone_from(&name);
        }
    }
    Ok(Edit::SetMember { ensemble, index, member: Box::new(old) })
}

/// The undo and redo lists.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Inverses of changes, the last one last; those of one gesture together.
    undo: Vec<Vec<Edit>>,
    redo: Vec<Vec<Edit>>,
    /// The gesture of the last change.
    gesture: Option<u64>,
}

impl History {
    /// Applies a change, and empties the redo list.
    ///
    /// # Errors
    /// As [`Edit::apply`].
    pub fn apply(&mut self, edit: Edit, project: &mut Project) -> Result<(), ProjectError> {
        self.apply_in(None, edit, project)
    }

    /// Applies a change that is part of a gesture, such as dragging: all changes of one gesture number are undone together.
    ///
    /// # Errors
    /// As [`Edit::apply`].
    pub fn apply_in(&mut self, gesture: Option<u64>, edit: Edit, project: &mut Project) -> Result<(), ProjectError> {
        let back = edit.apply(project)?;
        self.redo.clear();
        match self.undo.last_mut() {
            Some(last) if gesture.is_some() && self.gesture == gesture => last.push(back),
            _ => self.undo.push(vec![back]),
        }
        self.gesture = gesture;
        Ok(())
    }

    /// Undoes the last change; false if there is none.
    ///
    /// # Errors
    /// If the project has been changed otherwise so that the change cannot be undone; project and history then stay as they are.
    pub fn undo(&mut self, project: &mut Project) -> Result<bool, ProjectError> {
        self.gesture = None;
        turn_back(&mut self.undo, &mut self.redo, project)
    }

    /// Applies the last undone change again; false if there is none.
    ///
    /// # Errors
    /// As [`Self::undo`].
    pub fn redo(&mut self, project: &mut Project) -> Result<bool, ProjectError> {
        self.gesture = None;
        turn_back(&mut self.redo, &mut self.undo, project)
    }

    /// Lengths of the undo and redo lists.
    pub fn lengths(&self) -> (usize, usize) {
        (self.undo.len(), self.redo.len())
    }
}

/// Applies the last changes of one list, from the last to the first, and puts their inverses on the other; false if there are none. All of
/// them or, after an error, none.
fn turn_back(from: &mut Vec<Vec<Edit>>, to: &mut Vec<Vec<Edit>>, project: &mut Project) -> Result<bool, ProjectError> {
    let Some(edits) = from.last() else { return Ok(false) };
    let mut changed = project.clone();
    let back: Result<Vec<Edit>, _> = edits.iter().rev().map(|edit| edit.clone().apply(&mut changed)).collect();
    to.push(back?);
    from.pop();
    *project = changed;
    Ok(true)
}
