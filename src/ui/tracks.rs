//! The tracks of the timeline, seen alike: their keys, and changes of these.
//!
//! Where keys are drawn, the axis is that of the steps: a time between two steps has a place between them, in proportion.

use crate::camera::Camera;
use crate::optics::OpticsKind;
use crate::project::{Edit, MapTrack, Project, TrackEdit};
use crate::timeline::{Key, Keyframed, Transition};
use crate::transfer::RangeMap;

/// A track of the timeline. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Track {
    /// Which ensembles are shown.
    Ensembles,
    /// The range map of a member.
    Map {
        /// Index of the ensemble.
        ensemble: usize,
        /// Index of its member.
        member: usize,
    },
    /// The path of the camera.
    Cameras,
    /// Levels of detail.
    Lod,
    /// How segments are integrated.
    Optics,
    /// The isovalue of the last surface.
    Isovalue,
    /// The opacity of that surface.
    IsoOpacity,
    /// The shift of the last cut along its normal.
    Cut,
    /// The opacity of the flow.
    Flow,
}

/// The value of a key.
#[derive(Clone, Debug, PartialEq)]
pub enum KeyValue {
    /// Name of an ensemble.
    Ensemble(String),
    /// A range map.
    Map(RangeMap),
    /// A view.
    Camera(Camera),
    /// A level of detail, an isovalue, an opacity, or a shift.
    Number(f64),
    /// How segments are integrated.
    Optics(OpticsKind),
}

/// A key of any track.
pub type TrackKey = Key<KeyValue>;

/// What the user does to keys. Most actions are about the selected key, and do nothing if there is none.
#[derive(Clone, Debug, PartialEq)]
pub enum KeyAction {
    /// Selects a key of this index, and goes to its time.
    Select(Track, usize),
    /// Selects none.
    Deselect,
    /// Inserts what is shown, at the moment shown.
    Add(Track),
    /// Moves the key in time, between its neighbours.
    Move {
        /// The time.
        time: f64,
        /// Whether it is that of the nearest step.
        snaps: bool,
    },
    /// Changes the value.
    SetValue(KeyValue),
    /// Gives the key the value that is shown.
    TakeShown,
    /// Changes the transition to the next key.
    SetTransition(Transition),
    /// Removes the key.
    Remove,
    /// Keeps a copy of the key.
    Copy,
    /// Inserts the copy at the moment shown.
    Paste,
}

/// The selected key, and the copied one.
#[derive(Clone, Debug, Default)]
pub(super) struct KeyChoice {
    pub(super) selected: Option<(Track, usize)>,
    pub(super) copied: Option<(Track, TrackKey)>,
}

impl Track {
    /// The tracks that a project may have, those of range maps for its members with keys and for this one.
    pub fn offered(project: &Project, edited: Option<(usize, usize)>) -> Vec<Self> {
        let mut maps: Vec<Self> =
            project.timeline.maps.iter().filter_map(|track| Self::of_map(project, track)).collect();
        let edited = edited.map(|(ensemble, member)| Self::Map { ensemble, member });
        maps.extend(edited.filter(|edited| !maps.contains(edited)));
        let others = [Self::Cameras, Self::Lod, Self::Optics, Self::Isovalue, Self::IsoOpacity, Self::Cut, Self::Flow];
        std::iter::once(Self::Ensembles).chain(maps).chain(others).collect()
    }

    /// The tracks of a project that have keys.
    pub fn with_keys(project: &Project) -> Vec<Self> {
        let all = Self::offered(project, None).into_iter();
        all.filter(|track| !track.keys(project).is_empty()).collect()
    }

    fn of_map(project: &Project, track: &MapTrack) -> Option<Self> {
        let ensemble = project.ensembles.iter().position(|ensemble| ensemble.name == track.ensemble)?;
        let members = &project.ensembles.get(ensemble)?.members;
        let member = members.iter().position(|member| member.name == track.member)?;
        Some(Self::Map { ensemble, member })
    }

    /// Name of the track.
    pub fn name(self, project: &Project) -> String {
        match self {
            Self::Ensembles => "ensemble".to_owned(),
            Self::Map { ensemble, member } => {
                let (ensemble, member) = names_of(project, ensemble, member).unwrap_or_default();
                if project.ensembles.len() > 1 {
                    format!("range map of {member}, {ensemble}")
                } else {
                    format!("range map of {member}")
                }
            }
            Self::Cameras => "camera".to_owned(),
            Self::Lod => "level of detail".to_owned(),
            Self::Optics => "optics".to_owned(),
            Self::Isovalue => "isovalue".to_owned(),
            Self::IsoOpacity => "iso opacity".to_owned(),
            Self::Cut => "cut".to_owned(),
            Self::Flow => "flow opacity".to_owned(),
        }
    }

