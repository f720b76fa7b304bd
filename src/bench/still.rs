//! The part of the motion suite with a still camera: the error of details reused from an earlier step.

use crate::image::{RgbaImage, compare_raw};
use crate::pipeline::{
    FrameRequest, ImageScale, Pipeline, PipelineError, ResidualBase, ResidualRequest, UpsampleFilter, Upsampling,
};
use crate::render::residual::Details;
use crate::task::{Cancel, Progress};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// Number of steps compared with the first one.
const STEPS: usize = 16;

/// Errors at a number of steps after a frame of all rays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StillRow {
    /// Steps since the frame of all rays.
    pub steps: usize,
    /// Milliseconds of all stages for four ways: all rays; few rays with details; few rays with details, partly made anew; a small image.
    pub ms: [f64; 4],
    /// RMSE of raw accumulators of the last three ways against all rays.
    pub rmse: [f64; 3],
}

/// Results for a series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StillRun {
    /// Name of the data set.
    pub dataset: String,
    /// Cells of its mesh.
    pub cells: u64,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// Results step by step.
    pub rows: Vec<StillRow>,
}

/// Draws the steps of a series, up to the 17th, in all four ways; `None` if its rays cannot be reduced.
///
/// # Errors
/// If a step cannot be read, the camera has no view, or `cancel` was raised.
pub fn run_still(
    pipeline: &mut Pipeline,
    dataset: &str,
    request: &FrameRequest,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Option<StillRun>, PipelineError> {
    let request = &request.clone().on(pipeline.mesh());
    let has_domain = request.tets().is_some_and(|tets| !tets.domain.is_empty());
    if !request.may_leave_rays_out() || has_domain {
        return Ok(None);
    }
    let filter = UpsampleFilter::Bilinear;
    let small = FrameRequest { upsampling: Some(Upsampling { scale: ImageScale::Quarter, filter }), ..request.clone() };
    let exact = pipeline.render_unless(&FrameRequest { time: 0.into(), ..request.clone() }, cancel)?;
    let first = Arc::new(Details::of(&exact.planes.color));
    let (mut renewed, bands) = (first.clone(), Details::count(request.size_px));
    let per_frame = Details::per_frame(request.size_px);
    let mut rows = Vec::new();
    for step in 1..pipeline.times().len().min(STEPS + 1) {
        let with = |details: &Arc<Details>, anew| FrameRequest {
            residual: Some(ResidualRequest { base: ResidualBase::Details(details.clone()), anew }),
            ..request.clone()
        };
        let band = (step - 1) * per_frame % bands;
        let anew = band..(band + per_frame).min(bands);
        let (mut ms, mut images): ([f64; 4], Vec<RgbaImage>) = ([0.0; 4], Vec::new());
        let ways = [request.clone(), with(&first, 0..0), with(&renewed, anew), small.clone()];
        for (way, ms) in ways.into_iter().zip(&mut ms) {
            let frame = pipeline.render_unless(&FrameRequest { time: step.into(), ..way }, cancel)?;
            *ms = frame.stats.ms_worked();
            images.push(frame.planes.color.clone());
            if frame.stats.pixels_anew > 0 {
                renewed = frame.details.clone().unwrap_or(renewed);
            }
        }
        let rmse =
            |image: &RgbaImage| compare_raw(image, &images[0]).map_or(f64::INFINITY, |difference| difference.rmse);
        rows.push(StillRow { steps: step, ms, rmse: [rmse(&images[1]), rmse(&images[2]), rmse(&images[3])] });
        progress.advance(1);
    }
    Ok(Some(StillRun {
        dataset: dataset.to_owned(),
        cells: pipeline.mesh().topology.tets.len() as u64,
        size: [request.size_px.0 as u32, request.size_px.1 as u32],
        rows,
    }))
}

impl fmt::Display for StillRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { dataset, cells, size: [width, height], rows } = self;
        writeln!(f, "\n{dataset}: {cells} cells, {width} x {height}, the camera still")?;
        writeln!(f, "| steps since | all rays | details | made anew | image 1/4 |\n|---|---|---|---|---|")?;
        for StillRow { steps, ms, rmse } in rows {
            let [exact, details, renewed, small] = ms;
            let [of_details, of_renewed, of_small] = rmse;
            writeln!(
                f,
                "| {steps} | {exact:.1} ms | {details:.1} ms, {of_details:.1e} | {renewed:.1} ms, {of_renewed:.1e} | {small:.1} ms, {of_small:.1e} |"
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::node_table::{Node, NodeTable};
    use crate::pipeline::{Backend, TetDraw, test_series};
    use crate::task::Silent;

    #[test]
    fn each_step_is_drawn_in_four_ways_and_a_small_image_is_off_by_most() {
        let mut pipeline = Pipeline::new(test_series::jet());
        let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
        let node = |scalar, tau| Node { scalar, rgb: [1.0; 3], tau };
        let table = NodeTable::new(vec![node(0.0, 0.1), node(1.0, 3.0)]).unwrap();
        let request = FrameRequest::new(0, camera, Arc::new(table), (64, 48));
        let request = FrameRequest { backend: Backend::Cpu, ..request };
        let run = |request: &FrameRequest, pipeline: &mut Pipeline| {
            run_still(pipeline, "jet", request, &Silent, &Cancel::new()).unwrap()
        };
        let held = run(&request, &mut pipeline).unwrap();
        assert_eq!(held.rows.len(), pipeline.times().len().min(STEPS + 1) - 1);
        for row in &held.rows {
            assert!(row.ms.iter().all(|ms| *ms > 0.0) && row.rmse[0] < row.rmse[2] && row.rmse[1] > 0.0, "{row:?}");
        }
        assert!(held.to_string().contains("| 1 |"));
        assert!(run(&request.with_draw(TetDraw::ALL_FACES), &mut pipeline).is_none());
    }
}
