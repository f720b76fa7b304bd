//! What frames look like, and the requests for them.

use super::moments::{Followed, Moments};
use super::session::Drawing;
use super::still::Still;
use crate::camera::{Camera, CameraError};
use crate::node_table::{NodeTable, TransferTable};
use crate::optics::OpticsKind;
use crate::pipeline::{
    Backend, FaceDetail, FrameRequest, FrameTime, RenderMode, Series, SurfaceLook, SurfaceMoment, TetDraw,
};
use crate::playback::quality::Quality;
use crate::project::{Moment, Project};
use crate::render::Contrast;
use crate::task::Cancel;
use crate::transfer::{
    FirstLook, Lengths, MappedRange, OpacityKind, RangePolicy, TransferContent, TransferError, TransferFunction,
    TransferSource, build_node_table,
};
use crate::visibility::Skip;
use std::sync::Arc;

/// The transfer function of those who do not choose one: that of [`FirstLook`].
pub const DEFAULT_TF: &str = "auto";

/// All that frames of a field have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Where from.
    pub camera: Camera,
    /// Colours and opacities.
    pub tf: TransferFunction,
    /// Scalars that they cover.
    pub range: RangePolicy,
    /// What opacities mean.
    pub opacity_kind: OpacityKind,
    /// The length that they refer to, and that of the longest path.
    pub lengths: Lengths,
    /// Which renderer.
    pub mode: RenderMode,
    /// Which faces are drawn, where faces are.
    pub faces: FaceDetail,
    /// Where it runs.
    pub backend: Backend,
    /// How segments are integrated.
    pub optics: OpticsKind,
    /// Isosurfaces, and whether the volume is drawn.
    pub surfaces: SurfaceLook,
    /// What may be left out.
    pub skip: Skip,
    /// What a project says instead, if there is one.
    pub followed: Followed,
}

/// The scalars that a transfer function covers at a moment of a field ([`FrameTime::scalar_ranges`]).
///
/// # Errors
/// As [`RangePolicy::resolve`], and if percentiles are asked for and a step cannot be read.
pub fn mapped_range(series: &Series, policy: &RangePolicy, time: FrameTime) -> Result<MappedRange, TransferError> {
    let (all, step) = time.scalar_ranges(series.field());
    series.settled(policy)?.resolve(all, step)
}

impl Look {
    /// A mesh framed, the range of all steps, opacities per 1 % of the diagonal of its box.
    ///
    /// # Errors
    /// If the mesh has no extent that a camera can frame.
    pub fn default_for(series: &Series, tf: TransferFunction) -> Result<Self, CameraError> {
        let bounds = series.mesh().positions.world_bounds();
        let (range, opacity_kind, mode, faces, backend, optics, surfaces, skip, followed) = Default::default();
        let camera = Camera::default_for(bounds)?;
        // A mesh without extent is refused when it is built, so the diagonal is positive.
        let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
        Ok(Self { camera, tf, range, opacity_kind, lengths, mode, faces, backend, optics, surfaces, skip, followed })
    }

    /// The look with colours, opacities and a range that suit the values of the series.
    ///
    /// # Errors
    /// If the mesh has no extent that a camera can frame.
    pub fn first_for(series: &Series, cancel: &Cancel) -> Result<Self, CameraError> {
        let FirstLook { tf, range, .. } = series.first_look(None, cancel);
        Ok(Self { range, ..Self::default_for(series, tf)? })
    }

    /// Whether colours, opacities and range are those.
    pub(super) fn is_first(&self, first: &FirstLook) -> bool {
        (self.range, &self.tf) == (first.range, &first.tf)
    }

    /// What the table over a range is made from.
    pub fn source(&self, range: &MappedRange) -> TransferSource {
        let content = TransferContent::Function { function: self.tf.clone(), range: *range };
        TransferSource { content, kind: self.opacity_kind, lengths: self.lengths }
    }

    /// The table over a range.
    ///
    /// # Errors
    /// As [`build_node_table`].
    pub fn table(&self, range: &MappedRange) -> Result<NodeTable, TransferError> {
        build_node_table(&self.tf, range, self.opacity_kind, &self.lengths)
    }
}

/// Tables made lately: with a range for each step, as many as frames on their way.
const TABLES_KEPT: usize = 4;

/// A table, and what it was made from.
type Colors = (TransferTable, Option<Arc<TransferSource>>);

