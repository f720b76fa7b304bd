//! Keys of the timeline: the selected one, and what the user does to keys.

use super::Session;
use crate::look::{EnsembleChoice, Look};
use crate::pipeline::Shown;
use crate::playback::Command;
use crate::project::{Edit, FlowSettings, LookSettings, Project, ProjectError, TrackEdit};
use crate::render::surfaces::{Cut, CutText};
use crate::timeline::{Key, Transition};
use crate::ui::tracks::{KeyAction, KeyValue, Track, TrackKey};
use glam::DVec3;
use std::time::Duration;

impl Session {
    /// The selected key of the timeline, with its index.
    pub fn selected_key(&self) -> Option<(Track, usize, TrackKey)> {
        let (track, index) = self.keys.selected?;
        let key = track.keys(self.project()).into_iter().nth(index)?;
        Some((track, index, key))
    }

    /// The track of the copied key.
    pub fn copied_key(&self) -> Option<Track> {
        self.keys.copied.as_ref().map(|(track, _)| *track)
    }

    /// The time of the frame that is or should be on the screen, in the unit of the series.
    pub fn moment(&self) -> Option<f64> {
        self.state().frame.map(|frame| frame.time(self.series().times()))
    }

    /// The value that a track's key would have now: what is shown.
    ///
    /// # Errors
    /// What is missing for such a key.
    pub fn value_shown(&self, track: Track) -> Result<KeyValue, &'static str> {
        let at = self.moment().ok_or("the series has no steps")?;
        let (project, look) = (self.project(), &self.look);
        let followed = look.followed;
        let keyed = |follows: bool| if follows { track.value_at(project, at) } else { None };
        let surface = look.surfaces.isosurfaces.last().ok_or("show an isosurface first (M)");
        Ok(match track {
            Track::Ensembles => {
                let shown = project.ensembles.get(self.document.edited(followed.ensembles, Some(at)));
                KeyValue::Ensemble(shown.ok_or("the project has no ensemble")?.name.clone())
            }
            Track::Map { ensemble, member } => {
                let of = project.ensembles.get(ensemble).and_then(|of| of.members.get(member));
                let own = of.map(|member| KeyValue::Map(member.map.clone())).ok_or("there is no such member")?;
                keyed(true).unwrap_or(own)
            }
            Track::Cameras => keyed(followed.camera).unwrap_or(KeyValue::Camera(look.camera)),
            Track::Lod => keyed(followed.lod).unwrap_or(KeyValue::Number(look.faces.lod)),
            Track::Optics => keyed(followed.optics).unwrap_or(KeyValue::Optics(look.optics)),
            Track::Isovalue => {
                let own = KeyValue::Number(surface?.value);
                keyed(followed.surfaces).unwrap_or(own)
            }
            Track::IsoOpacity => {
                let own = KeyValue::Number(surface?.opacity);
                keyed(followed.surfaces).unwrap_or(own)
            }
            Track::Cut => {
                let cut = look.surfaces.cuts.last().ok_or("show a cut first")?;
                keyed(followed.surfaces).unwrap_or(KeyValue::Number(shift_from(self.unmoved_cut(), cut)))
            }
            Track::Flow => {
                let flow = look.flow.as_ref().ok_or("show flow first (F)")?;
                keyed(followed.flow).unwrap_or(KeyValue::Number(flow.layer.style.opacity))
            }
        })
    }

    /// Applies an action to keys.
    pub(super) fn act_on_keys(&mut self, action: KeyAction, now: Duration) {
        match action {
            KeyAction::Select(track, index) => self.select(track, index, now),
            KeyAction::Deselect => self.keys.selected = None,
            KeyAction::Add(track) => match self.value_shown(track) {
                Ok(value) => self.insert_here(track, Transition::default(), value),
                Err(problem) => self.fail(format!("no key: {problem}")),
            },
            KeyAction::Copy => self.keys.copied = self.selected_key().map(|(track, _, key)| (track, key)),
            KeyAction::Paste => {
                if let Some((track, key)) = self.keys.copied.clone() {
                    self.insert_here(track, key.transition, key.value);
                }
            }
            action => {
                if let Some((track, index, key)) = self.selected_key() {
                    self.change_key((track, index), key, action);
                }
            }
        }
    }

    /// Changes the selected key.
    fn change_key(&mut self, (track, index): (Track, usize), key: TrackKey, action: KeyAction) {
        let edit = match action {
            KeyAction::Move { time, snaps } => {
                let times = &self.series().times().values;
                let time = track.free_time(self.project(), index, times, time, snaps).filter(|time| *time != key.time);
                time.map(|time| TrackEdit::Move { index, time })
            }
            KeyAction::SetTransition(transition) => Some(TrackEdit::SetTransition { index, transition }),
            KeyAction::SetValue(value) => {
                self.follow(track);
                Some(TrackEdit::Insert(Key { value, ..key }))
            }
            KeyAction::TakeShown => match self.value_shown(track) {
                Ok(value) => {
                    self.follow(track);
                    Some(TrackEdit::Insert(Key { value, ..key }))
                }
                Err(_) => None,
            },
            KeyAction::Remove => {
                self.keys.selected = None;
                Some(TrackEdit::Remove { index })
            }
            _ => None,
        };
        if let Some(edit) = edit.and_then(|edit| track.edit(self.project(), edit)) {
            self.edit(edit);
        }
    }

    /// Selects a key, goes to its time, and returns to the timeline for its track.
    fn select(&mut self, track: Track, index: usize, now: Duration) {
        self.keys.selected = Some((track, index));
        let Some((_, _, key)) = self.selected_key() else { return };
        self.follow(track);
        if self.moment() != Some(key.time) {
            self.command(Command::SeekTime(key.time), now);
        }
    }

    /// Inserts a key at the moment shown, and selects it. What the project says of surfaces, flow and renderer becomes what is shown,
    /// if the track's keys are about that.
    fn insert_here(&mut self, track: Track, transition: Transition, value: KeyValue) {
        let Some(time) = self.moment() else { return };
        if track == Track::Cut {
            self.put_cut_back();
        }
        let mut project = Project::clone(self.project());
        let look = Edit::SetLook(Box::new(self.settings_for(track, &project)));
        let Some(edit) = track.insert(&project, Key { time, transition, value }) else { return };
        let flow = self.look.flow.as_ref().filter(|_| track == Track::Flow);
        let flow = flow.map(|flow| Edit::SetFlow(Some(Box::new(FlowSettings::of(flow)))));
        match [Some(look), flow, Some(edit)].into_iter().flatten().try_for_each(|edit| edit.apply(&mut project)) {
            Ok(()) => {
                let index = track.keys(&project).iter().position(|key| key.time == time);
                self.keys.selected = index.map(|index| (track, index));
                self.document.set_project(project);
                self.follow(track);
            }
            // The remedy is for files; here it is a click.
            Err(ProjectError::NoLevels(mode)) => {
                self.fail(format!("the renderer '{mode}' always draws all cells; choose 'best renderer' or 'faces'"));
            }
            Err(error) => self.fail(error.to_string()),
        }
    }

    /// The project's settings, with those that keys of a track are about as they are shown.
    fn settings_for(&self, track: Track, project: &Project) -> LookSettings {
        let shown = self.look_settings(project, matches!(track, Track::Isovalue | Track::IsoOpacity));
        let known = project.look.clone();
        match track {
            Track::Isovalue | Track::IsoOpacity => LookSettings { iso: shown.iso, ..known },
            Track::Cut => LookSettings { cut: shown.cut, ..known },
            Track::Lod | Track::Optics => LookSettings { mode: shown.mode, lod: shown.lod, ..known },
            Track::Ensembles | Track::Map { .. } | Track::Cameras | Track::Flow => known,
        }
    }

    /// What is shown, as settings of a project. Surfaces that are hidden are kept if the timeline has keys of them, or is to have.
    pub(super) fn look_settings(&self, project: &Project, has_surface: bool) -> LookSettings {
        let ensemble = match self.look.followed.ensembles {
            EnsembleChoice::One(index) => project.ensembles.get(index).map(|ensemble| ensemble.name.clone()),
            EnsembleChoice::Project => project.look.ensemble.clone(),
        };
        let mut shown = Look { camera: self.camera(), ..self.look.clone() };
        let timeline = &project.timeline;
        let has_keys = !(timeline.isovalue.keys().is_empty() && timeline.iso_opacity.keys().is_empty());
        if shown.surfaces.shown == Shown::Volume && (has_keys || has_surface) {
            shown.surfaces.shown = Shown::Both;
        }
        if let (Some(unmoved), Some(cut)) = (self.unmoved_cut(), shown.surfaces.cuts.last_mut()) {
            cut.point = unmoved.point;
        }
        let usual = Look::default_for(self.series(), self.look.tf.clone()).unwrap_or_else(|_| shown.clone());
        LookSettings::of(&shown, &usual, ensemble)
    }

    /// Returns to the timeline for what keys of a track are about.
    fn follow(&mut self, track: Track) {
        if matches!(track, Track::Isovalue | Track::IsoOpacity | Track::Cut) {
            self.put_cut_back();
        }
        let followed = &mut self.look.followed;
        match track {
            Track::Ensembles => followed.ensembles = EnsembleChoice::Project,
            Track::Map { .. } => {}
            Track::Cameras => followed.camera = true,
            Track::Lod => followed.lod = true,
            Track::Flow => followed.flow = true,
            Track::Optics => followed.optics = true,
            Track::Isovalue | Track::IsoOpacity | Track::Cut => followed.surfaces = true,
        }
    }

    /// The cut that the timeline's shifts are counted from; `None` without keys, or if the last cut is another one, with another normal.
    fn unmoved_cut(&self) -> Option<Cut> {
        let (project, cuts) = (self.project(), &self.look.surfaces.cuts);
        let is_keyed = !project.timeline.cut.keys().is_empty() && project.look.cut.len() == cuts.len();
        let unmoved = project.look.cut.last().filter(|_| is_keyed)?.parse::<CutText>().ok()?.cut;
        cuts.last().is_some_and(|cut| is_along(cut, &unmoved)).then_some(unmoved)
    }

    /// Puts a cut that the user has moved off the timeline back to where its shifts are counted from.
    pub(super) fn put_cut_back(&mut self) {
        let unmoved = self.unmoved_cut();
        if let (Some(unmoved), Some(cut)) = (unmoved, self.look.surfaces.cuts.last_mut()) {
            cut.point = unmoved.point;
        }
    }
}

/// Whether two cuts have one normal.
fn is_along(a: &Cut, b: &Cut) -> bool {
    let [a, b] = [a, b].map(|cut| DVec3::from(cut.normal).normalize_or_zero());
    a.dot(b) > 1.0 - 1e-9
}

/// How far a cut is from another one along its normal; 0 without another one.
fn shift_from(unmoved: Option<Cut>, cut: &Cut) -> f64 {
    let Some(unmoved) = unmoved else { return 0.0 };
    (DVec3::from(cut.point) - DVec3::from(unmoved.point)).dot(DVec3::from(cut.normal).normalize_or_zero())
}
