//! Enlarging the rendered small image to the requested frame, on the CPU; the GPU enlarges its own images ([`Enlargement`]).

use super::{UpsampleFilter, Upsampling};
use crate::camera::View;
use crate::image::upsample::{self, Enlarging, JointKernel, Reference};
use crate::image::{Planes, RgbaImage};
use crate::render::RenderJob;
use crate::render::cpu::layers::BoundaryDepths;
use crate::render::upsampling::Enlargement;
use crate::stats::FrameStats;
use std::sync::Arc;
use std::time::Instant;

/// The enlargement pending for an image that is rendered at another size than its frame.
#[derive(Debug)]
pub(super) struct Enlarge {
    filter: UpsampleFilter,
    enlarging: Enlarging,
    /// The job at full size, and at the rendered size; its cells are the same whatever is skipped.
    full: RenderJob,
    small_view: View,
    /// Whether the image is transparent, as one without cells is.
    is_transparent: bool,
}

impl Enlarge {
    /// The enlargement of a job's image to the size of `view`.
    pub(super) fn of(upsampling: Upsampling, job: &RenderJob, view: View) -> Self {
        let enlarging = upsampling.enlarging((view.width_px, view.height_px));
        let active = job.domain.as_ref().unwrap_or(&job.active).clone();
        let full = RenderJob { active, view, placed: None, faces: None, fragments: None, flow: None, ..job.clone() };
        let is_transparent = job.active.count() == 0 && !job.has_other_layers();
        Self { filter: upsampling.filter, enlarging, full, small_view: job.view.clone(), is_transparent }
    }

    /// The GPU's parameters for enlarging the image.
    pub(super) fn enlargement(&self) -> Arc<Enlargement> {
        let Self { filter, enlarging, full, .. } = self;
        let (view, domain) = (full.view.clone(), full.active.clone());
        Arc::new(Enlargement { filter: *filter, enlarging: *enlarging, view, domain })
    }

    /// Enlarges planes to full size, and counts; false if the job was cancelled: the planes are then unusable.
    pub(super) fn finish(self, planes: &mut Planes, stats: &mut FrameStats) -> bool {
        let _span = tracing::info_span!("upsample").entered();
        let started = Instant::now();
        let Some(color) = self.color(&planes.color, stats) else { return false };
        planes.color = color;
        planes.depth = upsample::nearest(&planes.depth, &self.enlarging);
        planes.normal = upsample::nearest(&planes.normal, &self.enlarging);
        planes.id = upsample::nearest(&planes.id, &self.enlarging);
        let ms = started.elapsed().as_secs_f64() * 1e3;
        stats.ms_upsample = ms - stats.ms_depth_layers;
        stats.ms_frame += ms;
        true
    }

    /// The colours at full size; `None` if the job was cancelled.
    fn color(&self, color: &RgbaImage, stats: &mut FrameStats) -> Option<RgbaImage> {
        let enlarging = &self.enlarging;
        match self.filter {
            _ if self.is_transparent => Some(upsample::nearest(color, enlarging)),
            UpsampleFilter::Nearest => Some(upsample::nearest(color, enlarging)),
            UpsampleFilter::Bilinear => Some(upsample::bilinear(color, enlarging)),
            UpsampleFilter::Joint { kernel_px, edges } => {
                let [reference] = self.references([&self.full.view], edges.layers, stats)?;
                let kernel = JointKernel { kernel_px, sigma_reference: edges.sigma_depth };
                upsample::joint(&upsample::bilinear(color, enlarging), &reference, kernel, &self.full.cancel)
            }
            UpsampleFilter::Joint2x2 { edges } => {
                let views = [&self.full.view, &self.small_view];
                let [full, small] = self.references(views, edges.layers, stats)?;
                let (color, fell_back) = upsample::joint2x2(color, enlarging, [&full, &small], edges.sigma_depth);
                stats.upsample_fallbacks = fell_back;
                Some(color)
            }
        }
    }

    /// Depths of the boundary in some views, normalized by the range of the first view; `None` if the job was cancelled.
    fn references<const N: usize>(
        &self,
        views: [&View; N],
        layers: usize,
        stats: &mut FrameStats,
    ) -> Option<[Reference; N]> {
        let _span = tracing::info_span!("depth layers").entered();
        let started = Instant::now();
        let mut found =
            views.map(|view| BoundaryDepths::of(&RenderJob { view: view.clone(), ..self.full.clone() }, layers));
        let range = found.first()?.as_ref()?.range.unwrap_or([0.0, 0.0]);
        let references = found.each_mut().map(|depths| depths.take().map(|depths| depths.reference(range)));
        stats.depth_layers = (N * layers) as u64;
        stats.ms_depth_layers = started.elapsed().as_secs_f64() * 1e3;
        let references: Vec<Reference> = references.into_iter().collect::<Option<_>>()?;
        references.try_into().ok()
    }
}