    /// The keys, sorted by time.
    pub fn keys(self, project: &Project) -> Vec<TrackKey> {
        let timeline = &project.timeline;
        let numbers = |track: &Keyframed<f64>| all(track, |number| KeyValue::Number(*number));
        match self {
            Self::Ensembles => all(&timeline.ensembles, |name| KeyValue::Ensemble(name.clone())),
            Self::Map { ensemble, member } => map_track(project, ensemble, member)
                .map_or_else(Vec::new, |(_, track)| all(&track.keys, |map| KeyValue::Map(map.clone()))),
            Self::Cameras => all(&timeline.cameras, |camera| KeyValue::Camera(*camera)),
            Self::Lod => numbers(&timeline.lod),
            Self::Optics => all(&timeline.optics, |optics| KeyValue::Optics(*optics)),
            Self::Isovalue => numbers(&timeline.isovalue),
            Self::IsoOpacity => numbers(&timeline.iso_opacity),
            Self::Cut => numbers(&timeline.cut),
            Self::Flow => numbers(&timeline.flow),
        }
    }

    /// The value at a time; of ensembles the one that weighs more. `None` without keys, or where two cameras have no view in between.
    pub fn value_at(self, project: &Project, time: f64) -> Option<KeyValue> {
        let timeline = &project.timeline;
        let number = |track: &Keyframed<f64>| track.number(time).map(KeyValue::Number);
        match self {
            Self::Ensembles => timeline.ensembles.at(time).map(|at| KeyValue::Ensemble(at.nearer().clone())),
            Self::Map { ensemble, member } => {
                map_track(project, ensemble, member).and_then(|(_, track)| track.keys.map(time)).map(KeyValue::Map)
            }
            Self::Cameras => timeline.camera(time).and_then(Result::ok).map(KeyValue::Camera),
            Self::Lod => number(&timeline.lod),
            Self::Optics => timeline.optics(time).map(KeyValue::Optics),
            Self::Isovalue => number(&timeline.isovalue),
            Self::IsoOpacity => number(&timeline.iso_opacity),
            Self::Cut => number(&timeline.cut),
            Self::Flow => number(&timeline.flow),
        }
    }

    /// The edit that changes keys; `None` if a value is of another kind of track, or its member is missing. The first key of a range map
    /// brings its track, the last one takes it along.
    pub fn edit(self, project: &Project, edit: TrackEdit<KeyValue>) -> Option<Edit> {
        let number = |edit| typed(edit, |value| if let KeyValue::Number(number) = value { Some(number) } else { None });
        Some(match self {
            Self::Ensembles => Edit::Ensembles(typed(edit, |value| match value {
                KeyValue::Ensemble(name) => Some(name),
                _ => None,
            })?),
            Self::Map { ensemble, member } => {
                let edit = typed(edit, |value| if let KeyValue::Map(map) = value { Some(map) } else { None })?;
                map_edit(project, (ensemble, member), edit)?
            }
            Self::Cameras => Edit::Cameras(typed(edit, |value| match value {
                KeyValue::Camera(camera) => Some(camera),
                _ => None,
            })?),
            Self::Optics => Edit::Optics(typed(edit, |value| match value {
                KeyValue::Optics(optics) => Some(optics),
                _ => None,
            })?),
            Self::Lod => Edit::Lod(number(edit)?),
            Self::Isovalue => Edit::Isovalue(number(edit)?),
            Self::IsoOpacity => Edit::IsoOpacity(number(edit)?),
            Self::Cut => Edit::Cut(number(edit)?),
            Self::Flow => Edit::Flow(number(edit)?),
        })
    }

    /// The edit that inserts a key; one at the same time is replaced, and keeps its transition.
    pub fn insert(self, project: &Project, key: TrackKey) -> Option<Edit> {
        let same = self.keys(project).into_iter().find(|other| other.time == key.time);
        let transition = same.map_or(key.transition, |same| same.transition);
        self.edit(project, TrackEdit::Insert(Key { transition, ..key }))
    }

