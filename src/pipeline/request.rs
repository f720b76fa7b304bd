//! What can be asked of a pipeline, and why it may not become a frame.

use super::{Backend, FrameTime, TetDraw};
use crate::camera::{Camera, CameraError};
use crate::error::FileError;
use crate::node_table::TransferTable;
use crate::optics::OpticsKind;
use crate::render::RenderError;
use crate::transfer::TransferSource;
use crate::visibility::Skip;
use serde::{Serialize, Serializer};
use std::sync::Arc;

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
    /// How it is drawn.
    pub draw: TetDraw,
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
        let (formula, draw, optics, backend, for_window, skip) = Default::default();
        Self {
            time: time.into(),
            camera,
            table: table.into(),
            formula,
            size_px,
            draw,
            optics,
            backend,
            for_window,
            skip,
        }
    }

    /// Whether two frames differ in nothing but the moment that they show.
    pub fn same_view(&self, other: &Self) -> bool {
        let is_judge = self.draw == TetDraw::Reference;
        let same_table = self.table == other.table && (!is_judge || self.formula == other.formula);
        let rest = |r: &Self| (r.camera, r.size_px, r.draw, r.optics, r.backend, r.for_window, r.skip);
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
