//! The tables of a project file.

use super::ProjectError;
use crate::camera::{Camera, CameraError};
use crate::field::{FieldSelector, Regions};
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, RenderMode, Representation};
use crate::render::functions::{FunctionDomain, Normalise};
use crate::render::points::{Compositing, Footprint};
use crate::render::surfaces::{CropBox, Light, Normals};
use crate::timeline::{At, Keyframed};
use crate::transfer::{ColorWeighting, OpacityKind, RangeMap};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::PathBuf;

/// Dataset and field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Data {
    /// A store or a source, relative to the folder of the project file.
    pub source: PathBuf,
    /// The field: `NAME`, `NAME:mag` or `NAME:0`; by default the first of the store.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "as_text")]
    pub field: Option<FieldSelector>,
}

/// A camera to go back to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct NamedCamera {
    /// Its name: without '='.
    pub name: String,
    /// Viewpoint and projection.
    pub camera: Camera,
}

/// The look. Settings left out are as for `render`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
pub struct LookSettings {
    /// The ensemble that is shown where the timeline has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ensemble: Option<String>,
    /// How opacities are defined.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opacity_kind: Option<OpacityKind>,
    /// The length that opacities refer to, world units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit_distance: Option<f64>,
    /// Renderer for the volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<RenderMode>,
    /// What the field is drawn as.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub representation: Option<Representation>,
    /// Device that renders.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backend: Option<Backend>,
    /// How segments are integrated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optics: Option<OpticsKind>,
    /// Isosurfaces, as `--iso` has them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub iso: Vec<String>,
    /// Planes through the cells, as `--cut` has them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cut: Vec<String>,
    /// The box to crop to, as `--crop` has it.
    #[serde(skip_serializing_if = "Option::is_none", with = "as_text")]
    pub crop: Option<CropBox>,
    /// The surfaces of the domain and of regions, as `--surface` has them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub surface: Vec<String>,
    /// Numbers of the parts of the mesh that are shown, as `--parts` has them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<u32>,
    /// The regions of the mesh that are shown, as `--regions` has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub regions: Option<Regions>,
    /// Whether the volume is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_volume: Option<bool>,
    /// Normals of lit surfaces, as `--shade` has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shade: Option<Normals>,
    /// Whether the volume is lit by its gradients.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shade_volume: Option<bool>,
    /// Where light on surfaces comes from, as `--light` has it.
    #[serde(skip_serializing_if = "Option::is_none", with = "as_text")]
    pub light: Option<Light>,
    /// Whether surfaces have ambient occlusion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ao: Option<bool>,
    /// Whether depths are not smoothed where faces are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_smoothing: Option<bool>,
    /// Level of detail, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "share")]
    pub lod: Option<f64>,
    /// Which faces are drawn first, as `--sampling` has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sampling: Option<String>,
    /// Number of fragments sorted at a time, 2 to 32.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k: Option<u8>,
    /// Whether pixels whose fragments came out of order stay as they are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inexact_order: Option<bool>,
    /// The shape of cells drawn as points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub footprint: Option<Footprint>,
    /// How points on a ray become light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compositing: Option<Compositing>,
    /// Scale of the footprints of points, above 0, at most 8.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_radius: Option<f64>,
    /// Number of sheets through the mesh, where functions are drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheets: Option<u32>,
    /// Error of the scalar between sheets, a share of the field's range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sampling_error: Option<f64>,
    /// Where a field of functions is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub domain: Option<FunctionDomain>,
    /// What the sum of values of functions is divided by.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalise: Option<Normalise>,
    /// Viewpoint, as `--camera` has it, or the name of a camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
}

/// What `render` writes: its options by their names, without the dashes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
pub struct Output {
    /// Output files, relative to the folder of the project file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<PathBuf>,
    /// Width and height in pixels: `1024x768`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<String>,
    /// Steps `A..B:S`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<String>,
    /// Times `T0..T1`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub times: Option<String>,
    /// Frames per second.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fps: Option<String>,
    /// Duration, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration: Option<f64>,
    /// Whether steps are interpolated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpolate: Option<bool>,
    /// Degrees that the camera turns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turntable: Option<f64>,
    /// Rays that are cast, as `--rays` has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rays: Option<String>,
    /// Size of the image that is rendered and then enlarged, as `--image-scale` has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_scale: Option<String>,
    /// Filter that enlarges it, as `--upsample` has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upsample: Option<String>,
    /// Width of a joint filter, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kernel: Option<u64>,
    /// Difference of depths at an edge.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_depth: Option<f64>,
    /// Number of depth layers compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<u64>,
    /// Colour behind the volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub background: Option<String>,
    /// What is drawn over the frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub annotate: Option<String>,
    /// Bits per channel of PNG files, or of colours in EXR files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit_depth: Option<u8>,
    /// Colour format of EXR files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exr: Option<String>,
    /// Compression of EXR files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exr_compression: Option<String>,
}