    /// The time nearest to `to` that a key may have: it does not pass its neighbours, and keeps a ten-thousandth of the series away from
    /// them. With `snaps` it is that of a step. `None` if there is none.
    pub fn free_time(self, project: &Project, index: usize, times: &[f64], to: f64, snaps: bool) -> Option<f64> {
        let keys = self.keys(project);
        let (first, last) = (times.first()?, times.last()?);
        let gap = GAP * (0.5 * last - 0.5 * first);
        let beside = |at: Option<usize>| at.and_then(|at| keys.get(at)).map(|key| key.time);
        let low = beside(index.checked_sub(1)).map_or(f64::MIN, |time| (time + gap).max(time.next_up()));
        let high = beside(index.checked_add(1)).map_or(f64::MAX, |time| (time - gap).min(time.next_down()));
        if to.is_nan() || low > high {
            return None;
        }
        let to = to.clamp(low, high);
        if !snaps {
            return Some(to);
        }
        let from = times.partition_point(|time| *time < low);
        let steps = times.get(from..times.partition_point(|time| *time <= high))?;
        let after = steps.partition_point(|time| *time < to);
        let around = [after.checked_sub(1), Some(after)].into_iter().flatten().filter_map(|at| steps.get(at).copied());
        around.min_by(|a, b| (0.5 * a - 0.5 * to).abs().total_cmp(&(0.5 * b - 0.5 * to).abs()))
    }
}

/// Least distance of neighbours after a move, as a share of half the series.
const GAP: f64 = 2e-4;

fn all<T>(track: &Keyframed<T>, value: impl Fn(&T) -> KeyValue) -> Vec<TrackKey> {
    let key = |key: &Key<T>| Key { time: key.time, transition: key.transition, value: value(&key.value) };
    track.keys().iter().map(key).collect()
}

fn names_of(project: &Project, ensemble: usize, member: usize) -> Option<(&str, &str)> {
    let ensemble = project.ensembles.get(ensemble)?;
    Some((ensemble.name.as_str(), ensemble.members.get(member)?.name.as_str()))
}

/// The track of a member's range maps, with its index.
pub(super) fn map_track(project: &Project, ensemble: usize, member: usize) -> Option<(usize, &MapTrack)> {
    let names = names_of(project, ensemble, member)?;
    let mut tracks = project.timeline.maps.iter().enumerate();
    tracks.find(|(_, track)| (track.ensemble.as_str(), track.member.as_str()) == names)
}

fn map_edit(project: &Project, (ensemble, member): (usize, usize), edit: TrackEdit<RangeMap>) -> Option<Edit> {
    Some(match (map_track(project, ensemble, member), edit) {
        (Some((index, track)), TrackEdit::Remove { index: 0 }) if track.keys.keys().len() == 1 => {
            Edit::RemoveMapTrack { index }
        }
        (Some((track, _)), edit) => Edit::Maps { track, edit },
        (None, TrackEdit::Insert(key)) => {
            let (ensemble, member) = names_of(project, ensemble, member)?;
            let keys = vec![key].try_into().ok()?;
            let track = MapTrack { ensemble: ensemble.to_owned(), member: member.to_owned(), keys };
            Edit::InsertMapTrack { index: project.timeline.maps.len(), track }
        }
        (None, _) => return None,
    })
}

/// An edit of keys with values of one type.
fn typed<T>(edit: TrackEdit<KeyValue>, value: impl FnOnce(KeyValue) -> Option<T>) -> Option<TrackEdit<T>> {
    Some(match edit {
        TrackEdit::Insert(key) => {
            let Key { time, transition, value: of } = key;
            TrackEdit::Insert(Key { time, transition, value: value(of)? })
        }
        TrackEdit::Remove { index } => TrackEdit::Remove { index },
        TrackEdit::Move { index, time } => TrackEdit::Move { index, time },
        TrackEdit::SetTransition { index, transition } => TrackEdit::SetTransition { index, transition },
    })
}

/// The place of a time among those of the steps: 1.5 is in the middle between steps 1 and 2. Beyond the ends it is that of the end.
pub fn place_of(times: &[f64], time: f64) -> f64 {
    let behind = times.partition_point(|step| *step <= time);
    let Some(step) = behind.checked_sub(1) else { return 0.0 };
    match (times.get(step), times.get(behind)) {
        // Halved before the differences, which could overflow.
        (Some(a), Some(b)) => step as f64 + (0.5 * time - 0.5 * a) / (0.5 * b - 0.5 * a),
        _ => step as f64,
    }
}

/// The time at a place among the steps, the inverse of [`place_of`] but for rounding; `None` without steps.
pub fn time_at(times: &[f64], place: f64) -> Option<f64> {
    let last = times.len().checked_sub(1)?;
    let place = if place.is_nan() { 0.0 } else { place.clamp(0.0, last as f64) };
    let (step, share) = (place as usize, place.fract());
    let a = *times.get(step)?;
    Some(times.get(step + 1).map_or(a, |b| a * (1.0 - share) + b * share))
}

#[cfg(test)]
#[path = "tracks_tests.rs"]
mod tests;
