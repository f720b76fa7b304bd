//! [`Project`]: how a series is shown and how that changes over time, as a `.toml` file (`docs/projects.md`).
//!
//! A project names a dataset and a field, keeps ensembles of transfer functions, and on one timeline the keys of what changes: ensembles,
//! range maps of their members, camera, level of detail, optics. [`Animation`] evaluates it at a time; [`Edit`] changes it.

mod animation;
mod edit;
mod file;
mod flow;
mod of_look;
mod settings;
#[cfg(test)]
mod tests;

pub use animation::Animation;
pub use edit::{Edit, TrackEdit};
pub use flow::FlowSettings;
pub use settings::{Data, LookSettings, MapTrack, NamedCamera, Output, Timeline};

use crate::camera::{Camera, CameraError};
use crate::error::FileError;
use crate::optics::OpticsKind;
use crate::pipeline::RenderMode;
use crate::playback::{CommandError, Settings};
use crate::render::domain::DomainSurface;
use crate::render::points::PointStyle;
use crate::render::surfaces::{CutText, IsosurfaceText};
use crate::short::Short;
use crate::timeline::{Key, TimelineError};
use crate::transfer::{Ensemble, TransferError};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Whether a path names a project file.
pub fn is_project(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// The contents of a project file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Project {
    /// Version of the schema: [`Project::VERSION`].
    pub version: u32,
    /// Dataset and field.
    pub data: Data,
    /// The look, where the timeline does not override it.
    #[serde(default)]
    pub look: LookSettings,
    /// A field of vectors within, in motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<FlowSettings>,
    /// Playback settings.
    #[serde(default)]
    pub playback: Settings,
    /// Options of `render`.
    #[serde(default)]
    pub output: Output,
    /// Keys of what changes over time.
    #[serde(default)]
    pub timeline: Timeline,
    /// Ensembles of transfer functions, told apart by their names.
    #[serde(default)]
    pub ensembles: Vec<Ensemble>,
    /// Cameras to go back to, told apart by their names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<NamedCamera>,
}

impl Project {
    /// Version of the schema that is written; older ones are read as well, newer ones refused.
    pub const VERSION: u32 = 1;
    const VERSIONS: std::ops::RangeInclusive<u32> = 1..=Self::VERSION;

    /// A project of a dataset, otherwise empty.
    pub fn new(data: Data) -> Self {
        Self {
            version: Self::VERSION,
            data,
            look: LookSettings::default(),
            flow: None,
            playback: Settings::default(),
            output: Output::default(),
            timeline: Timeline::default(),
            ensembles: Vec::new(),
            cameras: Vec::new(),
        }
    }

    /// The ensemble of that name.
    pub fn ensemble(&self, name: &str) -> Option<&Ensemble> {
        self.ensembles.iter().find(|ensemble| ensemble.name == name)
    }

    /// The camera that a text names, as `--camera` has it; `None` if the text is a camera itself.
    ///
    /// # Errors
    /// If there is no camera of that name.
    pub fn named_camera(&self, text: &str) -> Result<Option<&Camera>, ProjectError> {
        if text.contains('=') || text.trim().is_empty() {
            return Ok(None);
        }
        let found = self.cameras.iter().find(|named| named.name == text.trim());
        let known = || self.cameras.iter().map(|named| named.name.as_str()).collect::<Vec<_>>().join(", ");
        let missing = || ProjectError::NoCamera { name: text.trim().to_owned(), known: known() };
        found.map(|named| Some(&named.camera)).ok_or_else(missing)
    }

    /// The ensemble that is shown where the timeline has none.
    pub fn shown_without_keys(&self) -> Option<&Ensemble> {
        self.look.ensemble.as_ref().map_or(self.ensembles.first(), |name| self.ensemble(name))
    }

