//! Changes of a project as commands, independent of any user interface.

use super::{Data, FlowSettings, LookSettings, MapTrack, NamedCamera, Output, Project, ProjectError};
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
    /// Replaces the flow.
    SetFlow(Option<Box<FlowSettings>>),
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
    /// Inserts a camera with a name.
    InsertCamera {
        /// Index of the element.
        index: usize,
        /// The new element.
        camera: NamedCamera,
    },
    /// Removes a camera with a name; refused if the look names it.
    RemoveCamera {
        /// Index of the element.
        index: usize,
    },
    /// Renames a camera, in the look too.
    RenameCamera {
        /// Index of the element.
        index: usize,
        /// The new name.
        name: String,
    },
    /// Replaces the view of a camera with a name.
    SetCamera {
        /// Index of the element.
        index: usize,
        /// The new view.
        camera: Camera,
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
    /// Changes opacities of the flow.
    Flow(TrackEdit<f64>),
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
    /// Applies several changes, one after the other; what they lead to must be consistent, not each of them.
    All(Vec<Edit>),
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
    /// Applies the change.
    ///
    /// # Errors
    /// If an index is out of range, or the project would no longer be consistent ([`Project::check`]). Nothing has changed then.
    pub fn apply(self, project: &mut Project) -> Result<(), ProjectError> {
        let mut changed = project.clone();
        self.apply_unchecked(&mut changed)?;
        changed.check()?;
        *project = changed;
        Ok(())
    }

    fn apply_unchecked(self, project: &mut Project) -> Result<(), ProjectError> {
        let timeline = &mut project.timeline;
        match self {
            Self::SetData(data) => project.data = data,
            Self::SetLook(look) => project.look = *look,
            Self::SetFlow(flow) => project.flow = flow.map(|flow| *flow),
            Self::SetPlayback(settings) => project.playback = settings,
            Self::SetOutput(output) => project.output = *output,
            Self::InsertEnsemble { index, ensemble } => {
                insert(&mut project.ensembles, index, ensemble, "place for an ensemble")?;
            }
            Self::RemoveEnsemble { index } => drop(remove(&mut project.ensembles, index, "ensemble")?),
            Self::RenameEnsemble { index, name } => rename_ensemble(project, index, &name)?,
            Self::SetColors { ensemble, colors } => ensemble_at(project, ensemble)?.colors = colors,
            Self::InsertMember { ensemble, index, member } => {
                insert(&mut ensemble_at(project, ensemble)?.members, index, *member, "place for a member")?;
            }
            Self::RemoveMember { ensemble, index } => {
                remove(&mut ensemble_at(project, ensemble)?.members, index, "member")?;
            }
            Self::SetMember { ensemble, index, member } => set_member(project, ensemble, index, *member)?,
            Self::MoveMember { ensemble, from, to } => {
                let members = &mut ensemble_at(project, ensemble)?.members;
                if to >= members.len() {
                    return Err(ProjectError::NoElement { what: "place for a member", index: to });
                }
                let member = remove(members, from, "member")?;
                insert(members, to, member, "place for a member")?;
            }
            Self::InsertCamera { index, camera } => {
                insert(&mut project.cameras, index, camera, "place for a camera")?;
            }
            Self::RemoveCamera { index } => drop(remove(&mut project.cameras, index, "camera")?),
            Self::RenameCamera { index, name } => {
                let old = std::mem::replace(&mut camera_at(project, index)?.name, name.clone());
                project
                    .look
                    .camera
                    .iter_mut()
                    .filter(|named| named.trim() == old)
                    .for_each(|named| named.clone_from(&name));
            }
            Self::SetCamera { index, camera } => camera_at(project, index)?.camera = camera,
            Self::SetTimelineColors(colors) => timeline.colors = colors,
            Self::Ensembles(edit) => edit.apply(&mut timeline.ensembles)?,
            Self::Cameras(edit) => edit.apply(&mut timeline.cameras)?,
            Self::Lod(edit) => edit.apply(&mut timeline.lod)?,
            Self::Isovalue(edit) => edit.apply(&mut timeline.isovalue)?,
            Self::IsoOpacity(edit) => edit.apply(&mut timeline.iso_opacity)?,
            Self::Cut(edit) => edit.apply(&mut timeline.cut)?,
            Self::Flow(edit) => edit.apply(&mut timeline.flow)?,
            Self::Optics(edit) => edit.apply(&mut timeline.optics)?,
            Self::Maps { track, edit } => {
                let missing = ProjectError::NoElement { what: "track of range maps", index: track };
                edit.apply(&mut timeline.maps.get_mut(track).ok_or(missing)?.keys)?;
            }
            Self::InsertMapTrack { index, track } => {
                insert(&mut timeline.maps, index, track, "place for a track")?;
            }
            Self::RemoveMapTrack { index } => drop(remove(&mut timeline.maps, index, "track of range maps")?),
            Self::All(edits) => edits.into_iter().try_for_each(|edit| edit.apply_unchecked(project))?,
        }
        Ok(())
    }
}

impl<T: Clone> TrackEdit<T> {
    /// Applies the change to keys.
    fn apply(self, keys: &mut Keyframed<T>) -> Result<(), ProjectError> {
        let missing = |index| ProjectError::NoElement { what: "key", index };
        match self {
            Self::Insert(key) => drop(keys.insert(key)?),
            Self::Remove { index } => drop(keys.remove(index).ok_or_else(|| missing(index))?),
            Self::Move { index, time } => {
                keys.keys().get(index).ok_or_else(|| missing(index))?;
                keys.move_to(index, time)?;
            }
            Self::SetTransition { index, transition } => {
                let key = keys.keys().get(index).ok_or_else(|| missing(index))?.clone();
                keys.insert(Key { transition, ..key })?;
            }
        }
        Ok(())
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

fn camera_at(project: &mut Project, index: usize) -> Result<&mut NamedCamera, ProjectError> {
    project.cameras.get_mut(index).ok_or(ProjectError::NoElement { what: "camera", index })
}

/// Renames an ensemble, in the look and on the timeline too.
fn rename_ensemble(project: &mut Project, index: usize, name: &str) -> Result<(), ProjectError> {
    if project.ensembles.iter().enumerate().any(|(i, other)| i != index && other.name == name) {
        return Err(ProjectError::NameTaken(name.to_owned()));
    }
    let old = std::mem::replace(&mut ensemble_at(project, index)?.name, name.to_owned());
    let timeline = &mut project.timeline;
    let keys = timeline.ensembles.values_mut();
    let tracks = timeline.maps.iter_mut().map(|track| &mut track.ensemble);
    for named in keys.chain(tracks).chain(&mut project.look.ensemble).filter(|named| **named == old) {
        name.clone_into(named);
    }
    Ok(())
}

/// Replaces a member; tracks follow its name.
fn set_member(project: &mut Project, ensemble: usize, index: usize, member: Member) -> Result<(), ProjectError> {
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
    Ok(())
}
