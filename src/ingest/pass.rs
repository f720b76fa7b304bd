//! Processing the steps of a source, from their values to the finished fields.

use super::check_cancel;
use super::order::ValueOrder;
use super::plan::PlannedField;
use super::report::{IngestError, StageSeconds};
use super::stream::{Job, Stream, with_stream};
use crate::codec::magnitude;
use crate::error::{FileError, FileResult};
use crate::field::{Association, Component};
use crate::moments::{Moments, StepSummary};
use crate::slowdown::{Slow, waste};
use crate::store::{FieldWriter, range_text};
use crate::task::Progress;
use std::time::{Duration, Instant};

/// A field of the new store, as the target of values.
pub(super) struct Target {
    pub(super) writer: FieldWriter,
    /// Statistics so far. Steps that are coded again are not counted again.
    pub(super) moments: Moments,
    pub(super) association: Association,
    /// What has the values in the store.
    pub(super) values_of: Association,
    /// The first step that the writer takes.
    pub(super) first_step: usize,
}

/// State of the processing of steps.
pub(super) struct Pass<'a> {
    job: Job<'a>,
    /// Number of points and cells in the source.
    counts: [usize; 2],
    order: ValueOrder,
    /// For each field, one target per output.
    pub(super) targets: Vec<Vec<Target>>,
    /// Components of the current field in the order of the store; as many buffers as the largest field needs.
    components: Vec<Vec<f32>>,
    magnitude: Vec<f32>,
    pub(super) seconds: StageSeconds,
    pub(super) values_read: u64,
    /// What to do if steps that are read again have changed.
    pub(super) if_changed: String,
}

/// Is told of each new step: the number of steps of the store so far, and its fields.
pub(super) type AfterStep<'a> = dyn FnMut(usize, &[Vec<Target>]) -> FileResult<()> + 'a;

impl<'a> Pass<'a> {
    pub(super) fn new(job: Job<'a>, order: ValueOrder, counts: [usize; 2], targets: Vec<Vec<Target>>) -> Self {
        let most = job.fields.iter().map(|f| f.reads.len()).max().unwrap_or(0);
        Self {
            job,
            counts,
            order,
            targets,
            components: vec![Vec::new(); most],
            magnitude: Vec::new(),
            seconds: StageSeconds::default(),
            values_read: 0,
            if_changed: "import the series again".to_owned(),
        }
    }

    /// Processes all steps of the job, the first as step `first` of the store; `stage` names the work. `after` is told of each new one, with
    /// the number of steps of the store so far. Returns the time spent reading.
    pub(super) fn run(
        &mut self,
        stage: &str,
        first: usize,
        progress: &dyn Progress,
        after: &mut AfterStep<'_>,
    ) -> Result<Duration, IngestError> {
        let job = self.job;
        progress.begin(stage, job.steps.len() as u64, "steps");
        let result = with_stream(&job, |stream| {
            for (at, &step) in (first..).zip(job.steps) {
                check_cancel(job.cancel)?;
                self.take_step(step, at, stream)?;
                after(at + 1, &self.targets)?;
                progress.advance(1);
            }
            Ok(stream.read_time)
        });
        progress.end();
        let read_time = result?;
        check_cancel(job.cancel)?;
        Ok(read_time)
    }

    /// Processes step `step` of the source as step `at` of the store.
    fn take_step(&mut self, step: usize, at: usize, stream: &mut Stream) -> Result<(), IngestError> {
        for index in 0..self.job.fields.len() {
            let field = &self.job.fields[index];
            for (slot, component) in field.reads.iter().enumerate() {
                let took = stream.next(|values| self.take_component(field, *component, step, slot, values))?;
                let took = took.map_err(IngestError::Source)?;
                self.seconds.order += took.as_secs_f64();
            }
            self.emit(index, at)?;
        }
        Ok(())
    }

    /// Reorders the values of one component to the order of the store.
    fn take_component(
        &mut self,
        field: &PlannedField,
        component: usize,
        step: usize,
        slot: usize,
        values: &[f32],
    ) -> FileResult<Duration> {
        let start = Instant::now();
        let (expected, what) = match field.info.association {
            Association::Point => (self.counts[0], "points"),
            Association::Cell => (self.counts[1], "cells"),
        };
        if values.len() != expected {
            let place = format!("field '{}', component {component}, step {step}", field.info.name);
            let problem = format!("has {} values, but the mesh has {expected} {what}", values.len());
            return Err(FileError::invalid(self.job.source.describe(), place, problem));
        }
        self.values_read += values.len() as u64;
        waste(Slow::Import, values.len());
        let out = &mut self.components[slot];
        out.resize(self.order.count(field.values_of()), 0.0);
        match (field.info.association, field.means) {
            (Association::Point, _) => self.order.gather_points(values, out),
            (Association::Cell, None) => self.order.gather_cells(values, out),
            (Association::Cell, Some(means)) => self.order.average_cells(values, means, out),
        }
        Ok(start.elapsed())
    }

    /// Computes and encodes the outputs of a field whose components are complete.
    fn emit(&mut self, index: usize, at: usize) -> FileResult<()> {
        let field = &self.job.fields[index];
        for (output, target) in field.outputs.iter().zip(&mut self.targets[index]) {
            let start = Instant::now();
            let values = match output.component {
                // Every component of an output is read, so the search succeeds.
                Component::Index(i) => &self.components[field.reads.partition_point(|&read| read < i)],
                Component::Magnitude => {
                    let components: Vec<&[f32]> =
                        self.components[..field.reads.len()].iter().map(Vec::as_slice).collect();
                    self.magnitude.resize(self.order.count(field.values_of()), 0.0);
                    magnitude(&components, &mut self.magnitude);
                    &self.magnitude
                }
            };
            let ordered = Instant::now();
            match target.moments.steps().get(at).map(|step| step.range) {
                None => _ = target.moments.add_step(values),
                Some(range) => check_again(target, at, values, range).map_err(|(place, problem)| {
                    let error = FileError::invalid(self.job.source.describe(), place, problem);
                    error.remedy(self.if_changed.clone())
                })?,
            }
            let reduced = Instant::now();
            if at >= target.first_step {
                target.writer.push(values)?;
            }
            self.seconds.order += (ordered - start).as_secs_f64();
            self.seconds.moments += (reduced - ordered).as_secs_f64();
            self.seconds.encode += reduced.elapsed().as_secs_f64();
        }
        Ok(())
    }
}

/// Fails unless a step that is read again has the same values as before, or, where their checksum is not known, the same range. An error is
/// the place and the problem.
fn check_again(target: &Target, at: usize, values: &[f32], before: Option<[f32; 2]>) -> Result<(), (String, String)> {
    let now = StepSummary::of(values).range;
    let bits = |range: Option<[f32; 2]>| range.map(|r| r.map(f32::to_bits));
    let is_in_range = bits(now) == bits(before);
    if target.writer.had(at, values).unwrap_or(is_in_range) {
        return Ok(());
    }
    let [now, before] = [now, before].map(range_text);
    let how = if is_in_range { "in the same range".to_owned() } else { format!("{now} instead of {before}") };
    let place = format!("field '{}', step {at} of the store", target.writer.name());
    Err((place, format!("has other values than when it was imported: {how}")))
}