    /// Checks that the parts are consistent: no duplicate names, no keys of missing parts, no invalid views or speeds.
    ///
    /// # Errors
    /// The first inconsistency.
    pub fn check(&self) -> Result<(), ProjectError> {
        if !Self::VERSIONS.contains(&self.version) {
            return Err(ProjectError::Version(self.version));
        }
        for (i, ensemble) in self.ensembles.iter().enumerate() {
            if self.ensembles.iter().take(i).any(|other| other.name == ensemble.name) {
                return Err(ProjectError::NameTaken(ensemble.name.clone()));
            }
            let names = || ensemble.members.iter().map(|member| &member.name);
            if let Some((_, twice)) = names().enumerate().find(|(i, name)| names().take(*i).any(|other| other == *name))
            {
                return Err(ProjectError::MemberTaken(ensemble.name.clone(), twice.clone()));
            }
        }
        let named = self.timeline.ensembles.keys().iter().map(|key| &key.value);
        for name in named.chain(&self.look.ensemble) {
            self.found(name)?;
        }
        self.check_maps()?;
        self.check_cameras()?;
        for lod in self.timeline.lod.keys().iter().map(|key| key.value).chain(self.look.lod) {
            if !(0.0..=1.0).contains(&lod) {
                return Err(ProjectError::BadLod(lod));
            }
        }
        let isovalues = self.timeline.isovalue.keys();
        if let Some(key) = isovalues.iter().find(|key| !key.value.is_finite()) {
            return Err(ProjectError::BadIsovalue(key.value));
        }
        let opacities = self.timeline.iso_opacity.keys();
        if let Some(key) = opacities.iter().find(|key| !(0.0..=1.0).contains(&key.value)) {
            return Err(ProjectError::BadSurface(format!("an opacity of {}; it lies between 0 and 1", key.value)));
        }
        if !(isovalues.is_empty() && opacities.is_empty()) && self.look.iso.is_empty() {
            return Err(ProjectError::NoSurface);
        }
        for iso in &self.look.iso {
            iso.parse::<IsosurfaceText>().map_err(ProjectError::BadSurface)?;
        }
        let moved = self.timeline.cut.keys();
        if let Some(key) = moved.iter().find(|key| !key.value.is_finite()) {
            return Err(ProjectError::BadCut(format!("moved by {}; distances are finite", key.value)));
        }
        if !moved.is_empty() && self.look.cut.is_empty() {
            return Err(ProjectError::NoCut);
        }
        for surface in &self.look.surface {
            surface.parse::<DomainSurface>().map_err(ProjectError::BadDomain)?;
        }
        for cut in &self.look.cut {
            cut.parse::<CutText>().map_err(ProjectError::BadCut)?;
        }
        self.check_mode()?;
        self.check_flow()?;
        Ok(self.playback.check()?)
    }

    /// Checks the flow, and its opacities on the timeline.
    fn check_flow(&self) -> Result<(), ProjectError> {
        self.flow.as_ref().map_or(Ok(()), FlowSettings::check)?;
        let opacities = self.timeline.flow.keys();
        if let Some(&Key { time, value, .. }) = opacities.iter().find(|key| !(0.0..=1.0).contains(&key.value)) {
            return Err(ProjectError::BadFlowOpacity { time, opacity: value });
        }
        if !opacities.is_empty() && self.flow.is_none() {
            return Err(ProjectError::NoFlow);
        }
        Ok(())
    }

    /// Refuses levels of detail for a renderer that draws all cells, and optics for one that has its own.
    fn check_mode(&self) -> Result<(), ProjectError> {
        let radius = self.look.point_radius.unwrap_or(1.0);
        PointStyle { radius, ..PointStyle::EXACT }.check().map_err(ProjectError::BadPoints)?;
        let mode = self.look.mode.unwrap_or_default();
        // What does not go together is refused as options are.
        let mode = mode.of(self.look.representation).unwrap_or(mode);
        let (lod, optics) = (self.timeline.lod.keys(), self.timeline.optics.keys());
        let has_levels = lod.iter().map(|key| key.value).chain(self.look.lod).any(|lod| lod < 1.0);
        if matches!(mode, RenderMode::Raycast | RenderMode::Sheets | RenderMode::Reference) && has_levels {
            return Err(ProjectError::NoLevels(mode));
        }
        if mode == RenderMode::Reference && optics.iter().any(|key| key.value != OpticsKind::Exact) {
            return Err(ProjectError::NoOptics);
        }
        Ok(())
    }

    /// Checks that each track of range maps is the only one of an existing member.
    fn check_maps(&self) -> Result<(), ProjectError> {
        let tracks = &self.timeline.maps;
        for (i, track) in tracks.iter().enumerate() {
            let ensemble = self.found(&track.ensemble)?;
            if !ensemble.members.iter().any(|member| member.name == track.member) {
                return Err(ProjectError::NoMember(track.ensemble.clone(), track.member.clone()));
            }
            let is_other = |other: &MapTrack| (&other.ensemble, &other.member) == (&track.ensemble, &track.member);
            if tracks.iter().take(i).any(is_other) {
                return Err(ProjectError::MapsTaken(track.ensemble.clone(), track.member.clone()));
            }
        }
        Ok(())
    }

    /// Checks the cameras of the timeline, those with names, and that which the look names.
    fn check_cameras(&self) -> Result<(), ProjectError> {
        for key in self.timeline.cameras.keys() {
            key.value.view(1, 1).map_err(|problem| ProjectError::Camera { time: key.time, problem })?;
        }
        for (i, NamedCamera { name, camera }) in self.cameras.iter().enumerate() {
            if name.trim() != name || name.is_empty() || name.contains('=') {
                return Err(ProjectError::BadCameraName(name.clone()));
            }
            if self.cameras.iter().take(i).any(|other| other.name == *name) {
                return Err(ProjectError::CameraTaken(name.clone()));
            }
            camera.view(1, 1).map_err(|problem| ProjectError::NamedCamera { name: name.clone(), problem })?;
        }
        self.look.camera.as_deref().map_or(Ok(()), |text| self.named_camera(text).map(drop))
    }

    fn found(&self, name: &str) -> Result<&Ensemble, ProjectError> {
        self.ensemble(name).ok_or_else(|| {
            let known: Vec<&str> = self.ensembles.iter().map(|ensemble| ensemble.name.as_str()).collect();
            ProjectError::NoEnsemble { name: name.to_owned(), known: known.join(", ") }
        })
    }
}

