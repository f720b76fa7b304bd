//! What can be asked of a pipeline, and why it may not become a frame.

use super::{Backend, FrameTime, Sampling};
use crate::camera::{Camera, CameraError};
use crate::error::FileError;
use crate::node_table::TransferTable;
use crate::optics::OpticsKind;
use crate::render::{KBuffer, RenderError};
use crate::transfer::TransferSource;
use crate::visibility::Skip;
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// How a frame is rendered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RenderMode {
    /// The fastest that is within the accuracy bounds: the ray caster for all there is, faces below that
    /// ([`FaceDetail::lod`] less than 1).
    #[default]
    Auto,
    /// Cell walk, [`crate::render::cpu::raycast`].
    Raycast,
    /// Faces through a k-buffer, [`crate::render::cpu::havs`], at any level of detail.
    Havs,
    /// The float64 judge, [`mod@crate::render::reference`]; on the CPU whatever the backend.
    Reference,
}

impl fmt::Display for RenderMode {
    /// As it is read.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Raycast => "raycast",
            Self::Havs => "havs",
            Self::Reference => "reference",
        })
    }
}

impl FromStr for RenderMode {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "raycast" => Ok(Self::Raycast),
            "havs" => Ok(Self::Havs),
            "reference" => Ok(Self::Reference),
            _ => Err(format!("there is no mode '{text}'; choose auto, raycast, havs or reference")),
        }
    }
}

/// Which faces are drawn, and how they come into order, where faces are ([`FrameRequest::drawn_by`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FaceDetail {
    /// Level of detail: the share of the interior faces of the active cells that is drawn, 0 to 1. Those of their surface all
    /// are.
    pub lod: f64,
    /// Which of them come first.
    pub sampling: Sampling,
    /// How their fragments come into order.
    pub k_buffer: KBuffer,
}

impl Default for FaceDetail {
    fn default() -> Self {
        Self { lod: 1.0, sampling: Sampling::default(), k_buffer: KBuffer::default() }
    }
}

/// All that a frame of a series depends on. Plain data: cheap to clone, and what it serialises to tells it from others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameRequest {
    /// Zero-based step of the store, or a moment between two.
    pub time: FrameTime,
    /// Where from.
    pub camera: Camera,
    /// Transfer function.
    pub table: TransferTable,
    /// What the table was made from, if that is known: the reference evaluates it by its formula, and the table without it.
    #[serde(serialize_with = "serialize_source")]
    pub formula: Option<Arc<TransferSource>>,
    /// Width and height in pixels.
    pub size_px: (usize, usize),
    /// Which renderer.
    pub mode: RenderMode,
    /// Which faces are drawn, where faces are.
    pub faces: FaceDetail,
    /// How segments are integrated; the reference does it in its own way.
    pub optics: OpticsKind,
    /// Where it is rendered.
    pub backend: Backend,
    /// Whether it is for a window: a frame that is rendered on the window's GPU (`WindowGpu`) stays
    /// there. What it shows is the same.
    #[serde(skip)]
    pub for_window: bool,
    /// What may be left out. What it shows is the same.
    #[serde(skip)]
    pub skip: Skip,
}

impl FrameRequest {
    /// A frame with everything else as by default: the fastest accurate mode, exact optics.
    ///
    /// `time` is a step or a [`FrameTime`]; `table` covers the field's scalars; `size_px` is width and height.
    pub fn new(
        time: impl Into<FrameTime>,
        camera: Camera,
        table: impl Into<TransferTable>,
        size_px: (usize, usize),
    ) -> Self {
        let (formula, mode, faces, optics, backend, for_window, skip) = Default::default();
        Self {
            time: time.into(),
            camera,
            table: table.into(),
            formula,
            size_px,
            mode,
            faces,
            optics,
            backend,
            for_window,
            skip,
        }
    }

    /// The renderer that draws it: what [`RenderMode::Auto`] comes to, else [`Self::mode`].
    pub fn drawn_by(&self) -> RenderMode {
        match self.mode {
            RenderMode::Auto if self.faces.lod < 1.0 => RenderMode::Havs,
            RenderMode::Auto => RenderMode::Raycast,
            mode => mode,
        }
    }

    /// Whether two frames differ in nothing but the moment that they show.
    pub fn same_view(&self, other: &Self) -> bool {
        let is_judge = self.mode == RenderMode::Reference;
        let same_table = self.table == other.table && (!is_judge || self.formula == other.formula);
        let rest = |r: &Self| (r.camera, r.size_px, r.mode, r.faces, r.optics, r.backend, r.for_window, r.skip);
        same_table && rest(self) == rest(other)
    }
}

/// What the source is, not where.
fn serialize_source<S: Serializer>(source: &Option<Arc<TransferSource>>, serializer: S) -> Result<S::Ok, S::Error> {
    source.as_deref().serialize(serializer)
}

/// Why a request did not become a frame.
#[derive(Clone, Debug, thiserror::Error)]
pub enum PipelineError {
    /// The step could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// There is no view through the camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Somebody asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// Mesh and field do not belong together, or the GPU failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A stage panicked: a fault of this program. The frame is lost, the next one begins afresh.
    #[error("tetreel failed at this frame while it was to {stage} it: {message}; please report this")]
    Panicked {
        /// What was being done: `decode`, `order`, `render`.
        stage: &'static str,
        /// What the panic said.
        message: String,
    },
}
