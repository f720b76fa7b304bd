//! Changes of a project as commands, which can be taken back: no user interface in here.

use super::{Data, LookSettings, MapTrack, Output, Project, ProjectError};
use crate::camera::Camera;
use crate::optics::OpticsKind;
use crate::playback::Settings;
use crate::timeline::{Key, Keyframed, Transition};
use crate::transfer::{ColorWeighting, Ensemble, Member, RangeMap};
use serde::{Deserialize, Serialize};

/// A change of a project. Places count from 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Edit {
    /// Shows another dataset or field.
    SetData(Data),
    /// Draws it otherwise.
    SetLook(Box<LookSettings>),
    /// Plays it otherwise.
    SetPlayback(Settings),
    /// Writes it otherwise.
    SetOutput(Box<Output>),
    /// Adds an ensemble.
    InsertEnsemble {
        /// Its place.
        index: usize,
        /// What is added.
        ensemble: Ensemble,
    },
    /// Takes an ensemble out. One that a key or the look names cannot be.
    RemoveEnsemble {
        /// Its place.
        index: usize,
    },
    /// Gives an ensemble another name, wherever it is named.
    RenameEnsemble {
        /// Its place.
        index: usize,
        /// The new name.
        name: String,
    },
    /// Blends an ensemble's colours otherwise.
    SetColors {
        /// Place of the ensemble.
        ensemble: usize,
        /// How.
        colors: ColorWeighting,
    },
    /// Adds a member to an ensemble.
    InsertMember {
        /// Place of the ensemble.
        ensemble: usize,
        /// Place in it.
        index: usize,
        /// What is added.
        member: Box<Member>,
    },
    /// Takes a member out of an ensemble.
    RemoveMember {
        /// Place of the ensemble.
        ensemble: usize,
        /// Place in it.
        index: usize,
    },
    /// Puts another member in the place of one; its name is the new one wherever it is named.
    SetMember {
        /// Place of the ensemble.
        ensemble: usize,
        /// Place in it.
        index: usize,
        /// What comes there.
        member: Box<Member>,
    },
    /// Moves a member to another place, which is where it is afterwards.
    MoveMember {
        /// Place of the ensemble.
        ensemble: usize,
        /// Where it is.
        from: usize,
        /// Where it comes.
        to: usize,
    },
    /// Blends colours between two ensembles on the timeline otherwise.
    SetTimelineColors(ColorWeighting),
    /// Changes which ensembles are shown when.
    Ensembles(TrackEdit<String>),
    /// Changes the path of the camera.
    Cameras(TrackEdit<Camera>),
    /// Changes levels of detail.
    Lod(TrackEdit<f64>),
    /// Changes the isovalue of the last surface.
    Isovalue(TrackEdit<f64>),
    /// Changes its opacity.
    IsoOpacity(TrackEdit<f64>),
    /// Moves the last cut.
    Cut(TrackEdit<f64>),
    /// Changes how segments are integrated when.
    Optics(TrackEdit<OpticsKind>),
    /// Changes the range maps of a member.
    Maps {
        /// Place of the track.
        track: usize,
        /// How.
        edit: TrackEdit<RangeMap>,
    },
    /// Adds a track of range maps.
    InsertMapTrack {
        /// Its place.
        index: usize,
        /// What is added.
        track: MapTrack,
    },
    /// Takes a track of range maps out.
    RemoveMapTrack {
        /// Its place.
        index: usize,
    },
}

/// A change of keys.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum TrackEdit<T> {
    /// Adds a key, in place of one at the same time.
    Insert(Key<T>),
    /// Takes a key out.
    Remove {
        /// Its place.
        index: usize,
    },
    /// Moves a key in time.
    Move {
        /// Its place.
        index: usize,
        /// Where to.
        time: f64,
    },
    /// Changes how a key goes over into the next.
    SetTransition {
        /// Its place.
        index: usize,
        /// How.
        transition: Transition,
    },
}

impl Edit {
    /// Applies the change; returns the one that takes it back.
    ///
    /// # Errors
    /// If there is nothing at a place, or the project would no longer hold together ([`Project::check`]). Nothing has changed then.
    pub fn apply(self, project: &mut Project) -> Result<Edit, ProjectError> {
        let back = self.apply_unchecked(project)?;
        if let Err(error) = project.check() {
            // It goes back where it was; that state was sound.
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
    /// Applies the change to keys; returns the one that takes it back.
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

/// Another name for an ensemble, in the look and on the timeline too.
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

/// Another member; tracks follow its name.
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

/// Changes that can be taken back, and those that have been.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// What takes changes back, the last one last; those of one gesture together.
    undo: Vec<Vec<Edit>>,
    redo: Vec<Vec<Edit>>,
    /// The gesture that the last change belongs to.
    gesture: Option<u64>,
}

impl History {
    /// Applies a change. What had been taken back before is forgotten.
    ///
    /// # Errors
    /// As [`Edit::apply`].
    pub fn apply(&mut self, edit: Edit, project: &mut Project) -> Result<(), ProjectError> {
        self.apply_in(None, edit, project)
    }

    /// Applies a change that is a part of a gesture, such as dragging: all changes of one number are taken back together.
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

    /// Takes the last change back; false if there is none.
    ///
    /// # Errors
    /// If the project has been changed by others so that it cannot be taken back; it stays as it is then, and so does what could be
    /// taken back.
    pub fn undo(&mut self, project: &mut Project) -> Result<bool, ProjectError> {
        self.gesture = None;
        turn_back(&mut self.undo, &mut self.redo, project)
    }

    /// Applies what was taken back last; false if there is nothing.
    ///
    /// # Errors
    /// As [`Self::undo`].
    pub fn redo(&mut self, project: &mut Project) -> Result<bool, ProjectError> {
        self.gesture = None;
        turn_back(&mut self.redo, &mut self.undo, project)
    }

    /// How many changes can be taken back, and applied again.
    pub fn lengths(&self) -> (usize, usize) {
        (self.undo.len(), self.redo.len())
    }
}

/// Applies the last changes of one list, from the last to the first, and puts what takes them back on the other; false if there are
/// none. All of them or, after a fault, none.
fn turn_back(from: &mut Vec<Vec<Edit>>, to: &mut Vec<Vec<Edit>>, project: &mut Project) -> Result<bool, ProjectError> {
    let Some(edits) = from.last() else { return Ok(false) };
    let mut changed = project.clone();
    let back: Result<Vec<Edit>, _> = edits.iter().rev().map(|edit| edit.clone().apply(&mut changed)).collect();
    to.push(back?);
    from.pop();
    *project = changed;
    Ok(true)
}
