//! The motion suite: how well a frame rate is held while camera and time move, and the error.

use super::Spread;
use crate::camera::{Camera, CameraError};
use crate::image::upsample::{Enlarging, bilinear};
use crate::image::{RgbaImage, compare_raw};
use crate::pipeline::{FaceDetail, FrameRequest, Pipeline, PipelineError};
use crate::playback::quality::{Family, Quality, QualityControl, Wanted};
use crate::task::{Cancel, Progress};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;

/// Degrees that the camera turns from frame to frame.
const TURN_DEG: f64 = 1.5;
/// Frames before the control has settled.
const SETTLED: usize = 5;
/// Interval of frames that are compared with all other ways to draw them.
const JUDGED: usize = 20;

/// Input of a run.
#[derive(Clone, Debug)]
pub struct HeldBench {
    /// Name of the data set.
    pub dataset: String,
    /// Request of the first frame; others differ in step and camera.
    pub request: FrameRequest,
    /// Number of frames in motion.
    pub frames: usize,
    /// Frame time budget in milliseconds.
    pub target_ms: f64,
}

/// Result of a run: how a frame rate was held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldRun {
    /// Name of the data set.
    pub dataset: String,
    /// Cells of its mesh.
    pub cells: u64,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Frame time budget in milliseconds.
    pub target_ms: f64,
    /// Milliseconds of a full frame, before the motion.
    pub exact_ms: f64,
    /// Milliseconds of all stages, without the first five frames.
    pub ms: Spread,
    /// Share of these frames within the budget.
    pub within: f64,
    /// Number of choices of each way to draw.
    pub chosen: BTreeMap<String, usize>,
    /// RMSE of raw accumulators against the full image, over the judged frames.
    pub rmse: Spread,
    /// Error of judged frames over the least error of any way within the budget, for frames that have one and exceed the budget in full.
    pub over_best: Option<Spread>,
}

/// A frame that is compared with its alternatives.
struct Judged {
    before: FrameRequest,
    request: FrameRequest,
    quality: Quality,
}