/// Keys of what changes, at times in the unit of the series. Values are constant before the first key and after the last one of a track.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
pub struct Timeline {
    /// Whether colours are weighted by opacities where one ensemble blends into another.
    pub colors: ColorWeighting,
    /// Names of ensembles; between two keys their curves are blended (dissertation 7.4).
    pub ensembles: Keyframed<String>,
    /// Range maps of members, one track each; they replace the member's own map. A track without keys does nothing.
    pub maps: Vec<MapTrack>,
    /// Camera path.
    pub cameras: Keyframed<Camera>,
    /// Levels of detail, 0 to 1.
    pub lod: Keyframed<f64>,
    /// Isovalues of the last surface of the look.
    pub isovalue: Keyframed<f64>,
    /// Opacities of that surface, 0 to 1.
    pub iso_opacity: Keyframed<f64>,
    /// How far the last cut of the look is moved along its normal, world units.
    pub cut: Keyframed<f64>,
    /// Opacities of the flow, 0 to 1.
    pub flow: Keyframed<f64>,
    /// How segments are integrated; holds until the next key.
    pub optics: Keyframed<OpticsKind>,
}

impl Timeline {
    /// The camera at a time; `None` without keys.
    ///
    /// # Errors
    /// If there is no view between two cameras.
    pub fn camera(&self, time: f64) -> Option<Result<Camera, CameraError>> {
        Some(match self.cameras.at(time)? {
            At::One(camera) => Ok(*camera),
            At::Between { a, b, weight } => Camera::between(a, b, weight),
        })
    }

    /// How segments are integrated at a time: as the key before says; `None` without keys.
    pub fn optics(&self, time: f64) -> Option<OpticsKind> {
        self.optics.at(time).map(|optics| match optics {
            At::One(optics) | At::Between { a: optics, .. } => *optics,
        })
    }

    /// Times that show everything the timeline names: its keys of ensembles and cameras, and the midpoints between two of them.
    pub fn places(&self) -> Vec<f64> {
        let ensembles = times_of(&self.ensembles);
        let cameras = times_of(&self.cameras);
        [ensembles, cameras].into_iter().flat_map(with_middles).collect()
    }
}

fn times_of<T>(track: &Keyframed<T>) -> Vec<f64> {
    track.keys().iter().map(|key| key.time).collect()
}

fn with_middles(times: Vec<f64>) -> Vec<f64> {
    let middles = times.windows(2).map(|pair| 0.5 * pair[0] + 0.5 * pair[1]).collect::<Vec<_>>();
    [times, middles].concat()
}

/// Refuses an invalid share while reading, so that the error names the line.
fn share<'de, D: Deserializer<'de>>(data: D) -> Result<Option<f64>, D::Error> {
    let share = f64::deserialize(data)?;
    let wrong = || D::Error::custom(ProjectError::BadLod(share));
    if (0.0..=1.0).contains(&share) { Ok(Some(share)) } else { Err(wrong()) }
}

/// The range map of one member over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct MapTrack {
    /// Name of the ensemble.
    pub ensemble: String,
    /// Name of its member.
    pub member: String,
    /// Range maps at their times.
    pub keys: Keyframed<RangeMap>,
}

/// Serialises a value as its text.
pub(super) mod as_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};
    use std::fmt::Display;
    use std::str::FromStr;

    pub(in crate::project) fn serialize<T: Display, S: Serializer>(
        value: &Option<T>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => serializer.collect_str(value),
            None => serializer.serialize_none(),
        }
    }

    pub(in crate::project) fn deserialize<'de, T, D>(deserializer: D) -> Result<Option<T>, D::Error>
    where
        T: FromStr,
        T::Err: Display,
        D: Deserializer<'de>,
    {
        let text = String::deserialize(deserializer)?;
        text.parse().map(Some).map_err(D::Error::custom)
    }
}
