//! Requests to a pipeline, and the errors that they can end in.

use super::text::{as_text, size_px};
use super::{
    Backend, DrawnBy, FlowLayer, FrameTime, Layer, RequestError, ResidualRequest, SampleSet, TetDraw, TetLayer,
    Upsampling,
};
use crate::camera::{Camera, CameraError};
use crate::error::FileError;
use crate::mesh::Mesh;
use crate::node_table::TransferTable;
use crate::render::{Contrast, RenderError};
use crate::visibility::Skip;
use serde::{Deserialize, Serialize};

/// All that a frame of a series depends on. Plain data, cheap to clone; [`Self::to_text`] gives it as text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameRequest {
    /// Zero-based step of the store, or a time between two steps.
    pub time: FrameTime,
    /// Camera.
    pub camera: Camera,
    /// Width and height in pixels.
    #[serde(deserialize_with = "size_px")]
    pub size_px: (usize, usize),
    /// The layers to draw; nothing without one.
    pub layers: Vec<Layer>,
    /// The pixels that are rendered, which the planes of the frame have.
    #[serde(default)]
    pub samples: SampleSet,
    /// Size of an image that is rendered with all of its rays and enlarged to the frame; `None` renders the frame itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upsampling: Option<Upsampling>,
    /// Whether the frame has planes of the normals and numbers of its surfaces, if any.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub guides: bool,
    /// The backend.
    #[serde(default)]
    pub backend: Backend,
    /// Whether the frame is for a window: rendered on the window's GPU (`WindowGpu`) it stays there. The picture is the same.
    #[serde(skip)]
    pub for_window: bool,
    /// Falling contrasts at which previews are delivered, with rays from cell to cell ([`Delivery::is_final`](super::Delivery::is_final)).
    /// The final frame is the same. A newer request replaces one with previews even while it is rendered.
    #[serde(skip)]
    pub previews: Vec<Contrast>,
    /// Details of an earlier frame, which replace most of the rays: the frame is then close to the exact one, and depends on that earlier
    /// frame. For players; never cached, and in no text.
    #[serde(skip)]
    pub residual: Option<ResidualRequest>,
    /// The work that may be skipped. The picture is the same.
    #[serde(default, with = "as_text")]
    pub skip: Skip,
}

impl FrameRequest {
    /// The volume of a series, with everything else at its default ([`TetLayer::new`]).
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

    /// The layer of cells; `None` without one.
    pub fn tets(&self) -> Option<&TetLayer> {
        self.layers.iter().find_map(Layer::tets)
    }

    /// The layer of flow, if any.
    ///
    /// # Errors
    /// If there are two.
    pub(super) fn flow(&self) -> Result<Option<&FlowLayer>, RequestError> {
        let mut layers = self.layers.iter().enumerate().filter_map(|(at, layer)| Some((at, layer.flow()?)));
        match (layers.next(), layers.next()) {
            (Some((first, _)), Some((second, _))) => Err(RequestError::TwoOfFlow { first, second }),
            (found, _) => Ok(found.map(|(_, layer)| layer)),
        }
    }

    /// Whether it shows a moment that is held while its flow goes on. Such a frame does not come again.
    pub(super) fn holds_flow(&self) -> bool {
        self.layers.iter().any(|layer| layer.flow().is_some_and(|flow| flow.is_seen() && flow.held > 0.0))
    }

    /// The request with the flow of its moment gone on for a time, in the series' unit, averaged over that between two frames; as it is
    /// without flow.
    #[must_use]
    pub fn holding(mut self, held: f64, shutter: f64) -> Self {
        if let Some(Layer::Flow(flow)) = self.layers.iter_mut().find(|layer| layer.flow().is_some()) {
            (flow.held, flow.shutter) = (held, shutter);
        }
        self
    }

    /// The request with the patterns of its flow averaged over a time, in the series' unit: that until the next frame of a series that
    /// plays; as it is without flow.
    #[must_use]
    pub fn with_shutter(self, shutter: f64) -> Self {
        self.holding(0.0, shutter)
    }

    /// The request with its layer of cells changed, if there is one.
    #[must_use]
    pub fn with_tets(mut self, change: impl FnOnce(&mut TetLayer)) -> Self {
        if let Some(layer) = self.layers.iter_mut().find_map(Layer::tets_mut) {
            change(layer);
        }
        self
    }

    /// The request with another way to draw its cells.
    #[must_use]
    pub fn with_draw(self, draw: TetDraw) -> Self {
        self.with_tets(|tets| tets.draw = draw)
    }

    /// The request with its cells drawn as is chosen for a mesh, [`TetDraw::on`].
    #[must_use]
    pub fn on(self, mesh: &Mesh) -> Self {
        self.with_tets(|tets| tets.draw = tets.draw.on(mesh))
    }

