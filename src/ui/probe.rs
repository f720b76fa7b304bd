//! The point under the mouse, and its value over the series: on threads of its own.

use super::worker::{BLOCK_BYTES, SeriesPipeline, Slot, Worker};
use crate::functions::eval::Found;
use crate::pipeline::{Backend, FrameRequest, Pipeline, PipelineError, Series, TetDraw, vector_components};
use crate::render::probe::{Probe, probe};
use crate::task::Cancel;
use crate::visibility::Skip;
use glam::DVec3;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A request for the point at a position in a frame.
#[derive(Clone, Debug)]
pub struct HoverRequest {
    /// The series played.
    pub series: Arc<Series>,
    /// Request of the frame on the screen.
    pub request: FrameRequest,
    /// Position in pixels of the request's size, from the left and from the top; pixel centres at + .5.
    pub at_px: (f64, f64),
}

/// The answer to a [`HoverRequest`].
#[derive(Clone, Debug)]
pub struct Hover {
    /// The request: frame or mouse may have moved on since.
    pub asked: HoverRequest,
    /// The visible point, `None` if there is none; or why it cannot be known.
    pub found: Result<Option<Probe>, String>,
    /// What functions give at that point, in a frame that is drawn by them; the gradient is per world unit.
    pub functions: Option<Found<f64, DVec3>>,
    /// The vector of the frame's flow at that point.
    pub vector: Option<DVec3>,
}

/// The scalar of a point at every step of a series, as far as read.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The series.
    pub series: Arc<Series>,
    /// Index of the point's cell.
    pub cell: u32,
    /// Barycentric coordinates of the point in the cell.
    pub weights: [f64; 4],
    /// One value per step of the series; NaN if not read yet, if the point is in a hole, or if the step cannot be read.
    pub values: Vec<f32>,
    /// The vectors of flow there, if there is flow.
    pub vectors: Option<Vectors>,
    /// Number of steps processed, from the first on.
    pub done: usize,
    /// Number of unreadable steps.
    pub failed: usize,
    /// Problem of the first unreadable step, or of the whole curve.
    pub problem: Option<String>,
    /// Whether the curve is final: complete, or failed.
    pub is_over: bool,
}

/// The vectors of a point at every step of a series, as far as read.
#[derive(Clone, Debug)]
pub struct Vectors {
    /// Name of the field.
    pub field: String,
    /// One vector per step; NaN as a [`Curve`]'s values.
    pub values: Vec<[f32; 3]>,
}

/// Interval between snapshots of a growing curve.
const SHOWN_EVERY: Duration = Duration::from_millis(50);

/// Finds the point under the mouse, and values of a point over time. No call blocks.
pub struct Prober {
    hovers: Worker<HoverRequest>,
    hover: Arc<Slot<Hover>>,
    /// Jobs are curves without values.
    picks: Worker<Curve>,
    curve: Arc<Slot<Arc<Curve>>>,
}

impl Prober {
    /// Starts two threads, which end with the prober. `wake` is called when there is a new result to take.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start(wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let (hover, curve) = (Arc::<Slot<Hover>>::default(), Arc::<Slot<Arc<Curve>>>::default());
        let answer = |pipeline: &mut SeriesPipeline, asked: HoverRequest, cancel: &Cancel, put: &dyn Fn(Hover)| {
            let found = match find(pipeline.of(&asked.series), &asked, cancel) {
                Err(PipelineError::Cancelled) => return,
                found => found.map_err(|error| error.to_string()),
            };
            put(match found {
                Ok(Pointed { point, functions, vector }) => Hover { asked, found: Ok(point), functions, vector },
                Err(error) => Hover { asked, found: Err(error), functions: None, vector: None },
            });
        };
        let failed = |asked, text| Hover { asked, found: Err(text), functions: None, vector: None };
        let hovers = Worker::start("probe", hover.filler(wake.clone()), answer, failed)?;
        let follow = |(): &mut (), curve: Curve, cancel: &Cancel, show: &dyn Fn(Arc<Curve>)| curve.follow(cancel, show);
        let known = curve.clone();
        let picks = Worker::start("curve", curve.filler(wake), follow, move |empty, text| {
            let known = known.get().map_or(empty, Arc::unwrap_or_clone);
            Arc::new(Curve { problem: Some(text), is_over: true, ..known })
        })?;
        Ok(Self { hovers, hover, picks, curve })
    }

    /// Requests the point at a position, replacing a pending request; `None`: drops pending requests and answers. A request in progress is
    /// finished otherwise: while the mouse moves there are answers all the time, each for where it was.
    pub fn hover(&self, at: Option<HoverRequest>) {
        match at {
            Some(asked) => self.hovers.give(asked),
            None => {
                self.hovers.stop();
                self.hover.clear();
            }
        }
    }

    /// The newest answer not taken yet.
    pub fn take_hover(&self) -> Option<Hover> {
        self.hover.take()
    }

    /// Starts to read the value of a point at every step of a series, replacing the last point. The point is a cell of the series' mesh and
    /// weights of its vertices, as in a [`Probe`]. With the name of a field of vectors, reads these, too.
    pub fn pick(&self, series: Arc<Series>, cell: u32, weights: [f64; 4], vectors: Option<String>) {
        self.forget_pick();
        let values = vec![f32::NAN; series.times().len()];
        let vectors = vectors.map(|field| Vectors { field, values: vec![[f32::NAN; 3]; series.times().len()] });
        let start = Curve { series, cell, weights, values, vectors, done: 0, failed: 0, problem: None, is_over: false };
        self.picks.give(start);
    }

    /// Drops the curve.
    pub fn forget_pick(&self) {
        self.picks.stop();
        self.curve.clear();
    }

    /// The curve of the last pick so far; `None` before it has begun.
    pub fn curve(&self) -> Option<Arc<Curve>> {
        self.curve.get()
    }
}

