//! [`FlowSettings`]: the table of flow.

use super::ProjectError;
use super::settings::as_text;
use crate::field::FieldSelector;
use crate::look::FlowLook;
use crate::render::flow::{FlowFidelity, FlowStyle, FlowVolume, IconName, Thresholds};
use crate::render::surfaces::ByField;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A field of vectors in motion. Settings left out are as for `render`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct FlowSettings {
    /// The field of vectors.
    pub field: String,
    /// The patterns along the flow, as `--flow-icon` has them; files are relative to the folder of the project file.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "as_text")]
    pub icon: Option<Thresholds<IconName>>,
    /// The field by which one of several is chosen.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "as_text")]
    pub by: Option<FieldSelector>,
    /// Number of splats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splats: Option<u32>,
    /// Width of a splat, in edges of the cells at its vertex.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
    /// Length of a period of the pattern, world units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Opacity of the pattern where the timeline has none, 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub opacity: Option<f64>,
    /// World length that a vector of length 1 moves in a unit of time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<f64>,
    /// Time of the series a second with which the flow of a held step goes on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// What patterns of vectors nearly along the ray are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fidelity: Option<FlowFidelity>,
    /// What shows the scalars.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<FlowVolume>,
    /// The field that colours the pattern, and its map, as `--flow-color` has it.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "as_text")]
    pub color: Option<ByField>,
}

impl FlowSettings {
    /// The settings that give the flow of a look; usual ones are left out.
    pub fn of(FlowLook { layer, color_by, icons, rate }: &FlowLook) -> Self {
        let (style, usual) = (layer.style, FlowStyle::default());
        Self {
            field: layer.field.clone(),
            icon: icons.clone().or_else(|| differing(style.icon, usual.icon).map(Thresholds::from)),
            by: layer.icons.as_ref().and_then(|icons| icons.by.as_ref()?.parse().ok()),
            splats: style.splats,
            size: differing(style.size, usual.size),
            length: style.length,
            opacity: differing(style.opacity, usual.opacity),
            speed: differing(style.speed, usual.speed),
            rate: *rate,
            fidelity: differing(style.fidelity, usual.fidelity),
            volume: differing(style.volume, usual.volume),
            color: color_by.clone(),
        }
    }

    /// The settings with other paths of the files that they name.
    #[must_use]
    pub fn with_paths(self, path: impl Fn(PathBuf) -> PathBuf) -> Self {
        Self { icon: self.icon.map(|icons| icons.with_paths(path)), ..self }
    }

    /// Checks that all is in range.
    ///
    /// # Errors
    /// What is not.
    pub(super) fn check(&self) -> Result<(), ProjectError> {
        let usual = FlowStyle::default();
        let style = FlowStyle {
            splats: self.splats,
            size: self.size.unwrap_or(usual.size),
            length: self.length,
            opacity: self.opacity.unwrap_or(usual.opacity),
            speed: self.speed.unwrap_or(usual.speed),
            ..usual
        };
        let rate = self.rate.map_or(Ok(()), FlowLook::check_rate);
        style.check().and(rate).map_err(ProjectError::BadFlow)
    }
}

/// A value that is not the usual one.
pub(super) fn differing<T: PartialEq>(value: T, usual: T) -> Option<T> {
    (value != usual).then_some(value)
}
