//! Makes the requests for frames of a window.

use super::motion::Drawing;
use super::project_worker::ProjectWorker;
use super::still::Still;
use crate::look::{Colors, Keyed, Look, mapped_range};
use crate::node_table::NodeTable;
use crate::pipeline::{FaceDetail, FrameRequest, FrameTime, Series, TetDraw};
use crate::playback::quality::Quality;
use crate::render::Contrast;
use crate::transfer::{MappedRange, TransferError};
use std::convert::Infallible;
use std::sync::Arc;

/// Number of recent tables kept: with a range for each step, as many as pending frames.
const TABLES_KEPT: usize = 4;

/// Makes requests; rebuilds tables only when they change.
#[derive(Default)]
pub(super) struct Requests {
    /// The project, if there is one.
    pub(super) project: Option<ProjectWorker>,
    /// The look that the tables are for.
    tables_of: Option<Look>,
    tables: Vec<(MappedRange, Colors)>,
    /// Problem of the last table.
    pub(super) problem: Option<String>,
    /// Whether frames may stay on the GPU of the window.
    pub(super) for_window: bool,
    /// Contrasts of the previews of a picture in full.
    pub(super) previews: Vec<Contrast>,
    /// Details of earlier frames of the same view.
    pub(super) still: Option<Still>,
}

impl Requests {
    /// Requests with a project, which overrides looks.
    pub(super) fn of(project: Option<ProjectWorker>) -> Self {
        Self { project, ..Self::default() }
    }

    /// The request for a time; `None`: the project's settings are pending. `size` is that of an image in full, `choose` returns the
    /// quality. If the table cannot be made, it is empty, and [`Self::problem`] says why.
    pub(super) fn make(
        &mut self,
        look: &Look,
        series: &Arc<Series>,
        time: FrameTime,
        size: (usize, usize),
        choose: &mut dyn FnMut(Drawing) -> Quality,
    ) -> Option<FrameRequest> {
        let keyed = match &mut self.project {
            None => Ok(Keyed::default()),
            Some(project) => project.at(look, series, time)?,
        };
        let made = keyed.and_then(|keyed| {
            let own = || self.colors(look, series, time).map_err(|error| error.to_string());
            Ok((look.request(time, size, &keyed, own)?, look.lod_at(&keyed)))
        });
        let (request, lod) = match made {
            Ok(made) => made,
            Err(error) => {
                self.problem = Some(format!("field {}: {error}", series.field().name));
                let none = || Ok(Colors { table: Arc::new(NodeTable::transparent()).into(), formula: None });
                let Ok::<_, Infallible>(request) = look.request(time, size, &Keyed::default(), none);
                (request, look.faces.lod)
            }
        };
        let Look { mode, faces, .. } = *look;
        // The level of detail follows from the quality chosen below.
        let request = request.with_tets(|tets| tets.draw = TetDraw::chosen(mode, FaceDetail { lod: 1.0, ..faces }));
        let request = FrameRequest { for_window: self.for_window, ..request };
        let has_rays = request.may_leave_rays_out();
        // A request that may leave out rays may use details, but not with the surface of the domain.
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
        let colors = look.colors(&range)?;
        if self.tables.len() == TABLES_KEPT {
            self.tables.remove(0);
        }
        self.tables.push((range, colors.clone()));
        Ok(colors)
    }
}