    /// The share of the interior faces, or of the fragments of points, that is drawn; 1 where whole cells are.
    pub fn lod(&self) -> f64 {
        self.tets().map_or(1.0, |tets| tets.draw.lod())
    }

    /// Whether contrast may decide which rays are cast ([`SampleSet::Adaptive`]): they must go from cell to cell, without screen-space
    /// light.
    pub fn may_leave_rays_out(&self) -> bool {
        let may = |tets: &TetLayer| {
            matches!(tets.draw.drawn_by(), DrawnBy::Raycast)
                && !(tets.shading.is_of_screen() && !(tets.surfaces.is_empty() && tets.domain.is_empty()))
        };
        !self.guides && self.upsampling.is_none() && self.tets().is_some_and(may)
    }

    /// Whether few rays may have the details of an earlier frame ([`ResidualRequest`](super::ResidualRequest)): rays may be left out, and
    /// all that is seen is in the cells. Patterns of flow move on.
    pub fn may_have_details(&self) -> bool {
        let is_of_cells = self.tets().is_some_and(|tets| tets.domain.is_empty());
        self.may_leave_rays_out() && is_of_cells && !self.layers.iter().any(|layer| layer.flow().is_some())
    }

    /// Whether its cells are drawn as points, of which some may be left out: without isosurfaces and sections, which lie in the cells
    /// themselves.
    pub fn may_leave_points_out(&self) -> bool {
        let may = |tets: &TetLayer| {
            let has_sections = tets.cuts.iter().any(|cut| !cut.clips);
            tets.draw.drawn_by().points().is_some() && tets.surfaces.is_empty() && !has_sections
        };
        self.tets().is_some_and(may)
    }

    /// The one layer of cells, if any, checked against the name of the series' field.
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

    /// The request reduced to what the picture depends on: without backend, skipping, previews and window, without the table's source
    /// unless the reference or surface colours need it, and without light on absent surfaces. Its text identifies the picture.
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

    /// Whether two requests show the same moment: the same time, of which the flow has gone on for as long and is averaged over as long.
    pub fn same_moment(&self, other: &Self) -> bool {
        let of_flow = |r: &Self| r.layers.iter().find_map(Layer::flow).map(|flow| (flow.held, flow.shutter));
        self.time == other.time && of_flow(self) == of_flow(other)
    }

    /// Whether two requests show the same view, whatever their times and [shutters](FlowLayer::shutter).
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
    /// The camera has no valid view.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The request was cancelled.
    #[error("cancelled")]
    Cancelled,
    /// The request is invalid.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// Mesh and field do not belong together, or the GPU failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A stage panicked: a bug in tetreel. The frame is lost; the stage is reset for the next one.
    #[error("tetreel failed at this frame while it was to {stage} it: {message}; please report this")]
    Panicked {
        /// Stage that panicked: `decode`, `order`, `render`.
        stage: &'static str,
        /// Message of the panic.
        message: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ConnectivityChoice;
    use crate::mesh::test_meshes::kuhn_grid;
    use crate::node_table::NodeTable;
    use crate::pipeline::test_series;
    use crate::render::points::PointStyle;
    use crate::render::surfaces::{Cut, Isosurface};
    use glam::DVec3;
    use std::sync::Arc;

    fn request(draw: TetDraw) -> FrameRequest {
        let camera = Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap();
        FrameRequest::new(0, camera, Arc::new(NodeTable::transparent()), (32, 24)).with_draw(draw)
    }

    #[test]
    fn points_may_be_left_out_where_nothing_lies_in_the_cells() {
        let points = request(TetDraw::Points(PointStyle::EXACT));
        assert!(points.may_leave_points_out());
        for draw in [TetDraw::Auto, TetDraw::Raycast, TetDraw::ALL_FACES, TetDraw::Reference] {
            assert!(!request(draw).may_leave_points_out(), "{draw:?}");
        }
        let iso = points.clone().with_tets(|tets| tets.surfaces = vec![Isosurface::new(0.5)]);
        let [section, clip] = [false, true].map(|clips| {
            let cut = Cut { point: [0.5; 3], normal: [1.0, 0.0, 0.0], clips, by: None };
            points.clone().with_tets(|tets| tets.cuts = vec![cut])
        });
        assert_eq!([iso, section, clip].map(|request| request.may_leave_points_out()), [false, false, true]);
    }

    #[test]
    fn a_request_is_of_points_on_a_mesh_without_connectivity_unless_another_way_is_chosen() {
        let torn = Mesh::build_as(kuhn_grid([1; 3]), ConnectivityChoice::None).unwrap().0;
        let points = request(TetDraw::Points(PointStyle::EXACT));
        assert_eq!(request(TetDraw::Auto).on(&torn), points);
        assert_eq!(request(TetDraw::Auto).on(&test_series::mesh()), request(TetDraw::Auto));
        assert_eq!(request(TetDraw::Raycast).on(&torn), request(TetDraw::Raycast));
    }
}
