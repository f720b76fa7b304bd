//! Rendering and writing the frames of a plan.

use super::plan::{Held, Plan, PlannedFrame};
use super::resume::{self, Fingerprints, Found};
use super::sink::Sink;
use super::{FrameRecord, Origin, Run, RunError, attributes_of};
use crate::export::annotate::Annotator;
use crate::export::still::{FrameAttributes, OutputFrame};
use crate::files;
use crate::image::RgbaImage;
use crate::look::ColorBar;
use crate::pipeline::{FrameRequest, Pipeline, Pipelined, SharedFrame};
use crate::scene::Scene;
use crate::stats::FrameStats;
use crate::task::{Cancel, Progress};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::Duration;

/// A run and the metadata of its images.
pub(super) struct Job<'a> {
    pub(super) run: &'a Run,
    /// Fingerprints of the frames; `None` for a movie.
    pub(super) fingerprints: Option<Fingerprints>,
}

impl Job<'_> {
    /// Renders all frames; files that were begun are finished or removed in any case.
    pub(super) fn run(
        &self,
        scene: &mut Scene,
        mut sink: Sink,
        progress: &dyn Progress,
    ) -> Result<Vec<FrameRecord>, RunError> {
        progress.begin("render", self.run.plan.frames.len() as u64, "frames");
        let rendered = self.render_all(scene, &mut sink, progress);
        let lost = rendered.as_ref().err().is_some_and(RunError::is_device_failure);
        let written = sink.finish(rendered.is_ok() || lost, scene.cancel());
        progress.end();
        if lost && written.is_ok() {
            progress.say(&format!("the frames until then are in {}", self.run.output.path(0).display()));
        }
        let records = rendered?;
        written?;
        Ok(records)
    }

    /// Renders on a separate pipeline, which is handed back to the scene afterwards.
    fn render_all(
        &self,
        scene: &mut Scene,
        sink: &mut Sink,
        progress: &dyn Progress,
    ) -> Result<Vec<FrameRecord>, RunError> {
        let series = scene.pipeline.series().clone();
        let pipeline = std::mem::replace(&mut scene.pipeline, Pipeline::new(series));
        let pipelined = Pipelined::start(pipeline, &self.run.threads, || ())?;
        let rendered = self.render_on(&pipelined, scene, sink, progress);
        scene.pipeline = pipelined.stop();
        rendered
    }

    fn render_on(
        &self,
        pipelined: &Pipelined,
        scene: &mut Scene,
        sink: &mut Sink,
        progress: &dyn Progress,
    ) -> Result<Vec<FrameRecord>, RunError> {
        let frames = &self.run.plan.frames;
        let mut records = Vec::with_capacity(frames.len());
        let mut on_their_way: VecDeque<Pending> = VecDeque::with_capacity(AHEAD);
        let (mut asked, mut refused, mut has_older) = (0, None, false);
        // The last requested frame and its origin.
        let mut last: Option<(Origin, FrameRequest)> = None;
        // The last frame, kept to be repeated.
        let mut held: Option<SharedFrame> = None;
        while records.len() < frames.len() {
            check(scene.cancel())?;
            while refused.is_none() && asked < frames.len() && on_their_way.len() < AHEAD {
                match self.ask(asked, last.as_ref(), pipelined, scene) {
                    Ok((pending, request)) => {
                        if pending.replaces_older && !has_older {
                            let file = pending.file.display();
                            progress.say(&format!(
                                "{file} was rendered by an older tetreel: it is rendered anew, as are others like it"
                            ));
                            has_older = true;
                        }
                        last = Some((pending.origin, request));
                        on_their_way.push_back(pending);
                    }
                    Err(error) => refused = Some(error),
                }
                asked += 1;
            }
            pipelined.expect(&self.run.plan.steps_from(records.len(), EXPECTED));
            // An invalid request fails in its turn: the frames before it are written.
            let Some(pending) = on_their_way.pop_front() else { break };
            let stats = match pending.origin {
                Origin::Kept | Origin::Repeated => None,
                Origin::Rendered => {
                    let frame = wait_for(pipelined, scene.cancel())?;
                    Some(held.insert(frame).stats.clone())
                }
            };
            let is_empty = |frame: &SharedFrame| frame.planes.color.pixels.iter().all(|p| *p == [0.0; 4]);
            let empty = held.as_ref().filter(|_| pending.origin != Origin::Kept).map(is_empty);
            let record = pending.record(&self.run.plan, empty, stats);
            if let (Some(frame), true) = (&held, pending.origin != Origin::Kept) {
                let mut output = OutputFrame { planes: frame.planes.clone(), attributes: pending.attributes };
                annotate(&mut output.planes.color, self.run.annotator.as_ref(), record.time, &pending.bars);
                sink.send(output, &pending.file, scene.cancel())?;
            }
            records.push(record);
            progress.advance(1);
        }
        refused.map_or(Ok(records), Err)
    }

    /// Requests a frame, unless its file has it already or it equals the previous one.
    fn ask(
        &self,
        index: usize,
        last: Option<&(Origin, FrameRequest)>,
        pipelined: &Pipelined,
        scene: &mut Scene,
    ) -> Result<(Pending, FrameRequest), RunError> {
        let planned = &self.run.plan.frames[index];
        let request = request_for(scene, planned)?;
        let file = self.run.output.path(index);
        let mut attributes = attributes_of(scene, &request, index);
        let bars = scene.color_bars();
        let series = scene.pipeline.series();
        let fingerprint = |f: &Fingerprints| f.of(planned, &request, &attributes, series, scene.cancel());
        let fingerprint = self.fingerprints.as_ref().map(fingerprint).transpose()?;
        let found = match &fingerprint {
            Some(fingerprint) if self.run.resume => resume::find(&file, fingerprint),
            _ => Found::Other,
        };
        // A movie has been looked at before.
        if !self.run.replaces && self.fingerprints.is_some() && found != Found::Frame && file.exists() {
            return Err(files::taken(&file).into());
        }
        attributes.extras.extend(fingerprint.map(|f| (FrameAttributes::FINGERPRINT.to_owned(), f)));
        let is_same = |other: &FrameRequest| other.same_moment(&request) && other.same_view(&request);
        let origin = match last {
            _ if found == Found::Frame => Origin::Kept,
            Some((Origin::Rendered | Origin::Repeated, other)) if is_same(other) => Origin::Repeated,
            _ => Origin::Rendered,
        };
        if origin == Origin::Rendered {
            // At most a few frames are on their way, so there is room for this one.
            pipelined.push(request.clone()).ok_or(RunError::Full)?;
        }
        let replaces_older = found == Found::Older;
        Ok((Pending { attributes, bars, file, origin, replaces_older }, request))
    }
}