/// Why a project cannot be read, written, changed, or shown.
#[derive(Debug, thiserror::Error)]
pub enum ProjectError {
    /// The file cannot be read or written, or is not a project file.
    #[error(transparent)]
    File(#[from] FileError),
    /// A schema that this program does not know.
    #[error("version {0} of the project file is not known; this program reads 1 to {newest}", newest = Project::VERSION)]
    Version(u32),
    /// A project that cannot be written.
    #[error("the project has no text: {0}")]
    NoText(String),
    /// Two ensembles of one name.
    #[error("there are two ensembles '{0}'; names tell them apart")]
    NameTaken(String),
    /// Two members of one name.
    #[error("the ensemble '{0}' has two members '{1}'; names tell them apart")]
    MemberTaken(String, String),
    /// No ensemble of that name.
    #[error("there is no ensemble '{name}'; there are: {known}")]
    NoEnsemble {
        /// The name asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// Two cameras of one name.
    #[error("there are two cameras '{0}'; names tell them apart")]
    CameraTaken(String),
    /// A name that cannot be told from a camera.
    #[error("'{0}' is no name of a camera: it is not empty, and has no '=' and no spaces at its ends")]
    BadCameraName(String),
    /// No camera of that name.
    #[error("there is no camera '{name}'; {}", if known.is_empty() {
        "the project names none in [[cameras]]".to_owned()
    } else {
        format!("there are: {known}")
    })]
    NoCamera {
        /// The name asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// No view through a camera with a name.
    #[error("the camera '{name}': {problem}")]
    NamedCamera {
        /// Its name.
        name: String,
        /// What is wrong.
        problem: CameraError,
    },
    /// No member of that name.
    #[error("the ensemble '{0}' has no member '{1}'")]
    NoMember(String, String),
    /// Two tracks of range maps for one member.
    #[error(
        "the timeline has two tracks of range maps for the member '{1}' of the ensemble '{0}'; put all keys into one"
    )]
    MapsTaken(String, String),
    /// No element at that place.
    #[error("there is no {what} {index}")]
    NoElement {
        /// Kind of element.
        what: &'static str,
        /// The index asked for.
        index: usize,
    },
    /// No view through a camera.
    #[error("the camera at time {}: {problem}", Short(.time))]
    Camera {
        /// Time of its key.
        time: f64,
        /// What is wrong.
        problem: CameraError,
    },
    /// A level of detail outside of 0 to 1.
    #[error("a level of detail of {}; it is a share, 0 to 1", Short(.0))]
    BadLod(f64),
    /// An invalid isosurface.
    #[error("iso: {0}")]
    BadSurface(String),
    /// An isovalue on the timeline that is not finite.
    #[error("an isovalue of {0}; isovalues are finite")]
    BadIsovalue(f64),
    /// An invalid surface of the domain or of regions.
    #[error("surface: {0}")]
    BadDomain(String),
    /// An invalid cut.
    #[error("cut: {0}")]
    BadCut(String),
    /// Movements on the timeline without a cut.
    #[error(
        "the timeline moves a cut, but [look] has none; add cut = [\"point=x,y,z normal=x,y,z\"], or leave [[timeline.cut]] out"
    )]
    NoCut,
    /// Flow that cannot be.
    #[error("[flow]: {0}")]
    BadFlow(String),
    /// An opacity of flow on the timeline outside of 0 to 1.
    #[error("[[timeline.flow]] has an opacity of {opacity} at time {}; it lies between 0 and 1", Short(.time))]
    BadFlowOpacity {
        /// Time of its key.
        time: f64,
        /// The opacity.
        opacity: f64,
    },
    /// Opacities of flow on the timeline without flow.
    #[error(
        "the timeline has opacities of flow, but the project none; add [flow] with field = \"NAME\", or leave [[timeline.flow]] out"
    )]
    NoFlow,
    /// Isovalues on the timeline without a surface.
    #[error(
        "the timeline has isovalues or their opacities, but [look] no surface; add iso = [\"VALUE\"], or leave [[timeline.isovalue]] and [[timeline.iso-opacity]] out"
    )]
    NoSurface,
    /// Levels of detail for a renderer that has none.
    #[error("mode '{0}' always draws all cells; leave it out or say 'havs', or leave out lod and [[timeline.lod]]")]
    NoLevels(RenderMode),
    /// An invalid setting of points.
    #[error("point-radius: {0}")]
    BadPoints(String),
    /// Optics on the timeline, for a renderer that has its own.
    #[error("the timeline has optics, but mode 'reference' has its own; leave the mode or [[timeline.optics]] out")]
    NoOptics,
    /// An invalid ensemble.
    #[error("ensemble '{ensemble}': {problem}")]
    Ensemble {
        /// Name of the ensemble.
        ensemble: String,
        /// What is wrong.
        problem: Box<TransferError>,
    },
    /// An invalid key.
    #[error(transparent)]
    Timeline(#[from] TimelineError),
    /// Invalid playback settings.
    #[error("playback: {0}")]
    Playback(#[from] CommandError),
}
