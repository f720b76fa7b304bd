//! Frames of few rays, with details of an earlier frame added: for a player with a fixed camera.

use super::{DrawnBy, FrameRequest, RequestError, SampleSet, SharedFrame};
use crate::camera::{PixelSet, Samples, View};
use crate::image::RgbaImage;
use crate::render::residual::{Details, Residual};
use crate::render::{Planes, RenderJob};
use crate::stats::FrameStats;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Source of the details.
#[derive(Clone)]
pub enum ResidualBase {
    /// The colours of a frame of all rays of the same view ([`Self::exact`]); its other planes are no part of a request.
    Exact(Arc<dyn AsRef<RgbaImage> + Send + Sync>),
    /// Details of a frame of the same view ([`crate::render::Frame::details`]).
    Details(Arc<Details>),
}

impl ResidualBase {
    /// Details from a frame of all rays.
    pub fn exact(frame: SharedFrame) -> Self {
        Self::Exact(Arc::new(frame))
    }

    fn size_px(&self) -> (usize, usize) {
        match self {
            Self::Exact(frame) => ((**frame).as_ref().width, (**frame).as_ref().height),
            Self::Details(details) => details.size_px(),
        }
    }

    fn details(&self) -> Details {
        match self {
            Self::Exact(frame) => Details::of((**frame).as_ref()),
            Self::Details(details) => (**details).clone(),
        }
    }
}

impl fmt::Debug for ResidualBase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self {
            Self::Exact(_) => "Exact",
            Self::Details(_) => "Details",
        };
        f.debug_tuple(kind).field(&self.size_px()).finish()
    }
}

/// Compares by pointer, not by content.
impl PartialEq for ResidualBase {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Exact(a), Self::Exact(b)) => std::ptr::addr_eq(Arc::as_ptr(a), Arc::as_ptr(b)),
            (Self::Details(a), Self::Details(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// A frame of few rays with details of an earlier time ([`crate::render::residual`]).
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualRequest {
    /// Source of the details that the rays lack.
    pub base: ResidualBase,
    /// Bands that all rays are cast for, on the CPU, so that their details are of this time.
    pub anew: Range<usize>,
}

/// Details to be added to a frame of few rays.
#[derive(Debug)]
pub(super) struct AddDetails {
    request: ResidualRequest,
    /// The job of the renewed rows; `None` if there are none.
    anew: Option<RenderJob>,
}

impl AddDetails {
    /// Refuses requests that cannot use details.
    pub(super) fn check(request: &FrameRequest, by: DrawnBy) -> Result<(), RequestError> {
        let Some(residual) = &request.residual else { return Ok(()) };
        let is_whole = request.samples == SampleSet::All && request.upsampling.is_none();
        let problem = match by {
            _ if residual.base.size_px() != request.size_px => "they are of an image of another size",
            DrawnBy::Raycast if is_whole && request.may_have_details() => return Ok(()),
            _ => "they are for rays from cell to cell of a whole image without surfaces of the domain and without flow",
        };
        Err(RequestError::Details(problem))
    }

    /// The details to add to the image of a job.
    pub(super) fn of(residual: &ResidualRequest, job: &RenderJob) -> Result<Self, RequestError> {
        let size_px @ (width, _) = (job.view.width_px, job.view.height_px);
        let rows =
            Details::rows_of(residual.anew.start, size_px).start..Details::rows_of(residual.anew.end, size_px).start;
        let pixels: Vec<u32> = (rows.start * width..rows.end * width).map(|pixel| pixel as u32).collect();
        let anew = if pixels.is_empty() {
            None
        } else {
            let samples = Samples::Pixels(Arc::new(PixelSet::new(size_px, &pixels)?));
            Some(RenderJob { view: View { samples, ..job.view.clone() }, placed: None, ..job.clone() })
        };
        Ok(Self { request: residual.clone(), anew })
    }

    /// Takes the job of the renewed rows.
    pub(super) fn rows(&mut self) -> Option<RenderJob> {
        self.anew.take()
    }

    /// Enlarges planes to full size with details, which are returned; `rows` are the planes of [`Self::rows`], and its rendering time.
    pub(super) fn finish(
        self,
        planes: &mut Planes,
        rows: Option<&Planes>,
        renewed: Duration,
        stats: &mut FrameStats,
    ) -> Arc<Details> {
        let _span = tracing::info_span!("details").entered();
        let started = Instant::now();
        let mut residual = Residual::new(planes, self.request.base.details());
        if let Some(rows) = rows {
            let error = residual.renew(self.request.anew, &rows.color.pixels);
            (stats.pixels_anew, stats.residual_rmse) = (error.pixels, Some(error.rmse));
        }
        let (color, details) = residual.finish();
        planes.color = color;
        stats.ms_residual = (renewed + started.elapsed()).as_secs_f64() * 1e3;
        stats.ms_frame += stats.ms_residual;
        Arc::new(details)
    }
}