/// Frames requested ahead of the next one to write: one being rendered, two in preparation, one finished.
const AHEAD: usize = 4;

/// Number of frames whose steps are read ahead.
const EXPECTED: usize = 256;

/// A frame on its way to its file.
struct Pending {
    attributes: FrameAttributes,
    /// The colours for its annotations.
    bars: Vec<ColorBar>,
    file: PathBuf,
    origin: Origin,
    /// Whether its file has a frame of an older version.
    replaces_older: bool,
}

impl Pending {
    fn record(&self, plan: &Plan, empty: Option<bool>, stats: Option<FrameStats>) -> FrameRecord {
        let frame = self.attributes.frame;
        let moment = plan.frames[frame].time;
        FrameRecord {
            frame,
            step: moment.step(),
            toward: moment.toward(),
            time: self.attributes.time,
            file: self.file.clone(),
            origin: self.origin,
            empty,
            stats,
        }
    }
}

/// Waits for the next frame, or for cancellation.
fn wait_for(pipelined: &Pipelined, cancel: &Cancel) -> Result<SharedFrame, RunError> {
    loop {
        check(cancel)?;
        if let Some(delivery) = pipelined.wait(Duration::from_millis(50)) {
            return Ok(delivery.frame?);
        }
        if !pipelined.is_alive() {
            return Err(RunError::Stopped);
        }
    }
}

/// Fails if the run was cancelled.
fn check(cancel: &Cancel) -> Result<(), RunError> {
    if cancel.is_cancelled() { Err(RunError::Cancelled) } else { Ok(()) }
}

/// Draws annotations over a frame of this time.
fn annotate(image: &mut RgbaImage, annotator: Option<&Annotator>, time: f64, bars: &[ColorBar]) {
    if let Some(annotator) = annotator.filter(|_| !bars.is_empty()) {
        annotator.draw(image, time, bars);
    }
}

/// The colours of a planned frame with its annotations, as a run writes them.
///
/// # Errors
/// If the frame cannot be rendered.
pub fn picture(
    scene: &mut Scene,
    planned: &PlannedFrame,
    annotator: Option<&Annotator>,
) -> Result<RgbaImage, RunError> {
    let request = request_for(scene, planned)?;
    let cancel = scene.cancel().clone();
    let mut image = scene.pipeline.render_unless(&request, &cancel)?.planes.color.clone();
    annotate(&mut image, annotator, request.time.time(scene.pipeline.times()), &scene.color_bars());
    Ok(image)
}

/// The request of a frame, with its time, turntable angle and flow.
fn request_for(scene: &mut Scene, planned: &PlannedFrame) -> Result<FrameRequest, RunError> {
    let mut request = scene.request_at(planned.time, planned.at)?;
    request = match planned.held {
        Some(Held { since_s, frame_s }) => scene.holding(request, since_s, frame_s)?,
        None if planned.shutter > 0.0 => request.with_shutter(planned.shutter),
        None => request,
    };
    if planned.azimuth_deg != 0.0 {
        request.camera = request.camera.orbit(planned.azimuth_deg, 0.0)?;
    }
    Ok(request)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::run::Times;
    use crate::ingest::{IngestOptions, ingest};
    use crate::look::FlowLook;
    use crate::pipeline::Layer;
    use crate::render::flow::FlowStyle;
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::Silent;

    #[test]
    fn a_frame_of_a_motion_is_the_request_of_its_moment_with_its_shutter() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.zarr");
        let tornado = generate(&SynthSpec { cells: 600, steps: 3, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
        ingest(&tornado, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        let mut scene = Scene::open(&path).unwrap();
        scene.size_px = (32, 24);
        scene.look.flow = Some(FlowLook::new("velocity".to_owned(), FlowStyle { speed: 9.0, ..FlowStyle::default() }));
        let times = scene.pipeline.times().clone();
        for (is_movie, duration_s) in [(false, None), (true, None), (false, Some(0.2))] {
            let of_run = Times { duration_s, interpolate: duration_s.is_some(), ..Times::default() };
            let planned = of_run.plan(&times, is_movie).unwrap().frames[1];
            assert_eq!(planned.shutter > 0.0, is_movie || duration_s.is_some());
            let request = scene.request_at(planned.time, planned.at).unwrap().with_shutter(planned.shutter);
            assert_eq!(request_for(&mut scene, &planned).unwrap(), request);
            let flow = request.layers.iter().find_map(Layer::flow).unwrap();
            assert_eq!((flow.held, flow.shutter), (0.0, planned.shutter));
            let image = picture(&mut scene, &planned, None).unwrap();
            let frame = scene.pipeline.render(&request).unwrap();
            assert!(image == frame.planes.color && (frame.stats.flow_fast > 0) == (planned.shutter > 0.0));
        }
    }
}
