//! What can be asked of a pipeline, and why it may not become a frame.

use super::text::{as_text, size_px};
use super::{
    Backend, DrawnBy, FrameTime, Layer, RequestError, ResidualRequest, SampleSet, TetDraw, TetLayer, Upsampling,
};
use crate::camera::{Camera, CameraError};
use crate::error::FileError;
use crate::node_table::TransferTable;
use crate::render::{Contrast, RenderError};
use crate::visibility::Skip;
use serde::{Deserialize, Serialize};

/// All that a frame of a series depends on. Plain data: cheap to clone, and text and back ([`Self::to_text`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameRequest {
    /// Zero-based step of the store, or a moment between two.
    pub time: FrameTime,
    /// Where from.
    pub camera: Camera,
    /// Width and height in pixels.
    #[serde(deserialize_with = "size_px::deserialize")]
    pub size_px: (usize, usize),
    /// What is seen; nothing without a layer.
    pub layers: Vec<Layer>,
    /// The pixels that are rendered; the planes of the frame have these.
    #[serde(default)]
    pub samples: SampleSet,
    /// An image of another size that is rendered instead, with all of its rays, and brought to full size; `None` if the frame is rendered itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upsampling: Option<Upsampling>,
    /// Whether the frame has the planes of normals and numbers of surfaces, where it has surfaces.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub guides: bool,
    /// Where it is rendered.
    #[serde(default)]
    pub backend: Backend,
    /// Whether it is for a window: a frame that is rendered on the window's GPU (`WindowGpu`) stays
    /// there. What it shows is the same.
    #[serde(skip)]
    pub for_window: bool,
    /// Contrasts at which the image is delivered on the way, falling, where it takes rays from cell to cell
    /// ([`Delivery::is_final`](super::Delivery::is_final)). The frame in the end is the same. A newer request takes the place of one
    /// with previews even while it is rendered.
    #[serde(skip)]
    pub previews: Vec<Contrast>,
    /// Details of an earlier frame, which stand for most of the rays: the frame is then near to the one without, and depends on the frame that
    /// they are of. For players; never kept, and in no text.
    #[serde(skip)]
    pub residual: Option<ResidualRequest>,
    /// What may be left out. What it shows is the same.
    #[serde(default, with = "as_text")]
    pub skip: Skip,
}

impl FrameRequest {
    /// The volume of a series, with everything else as by default ([`TetLayer::new`]).
    ///
    /// `time` is a step or a [`FrameTime`]; `table` covers the field's scalars; `size_px` is width and height.
    pub fn new(
        time: impl Into<FrameTime>,
        camera: Camera,
        table: impl Into<TransferTable>,
        size_px: (usize, usize),
    ) -> Self {
        let layers = vec![Layer::Tets(TetLayer::new(table))];
        Self {
            time: time.into(),
            camera,
            size_px,
            layers,
            samples: SampleSet::default(),
            upsampling: None,
            guides: false,
            backend: Backend::default(),
            for_window: false,
            previews: Vec::new(),
            residual: None,
            skip: Skip::default(),
        }
    }

    /// The layer of cells, if there is one.
    pub fn tets(&self) -> Option<&TetLayer> {
        self.layers.iter().find_map(Layer::tets)
    }

    /// The request with its layer of cells changed, if there is one.
    #[must_use]
    pub fn with_tets(mut self, change: impl FnOnce(&mut TetLayer)) -> Self {
        if let Some(layer) = self.layers.iter_mut().find_map(Layer::tets_mut) {
            change(layer);
        }
        self
    }

    /// The request with its cells drawn in another way.
    #[must_use]
    pub fn with_draw(self, draw: TetDraw) -> Self {
        self.with_tets(|tets| tets.draw = draw)
    }

    /// The share of the interior faces that is drawn; 1 where all cells are.
    pub fn lod(&self) -> f64 {
        self.tets().map_or(1.0, |tets| tets.draw.lod())
    }

    /// Whether contrast may decide which rays are cast ([`SampleSet::Adaptive`]): they go from cell to cell, and no light is found on the
    /// whole image.
    pub fn may_leave_rays_out(&self) -> bool {
        let may = |tets: &TetLayer| {
            matches!(tets.draw.drawn_by(), DrawnBy::Raycast)
                && !(tets.shading.is_of_screen() && !(tets.surfaces.is_empty() && tets.domain.is_empty()))
        };
        !self.guides && self.upsampling.is_none() && self.tets().is_some_and(may)
    }

    /// The one layer of cells, if there is one, checked against the name of the field that the series is of.
    ///
    /// # Errors
    /// If there are two, or it is of another field.
    pub(super) fn tets_of(&self, played: &str) -> Result<Option<&TetLayer>, RequestError> {
        let mut layers = self.layers.iter().enumerate().filter_map(|(at, layer)| Some((at, layer.tets()?)));
        let Some((first, layer)) = layers.next() else { return Ok(None) };
        if let Some((second, _)) = layers.next() {
            return Err(RequestError::TwoOfCells { first, second });
        }
        match &layer.field {
            Some(asked) if asked != played => {
                Err(RequestError::OtherField { asked: asked.clone(), played: played.to_owned() })
            }
            _ => Ok(Some(layer)),
        }
    }

    /// The same picture, without what says how it comes about: where it is rendered, what is left out or shown on the way, whether it is for a
    /// window, what the table was made from unless the judge or the colours of surfaces ask for it, and the light on surfaces that are not there. The text of this
    /// tells pictures apart.
    #[must_use]
    pub fn without_hints(self) -> Self {
        let without_hints = |tets: &mut TetLayer| {
            if !tets.needs_formula() {
                tets.formula = None;
            }
            if tets.surfaces.is_empty() && tets.domain.is_empty() && !tets.shading.volume {
                tets.shading = Default::default();
            }
        };
        Self {
            backend: Backend::default(),
            for_window: false,
            previews: Vec::new(),
            skip: Skip::default(),
            ..self.with_tets(without_hints)
        }
    }

    /// Whether two frames differ in nothing but the moment that they show.
    pub fn same_view(&self, other: &Self) -> bool {
        let rest = |r: &Self| (r.camera, r.size_px, r.layers.len(), r.guides, r.backend, r.for_window, r.skip);
        rest(self) == rest(other)
            && (&self.samples, self.upsampling) == (&other.samples, other.upsampling)
            && std::iter::zip(&self.layers, &other.layers).all(|(a, b)| a.looks_like(b))
    }
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
    /// It asks for what there cannot be.
    #[error(transparent)]
    Request(#[from] RequestError),
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