/// Moves camera and time at a held frame rate; `progress` is told of each frame.
///
/// # Errors
/// If a step cannot be read, the camera has no view, or `cancel` was raised.
pub fn run_held(
    pipeline: &mut Pipeline,
    bench: &HeldBench,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<HeldRun, PipelineError> {
    let HeldBench { target_ms, frames, .. } = *bench;
    let full = bench.request.clone().on(pipeline.mesh());
    let mut control = QualityControl::default();
    let steps = pipeline.times().len().max(1);
    let at = |frame: usize| -> Result<FrameRequest, CameraError> {
        let camera: Camera = full.camera.orbit(TURN_DEG * frame as f64, 0.0)?;
        Ok(FrameRequest { time: (frame % steps).into(), camera, ..full.clone() })
    };
    // Twice at rest: the first frame fills caches.
    let mut exact_ms = 0.0;
    for _ in 0..2 {
        exact_ms = pipeline.render_unless(&at(0)?, cancel)?.stats.ms_worked();
    }
    control.measured(Quality::Exact, exact_ms);
    let wanted = Wanted {
        target_ms: Some(target_ms),
        family: None,
        has_rays: full.may_leave_rays_out(),
        has_details: false,
        faces: full.tets().and_then(|tets| tets.draw.drawn_by().faces()).map(|faces| faces.lod),
        has_points: full.may_leave_points_out(),
        or_exact: false,
    };
    let (mut ms, mut chosen, mut judged, mut on_gpu) = (Vec::new(), BTreeMap::new(), Vec::new(), false);
    for frame in 0..frames.max(SETTLED + 1) {
        let quality = control.choose(&wanted);
        let request = at(frame + 1)?;
        let stats = &pipeline.render_unless(&quality.of_request(request.clone(), FaceDetail::ALL), cancel)?.stats;
        on_gpu = stats.on_gpu;
        control.measured(quality, stats.ms_worked());
        if frame >= SETTLED {
            ms.push(stats.ms_worked());
            *chosen.entry(name(quality)).or_insert(0) += 1;
            if frame % JUDGED == SETTLED {
                judged.push(Judged { before: at(frame)?, request, quality });
            }
        }
        progress.advance(1);
    }
    let (mut rmse, mut over_best) = (Vec::new(), Vec::new());
    for frame in &judged {
        let (error, best) = frame.judge(pipeline, &wanted, cancel)?;
        rmse.push(error);
        over_best.extend(best.filter(|best| *best > 0.0).map(|best| error / best));
    }
    Ok(HeldRun {
        dataset: bench.dataset.clone(),
        cells: pipeline.mesh().topology.tets.len() as u64,
        size: [bench.request.size_px.0 as u32, bench.request.size_px.1 as u32],
        backend: if on_gpu { "gpu" } else { "cpu" }.to_owned(),
        target_ms,
        exact_ms,
        within: ms.iter().filter(|&&ms| ms <= target_ms).count() as f64 / ms.len() as f64,
        ms: Spread::of(&ms),
        chosen,
        rmse: Spread::of(&rmse),
        over_best: (!over_best.is_empty()).then(|| Spread::of(&over_best)),
    })
}

impl Judged {
    /// The error of a frame, and the least of all ways to draw it within the budget.
    fn judge(
        &self,
        pipeline: &mut Pipeline,
        wanted: &Wanted,
        cancel: &Cancel,
    ) -> Result<(f64, Option<f64>), PipelineError> {
        let is_connected = pipeline.mesh().is_connected;
        let mut draw = |quality: Quality| -> Result<(f64, RgbaImage), PipelineError> {
            // State of the previous frame is reused, as in the motion.
            let [before, request] =
                [&self.before, &self.request].map(|request| quality.of_request(request.clone(), FaceDetail::ALL));
            pipeline.render_unless(&before, cancel)?;
            let frame = pipeline.render_unless(&request, cancel)?;
            let (small, full) = (&frame.planes.color, self.request.size_px);
            let (started, of) = (Instant::now(), (small.width, small.height));
            let image = if of == full { small.clone() } else { bilinear(small, &Enlarging::between(of, full)) };
            let ms_enlarged = if of == full { 0.0 } else { started.elapsed().as_secs_f64() * 1e3 };
            Ok((frame.stats.ms_worked() + ms_enlarged, image))
        };
        let (_, exact) = draw(Quality::Exact)?;
        let error = |image: &RgbaImage| compare_raw(&exact, image).map_or(f64::INFINITY, |difference| difference.rmse);
        let (_, image) = draw(self.quality)?;
        let own = error(&image);
        let mut best: Option<f64> = None;
        let usable = |family: &Family| match family {
            Family::Rays => wanted.has_rays,
            Family::Faces => is_connected,
            Family::Points => wanted.has_points,
            Family::Scaled => true,
            Family::Details => false,
        };
        for quality in Family::ALL.into_iter().filter(usable).flat_map(Family::qualities) {
            let (ms, image) = draw(quality)?;
            if wanted.target_ms.is_some_and(|target_ms| ms <= target_ms) {
                best = Some(best.map_or(error(&image), |best| best.min(error(&image))));
            }
        }
        Ok((own, best))
    }
}

fn name(quality: Quality) -> String {
    match quality {
        Quality::Exact => "exact".to_owned(),
        Quality::Rays(contrast) => format!("contrast {contrast}"),
        Quality::Scaled(share) => format!("scale {share}"),
        Quality::Details => "details".to_owned(),
        Quality::Faces(level) => format!("faces {level}"),
        Quality::Points(share) => format!("points {share}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::run_still;
    use crate::ingest::{IngestOptions, ingest};
    use crate::mesh::ConnectivityChoice;
    use crate::node_table::{Node, NodeTable};
    use crate::pipeline::{Backend, Series};
    use crate::store::Store;
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::Silent;
    use std::sync::Arc;

    #[test]
    fn cells_without_connectivity_are_moved_as_points_and_judged_by_what_draws_them() {
        let source = generate(&SynthSpec { cells: 600, steps: 2, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("soup.zarr");
        let options = IngestOptions { connectivity: ConnectivityChoice::None, ..Default::default() };
        ingest(&source, &path, &options, &Silent, &Cancel::new()).unwrap();
        let mut pipeline = Pipeline::new(Arc::new(Series::open(&Store::open(&path).unwrap(), None).unwrap()));
        let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
        let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0, 0.5, 0.0], tau: 1.0 }]).unwrap();
        let request = FrameRequest::new(0, camera, Arc::new(table), (24, 16));
        let request = FrameRequest { backend: Backend::Cpu, ..request };
        // Nothing is within a nanosecond, and everything is within a day.
        for (target_ms, are_exact) in [(1e-6, false), (1e8, true)] {
            let bench = HeldBench { dataset: "soup".to_owned(), request: request.clone(), frames: 8, target_ms };
            let run = run_held(&mut pipeline, &bench, &Silent, &Cancel::new()).unwrap();
            assert_eq!(run.chosen.values().sum::<usize>(), 8 - SETTLED);
            let is_known = |name: &String| ["exact", "scale ", "points "].iter().any(|of| name.starts_with(of));
            assert!(run.chosen.keys().all(is_known), "{:?}", run.chosen);
            assert_eq!(run.chosen.contains_key("exact"), are_exact, "{:?}", run.chosen);
            assert_eq!(run.rmse.max == 0.0, are_exact);
        }
        assert!(run_still(&mut pipeline, "soup", &request, &Silent, &Cancel::new()).unwrap().is_none());
    }
}
