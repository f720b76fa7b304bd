//! The first two stages of a frame: decode what it shows, order what is to be drawn.

use super::series::Series;
use super::steps::StepCache;
use super::{Backend, FaceDetail, FrameRequest, PipelineError, RenderMode};
use crate::camera::View;
use crate::codec::vq;
use crate::lod::Selector;
use crate::mesh::Mesh;
use crate::render::{CompressedStep, RenderJob};
use crate::stats::FrameStats;
use crate::task::{Cancel, ThreadLimit};
use crate::visibility::{CellSet, DepthOrder, DrawnFaces, finite_cells_unless};
use std::sync::{Arc, Weak};
use std::time::Instant;

/// What the first stage hands to the second.
#[derive(Debug)]
pub(super) struct Decoded {
    scalars: Arc<Vec<f32>>,
    compressed: Option<CompressedStep>,
    stats: FrameStats,
}

/// The first stage.
#[derive(Debug, Default)]
pub(super) struct Decode {
    steps: StepCache,
}

impl Decode {
    /// Buffers of scalars that it has.
    #[cfg(test)]
    pub(super) fn buffers(&self) -> usize {
        self.steps.buffers()
    }

    /// The scalars of a request.
    ///
    /// # Errors
    /// If a step cannot be read, or `Cancelled`.
    pub(super) fn run(
        &mut self,
        series: &Arc<Series>,
        request: &FrameRequest,
        cancel: &Cancel,
    ) -> Result<Decoded, PipelineError> {
        let started = Instant::now();
        let mut stats = FrameStats::default();
        let scalars = self.steps.show(series, request.time, cancel, &mut stats)?.ok_or(PipelineError::Cancelled)?;
        // A mixture of two steps is not in any block, and the CPU has no use for one.
        let is_for_gpu = request.backend != Backend::Cpu && request.drawn_by() == RenderMode::Raycast;
        let block = match request.time.toward() {
            None if is_for_gpu => series.source.vq_block(request.time.step())?,
            _ => None,
        };
        let compressed = block.map(|block| CompressedStep { block, step: request.time.step() % vq::STEPS });
        stats.ms_decode = started.elapsed().as_secs_f64() * 1e3;
        Ok(Decoded { scalars, compressed, stats })
    }
}

/// The second stage.
#[derive(Debug, Default)]
pub(super) struct Order {
    /// All cells of the mesh: renderers know a set by its place, and keep what they have made of it.
    all: Option<(Weak<Mesh>, Arc<CellSet>)>,
    /// The last set, and the scalars that it is for. Those are told by their place: while there is a weak reference to it, no
    /// others get it.
    last: Option<(Weak<Vec<f32>>, Arc<CellSet>)>,
    /// For modes that draw faces.
    selector: Selector,
    depth: DepthOrder,
}

impl Order {
    /// The job of a request whose scalars are there: its view and its active cells.
    ///
    /// # Errors
    /// If there is no view through the camera, or `Cancelled`.
    pub(super) fn run(
        &mut self,
        series: &Series,
        request: &FrameRequest,
        decoded: Decoded,
        cancel: &Cancel,
    ) -> Result<RenderJob, PipelineError> {
        let started = Instant::now();
        let view = request.camera.view(request.size_px.0, request.size_px.1)?;
        let Decoded { scalars, compressed, mut stats } = decoded;
        let active = self.active_cells(&series.mesh, &scalars, cancel).ok_or(PipelineError::Cancelled)?;
        let faces = match request.drawn_by() {
            RenderMode::Havs => Some(self.faces(series, request, &view, &active, cancel, &mut stats)?),
            _ => None,
        };
        stats.ms_order = started.elapsed().as_secs_f64() * 1e3;
        Ok(RenderJob {
            mesh: series.mesh.clone(),
            scalars,
            compressed,
            active,
            view,
            table: request.table.clone(),
            optics: request.optics,
            faces,
            k_buffer: request.faces.k_buffer,
            early_termination: true,
            cancel: cancel.clone(),
            thread_limit: ThreadLimit::none(),
            for_window: request.for_window,
            stats,
        })
    }

    /// The faces to draw, front to back.
    fn faces(
        &mut self,
        series: &Series,
        request: &FrameRequest,
        view: &View,
        active: &Arc<CellSet>,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<Arc<DrawnFaces>, PipelineError> {
        let FaceDetail { lod, sampling, .. } = request.faces;
        let ranking = if lod < 1.0 {
            series.ranking(request.time.step(), sampling, cancel)?.ok_or(PipelineError::Cancelled)?
        } else {
            series.any_ranking()
        };
        let selection = self.selector.select(&series.mesh, &ranking, lod, active);
        let (sorts, skipped) = (self.depth.sorts(), self.depth.sorts_skipped());
        let drawn = self.depth.order(&series.mesh, view.forward, &selection, cancel);
        stats.face_sorts = self.depth.sorts() - sorts;
        stats.face_sorts_skipped = self.depth.sorts_skipped() - skipped;
        drawn.ok_or(PipelineError::Cancelled)
    }

    /// The cells with four finite scalars; `None` if cancelled.
    fn active_cells(&mut self, mesh: &Arc<Mesh>, scalars: &Arc<Vec<f32>>, cancel: &Cancel) -> Option<Arc<CellSet>> {
        if let Some((of, active)) = &self.last
            && of.as_ptr() == Arc::as_ptr(scalars)
        {
            return Some(active.clone());
        }
        let finite = finite_cells_unless(&mesh.topology, scalars, cancel)?;
        let all = match &self.all {
            Some((of, all)) if of.as_ptr() == Arc::as_ptr(mesh) => all.clone(),
            _ => {
                let all = Arc::new(CellSet::all(mesh.topology.tets.len()));
                self.all.insert((Arc::downgrade(mesh), all)).1.clone()
            }
        };
        // The same set in the same place as before.
        let known = [Some(&all), self.last.as_ref().map(|(_, set)| set)];
        let known = known.into_iter().flatten().find(|set| ***set == finite).cloned();
        let active = known.unwrap_or_else(|| Arc::new(finite));
        self.last = Some((Arc::downgrade(scalars), active.clone()));
        Some(active)
    }
}