/// What is at a position in a frame.
struct Pointed {
    point: Option<Probe>,
    /// What functions give there in a frame that is drawn by them.
    functions: Option<Found<f64, DVec3>>,
    /// The vector there in a frame with flow.
    vector: Option<DVec3>,
}

/// Finds the point at a position in a frame: that of the cells, also where functions are drawn in them.
fn find(pipeline: &mut Pipeline, asked: &HoverRequest, cancel: &Cancel) -> Result<Pointed, PipelineError> {
    // The scalars are needed on the CPU, and every cell is: the point under the mouse may be transparent.
    let skip = Skip { transparent_cells: false, transparent_chunks: false, ..asked.request.skip };
    let request = asked.request.clone().with_draw(TetDraw::Auto);
    let mut request = FrameRequest { backend: Backend::Cpu, skip, ..request };
    // What flows is not what is pointed at.
    request.layers.retain(|layer| layer.flow().is_none());
    let job = pipeline.prepare_unless(&request, cancel)?;
    let point = probe(&job, asked.at_px)?;
    let is_of_functions = asked.request.tets().is_some_and(|tets| matches!(tets.draw, TetDraw::Sheets(_)));
    let at_point = |point: &Probe| asked.series.functions_at(job.scalars.of_vertices()?, point.position);
    let functions = point.as_ref().filter(|_| is_of_functions).and_then(at_point);
    let vector = match &point {
        Some(point) => pipeline.flow_vector(&asked.request, (point.cell, point.weights), cancel)?,
        None => None,
    };
    Ok(Pointed { point, functions, vector })
}

impl Curve {
    /// Reads the point's value step by step, and calls `show` with snapshots.
    fn follow(mut self, cancel: &Cancel, show: &dyn Fn(Arc<Self>)) {
        let series = self.series.apart(BLOCK_BYTES);
        if series.mesh().topology.tets.get(self.cell as usize).is_none() {
            self.problem = Some(format!("there is no cell {}", self.cell));
            self.is_over = true;
            return show(Arc::new(self));
        }
        let components = self.vectors.as_ref().map(|of| vector_components(&series, &of.field)).transpose();
        let components = components.unwrap_or_else(|error| {
            self.problem = Some(error.to_string());
            None
        });
        let mut scalars = vec![0.0; series.scalar_count()];
        let count = components.as_ref().map_or(0, |of| of[0].scalar_count());
        let mut component = vec![0.0; count];
        let mut shown = Instant::now();
        show(Arc::new(self.clone()));
        while self.done < self.values.len() {
            match series.decode_step(self.done, &mut scalars, cancel) {
                Ok(true) => {
                    let value = series.value_at(&scalars, self.cell, self.weights);
                    self.values[self.done] = value.map_or(f32::NAN, |value| value as f32);
                }
                Ok(false) => return,
                Err(error) => {
                    self.failed += 1;
                    self.problem.get_or_insert_with(|| error.to_string());
                }
            }
            match components.as_ref().map(|of| self.vector(of, &mut component, cancel)) {
                Some(Ok(false)) => return,
                Some(Err(error)) => drop(self.problem.get_or_insert_with(|| error.to_string())),
                Some(Ok(true)) | None => {}
            }
            self.done += 1;
            if shown.elapsed() >= SHOWN_EVERY && self.done < self.values.len() {
                show(Arc::new(self.clone()));
                shown = Instant::now();
            }
        }
        self.is_over = true;
        show(Arc::new(self));
    }

    /// Reads the point's vector at the next step; returns whether that was not cancelled.
    fn vector(
        &mut self,
        components: &[Arc<Series>; 3],
        values: &mut [f32],
        cancel: &Cancel,
    ) -> Result<bool, PipelineError> {
        let mut vector = [0.0; 3];
        for (of, component) in components.iter().zip(&mut vector) {
            if !of.decode_step(self.done, values, cancel)? {
                return Ok(false);
            }
            *component = of.value_at(values, self.cell, self.weights).map_or(f32::NAN, |value| value as f32);
        }
        if let Some(vectors) = &mut self.vectors {
            vectors.values[self.done] = vector;
        }
        Ok(true)
    }
}

#[cfg(test)]
#[path = "probe_tests.rs"]
mod tests;
