//! Makes the requests for frames of a window.

use super::motion::Drawing;
use super::project_worker::ProjectWorker;
use super::still::Still;
use crate::look::{Colors, Keyed, Look};
use crate::node_table::NodeTable;
use crate::pipeline::{FaceDetail, FrameRequest, FrameTime, RenderMode, Series};
use crate::playback::State;
use crate::playback::quality::Quality;
use crate::project::Project;
use crate::render::Contrast;
use std::convert::Infallible;
use std::sync::Arc;

/// Makes requests.
pub(super) struct Requests {
    /// Evaluates the project.
    pub(super) worker: ProjectWorker,
    /// Problem of the last table.
    pub(super) problem: Option<String>,
    /// Whether frames may stay on the GPU of the window.
    pub(super) for_window: bool,
    /// Contrasts of the previews of a picture in full.
    pub(super) previews: Vec<Contrast>,
    /// Details of earlier frames of the same view.
    pub(super) still: Option<Still>,
    /// A moment that is held while its flow goes on: for how long, and by how much since the last frame, in the series' unit.
    pub(super) held: Option<(FrameTime, f64, f64)>,
    /// Over which time of the series patterns of flow are averaged at other moments.
    pub(super) shutter: Shutter,
}

/// For how long frames show the flow that goes on while the series plays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Shutter {
    /// It stands still.
    #[default]
    Closed,
    /// It is played like this, with so many frames a second in real time: a frame is open until the next one.
    Played(State, f64),
    /// Another session leads, whose frame is open for this time.
    Led(f64),
}

impl Shutter {
    /// The time of the series for which it is open at a frame.
    pub(super) fn of(&self, series: &Series, time: FrameTime) -> f64 {
        match self {
            Self::Closed => 0.0,
            Self::Played(state, fps) => state.interval(series.times(), time, *fps),
            Self::Led(open) => *open,
        }
    }
}

impl Requests {
    /// Requests by this worker.
    pub(super) fn of(worker: ProjectWorker) -> Self {
        Self {
            worker,
            problem: None,
            for_window: false,
            previews: Vec::new(),
            still: None,
            held: None,
            shutter: Shutter::Closed,
        }
    }

    /// The request for a time of a project, whose settings come before those of the look; `None`: they are pending. `size` is that of an
    /// image in full, `choose` returns the quality. If the table cannot be made, it is empty, and [`Self::problem`] says why.
    pub(super) fn make(
        &mut self,
        project: &Arc<Project>,
        look: &Look,
        series: &Arc<Series>,
        time: FrameTime,
        size: (usize, usize),
        choose: &mut dyn FnMut(Drawing) -> Quality,
    ) -> Option<FrameRequest> {
        let keyed = self.worker.at(project, look, series, time)?.unwrap_or_else(|error| {
            self.problem = Some(format!("field {}: {error}", series.field().name));
            Keyed::default()
        });
        let none = || Ok(Colors { table: Arc::new(NodeTable::transparent()).into(), formula: None });
        let Ok::<_, Infallible>(request) = look.request(time, size, &keyed, none);
        let lod = look.lod_at(&keyed);
        let faces = look.faces;
        let mode = look.mode.on(series.mesh());
        // The level of detail of faces follows from the quality chosen below, that of points from this one and the quality.
        let all = if mode == RenderMode::Points { lod } else { 1.0 };
        let draw = look.draw(mode, FaceDetail { lod: all, ..faces });
        let request = request.with_draw(draw);
        let request = match self.held {
            Some((moment, held, shutter)) if moment == time => request.holding(held, shutter),
            _ => match self.shutter.of(series, time) {
                open if open > 0.0 => request.with_shutter(open),
                _ => request,
            },
        };
        let request = FrameRequest { for_window: self.for_window, ..request };
        let has_rays = request.may_leave_rays_out();
        let has_details = request.may_have_details() && self.still.as_ref().is_some_and(|still| still.is_of(&request));
        let has_points = request.may_leave_points_out();
        let quality = choose(Drawing { mode, lod, has_rays, has_details, has_points });
        let still = self.still.as_mut().filter(|_| quality == Quality::Details);
        let request = FrameRequest { residual: still.map(Still::next), ..request };
        let previews = if quality == Quality::Exact { self.previews.clone() } else { Vec::new() };
        Some(quality.of_request(FrameRequest { previews, ..request }, faces))
    }
}