/// Makes requests, and tables only when they change.
#[derive(Default)]
pub(super) struct Requests {
    /// What a project says, if there is one.
    moments: Option<Moments>,
    /// What the tables are for.
    tables_of: Option<Look>,
    tables: Vec<(MappedRange, Colors)>,
    /// Why the last table could not be made.
    pub(super) problem: Option<String>,
    /// Whether frames may stay on the GPU of the window.
    pub(super) for_window: bool,
    /// Contrasts that are shown on the way to a picture in full.
    pub(super) previews: Vec<Contrast>,
    /// Details of earlier frames, while their view stays.
    pub(super) still: Option<Still>,
}

impl Requests {
    /// With a project, whose moments come before looks.
    pub(super) fn of(moments: Option<Moments>) -> Self {
        Self { moments, ..Self::default() }
    }

    /// The project.
    pub(super) fn project(&self) -> Option<&Arc<Project>> {
        self.moments.as_ref().map(Moments::project)
    }

    /// Whether a moment of the project is being worked out.
    pub(super) fn is_waiting(&self) -> bool {
        self.moments.as_ref().is_some_and(Moments::is_waiting)
    }

    /// Takes what has been worked out.
    pub(super) fn collect(&mut self) {
        if let Some(moments) = &mut self.moments {
            moments.collect();
        }
    }

    /// The request for a moment; `None`: what the project says is not known yet. `size` is that of an image in full, `choose` says how it is
    /// drawn. If there is no table for the moment, an empty one, and [`Self::problem`] says why.
    pub(super) fn make(
        &mut self,
        look: &Look,
        series: &Arc<Series>,
        time: FrameTime,
        size: (usize, usize),
        choose: &mut dyn FnMut(Drawing) -> Quality,
    ) -> Option<FrameRequest> {
        let said = match &mut self.moments {
            None => Ok(Moment::default()),
            Some(moments) => moments.at(look, series, time)?,
        };
        let made = said.and_then(|said| {
            let colors = match &said.table {
                Some(table) => (table.clone(), said.formula.clone()),
                None => self.colors(look, series, time).map_err(|error| error.to_string())?,
            };
            Ok((said, colors))
        });
        let (said, (table, formula)) = made.unwrap_or_else(|error| {
            self.problem = Some(format!("field {}: {error}", series.field().name));
            (Moment::default(), (Arc::new(NodeTable::clear()).into(), None))
        });
        let Look { mode, faces, backend, skip, followed, .. } = *look;
        let camera = said.camera.filter(|_| followed.camera).unwrap_or(look.camera);
        let lod = said.lod.filter(|_| followed.lod).unwrap_or(faces.lod);
        let optics = said.optics.filter(|_| followed.optics).unwrap_or(look.optics);
        let for_window = self.for_window;
        let request = FrameRequest::new(time, camera, table, size);
        let request = request.with_tets(|tets| {
            tets.draw = TetDraw::chosen(mode, FaceDetail { lod: 1.0, ..faces });
            (tets.optics, tets.formula) = (optics, formula);
            let moment = if followed.surfaces { said.surfaces } else { SurfaceMoment::default() };
            tets.show(&look.surfaces.at(moment));
        });
        let request = FrameRequest { backend, for_window, skip, ..request };
        let has_rays = request.may_leave_rays_out();
        // Whoever may leave rays out may give them details, but on the surface of the domain.
        let is_of_cells = request.tets().is_some_and(|tets| tets.domain.is_empty());
        let has_details = has_rays && is_of_cells && self.still.as_ref().is_some_and(|still| still.is_of(&request));
        let quality = choose(Drawing { mode, lod, has_rays, has_details });
        let still = self.still.as_mut().filter(|_| quality == Quality::Details);
        let request = FrameRequest { residual: still.map(Still::next), ..request };
        let previews = if quality == Quality::Exact { self.previews.clone() } else { Vec::new() };
        Some(quality.of_request(FrameRequest { previews, ..request }, faces))
    }

    fn colors(&mut self, look: &Look, series: &Series, time: FrameTime) -> Result<Colors, TransferError> {
        let range = mapped_range(series, &look.range, time)?;
        let is_for = |of: &Look| of.tf == look.tf && of.opacity_kind == look.opacity_kind && of.lengths == look.lengths;
        if !self.tables_of.as_ref().is_some_and(is_for) {
            self.tables.clear();
            self.tables_of = Some(look.clone());
        }
        if let Some((_, colors)) = self.tables.iter().find(|(made, _)| *made == range) {
            return Ok(colors.clone());
        }
        let colors = (Arc::new(look.table(&range)?).into(), Some(Arc::new(look.source(&range))));
        if self.tables.len() == TABLES_KEPT {
            self.tables.remove(0);
        }
        self.tables.push((range, colors.clone()));
        Ok(colors)
    }
}
