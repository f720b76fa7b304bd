//! Statistics of a field over the series, per step and as a histogram: on a thread of its own.
//!
//! Ranges of all steps are in the store; means and histograms are not, and need every step decoded. The order of the steps is from coarse
//! to fine ([`spread`]), so that an overview of the series comes early. At most [`MOST_STEPS`] steps are read, evenly over the series.

use super::worker::{BLOCK_BYTES, Gate, Slot, Worker};
use crate::histograms::spread;
use crate::moments::{AxisScale, Bins, Histogram1d, StepSummary};
use crate::pipeline::Series;
use crate::task::Cancel;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Largest number of steps read of a series.
pub const MOST_STEPS: usize = 1024;

/// Interval between snapshots of a growing survey.
const SHOWN_EVERY: Duration = Duration::from_millis(100);

/// Statistics of one step.
#[derive(Clone, Debug, PartialEq)]
pub struct StepSurvey {
    /// Least and greatest finite value, and the number of non-finite ones.
    pub summary: StepSummary,
    /// Mean of the finite values of all vertices, each counted once; NaN if there is none.
    pub mean: f64,
    /// Numbers of values in [`STEP_BINS`] equal parts of the range of the series.
    pub counts: Vec<u64>,
}

/// Number of bins of one step.
pub const STEP_BINS: usize = 64;

impl StepSurvey {
    fn of(values: &[f32], range: Option<[f32; 2]>) -> Self {
        let mut counted = Histogram1d::over(Bins::new(range, AxisScale::Linear, STEP_BINS));
        counted.add(values);
        let counts = counted.counts().to_vec();
        let summary = StepSummary::of(values);
        // Summed in a fixed order, and far from overflow: no sum of f32 leaves the range of f64.
        let sum: f64 = values.iter().filter(|v| v.is_finite()).map(|&v| f64::from(v)).sum();
        Self { summary, mean: sum / (values.len() as u64 - summary.nonfinite) as f64, counts }
    }
}

/// Number of histogram bins: a range of a hundredth of all values has some hundreds of them.
const BINS: usize = 1 << 16;

/// An empty histogram over the range of a series.
fn nothing(range: Option<[f32; 2]>) -> Histogram1d {
    Histogram1d::over(Bins::new(range, AxisScale::Linear, BINS))
}

/// Statistics of a series so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Surveyed {
    /// One for each step of the series; `None` if it was not read (yet), or is unreadable.
    pub steps: Vec<Option<Arc<StepSurvey>>>,
    /// Histogram of all steps read, over the range of the series.
    pub histogram: Histogram1d,
    /// Number of steps read.
    pub done: usize,
    /// Number of steps to be read: those of the series, or [`MOST_STEPS`].
    pub total: usize,
    /// Number of unreadable steps.
    pub failed: usize,
    /// Problem of the first unreadable step, or why the survey ended early.
    pub problem: Option<String>,
    /// Whether the survey is final.
    pub is_over: bool,
}

impl Surveyed {
    fn begin(series: &Series) -> Self {
        let steps = series.times().len();
        Self {
            steps: vec![None; steps],
            histogram: nothing(series.field().range),
            done: 0,
            total: steps.min(MOST_STEPS),
            failed: 0,
            problem: None,
            is_over: false,
        }
    }
}

/// Surveys a series, until it is dropped.
pub struct Survey {
    worker: Worker<Arc<Series>>,
    gate: Arc<Gate>,
    at_begin: Arc<Surveyed>,
    slot: Arc<Slot<Arc<Surveyed>>>,
}

impl Survey {
    /// Starts a thread, which ends with the survey. `wake` is called for new statistics, ten times a second at most.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start(series: Arc<Series>, wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let (gate, slot) = (Arc::<Gate>::default(), Arc::<Slot<Arc<Surveyed>>>::default());
        let at_begin = Arc::new(Surveyed::begin(&series));
        let (of_thread, known) = (gate.clone(), slot.clone());
        let work = move |(): &mut (), series: Arc<Series>, cancel: &Cancel, show: &dyn Fn(Arc<Surveyed>)| {
            look(&series, &of_thread, cancel, show);
        };
        let worker = Worker::start("survey", slot.filler(wake), work, move |series, text| {
            let known = known.get().map_or_else(|| Surveyed::begin(&series), Arc::unwrap_or_clone);
            Arc::new(Surveyed { problem: Some(text), is_over: true, ..known })
        })?;
        worker.give(series);
        Ok(Self { worker, gate, at_begin, slot })
    }

    /// Statistics so far: at first no step. The ranges of all steps are in
    /// [`StoredField::range_per_step`](crate::store::StoredField::range_per_step) at once. Cheap.
    pub fn snapshot(&self) -> Arc<Surveyed> {
        self.slot.get().unwrap_or_else(|| self.at_begin.clone())
    }

    /// Pauses after the current step, or resumes: for while the user waits for frames.
    pub fn pause(&self, pauses: bool) {
        self.gate.set(pauses);
    }
}

impl Drop for Survey {
    fn drop(&mut self) {
        // Raised first, so that a thread leaving the gate sees it.
        self.worker.stop();
        self.gate.set(false);
    }
}

/// Reads the steps of a series one after the other, and calls `show` with snapshots.
fn look(series: &Arc<Series>, gate: &Gate, cancel: &Cancel, show: &dyn Fn(Arc<Surveyed>)) {
    let apart = series.apart(BLOCK_BYTES);
    let mut known = Surveyed::begin(series);
    let mut values = vec![0.0; series.scalar_count()];
    let mut shown: Option<Instant> = None;
    let block = series.field().coding().map_or(1, |coding| coding.codec().block_steps);
    for step in spread(series.times().len(), block, MOST_STEPS) {
        gate.pass();
        match apart.decode_step(step, &mut values, cancel) {
            Ok(true) => {
                known.histogram.add(&values);
                known.steps[step] = Some(Arc::new(StepSurvey::of(&values, series.field().range)));
            }
            Ok(false) => return,
            Err(error) => {
                known.failed += 1;
                known.problem.get_or_insert_with(|| error.to_string());
            }
        }
        known.done += 1;
        if known.done < known.total && shown.is_none_or(|at| at.elapsed() >= SHOWN_EVERY) {
            show(Arc::new(known.clone()));
            shown = Some(Instant::now());
        }
    }
    known.is_over = true;
    show(Arc::new(known));
}

#[cfg(test)]
mod tests {
    use super::super::worker::tests::{counted, wait_for};
    use super::*;
    use crate::pipeline::test_series::{jet, logged};
    use std::sync::atomic::Ordering;

    fn silent(series: &Arc<Series>) -> Survey {
        Survey::start(series.clone(), Arc::new(|| ())).unwrap()
    }

    fn whole(survey: &Survey) -> Arc<Surveyed> {
        wait_for("end", || Some(survey.snapshot()).filter(|known| known.is_over))
    }

    #[test]
    fn a_survey_is_what_each_step_decoded_says() {
        let series = jet();
        let survey = silent(&series);
        let known = whole(&survey);
        assert_eq!((known.done, known.total, known.failed, known.problem.as_ref()), (4, 4, 0, None));
        let mut all = nothing(series.field().range);
        for (step, found) in known.steps.iter().enumerate() {
            let mut values = vec![0.0; series.scalar_count()];
            assert!(series.decode_step(step, &mut values, &Cancel::new()).unwrap());
            let found = found.as_ref().unwrap();
            assert_eq!(found.summary, StepSummary::of(&values));
            let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
            assert_eq!(found.mean, mean);
            let sum: u64 = found.counts.iter().sum();
            assert_eq!((found.counts.len(), sum), (STEP_BINS, series.scalar_count() as u64));
            all.add(&values);
        }
        let of_bin = |bin: usize| known.steps.iter().flatten().map(|step| step.counts[bin]).sum::<u64>();
        let fine = all.counts().chunks(BINS / STEP_BINS).map(|bins| bins.iter().sum::<u64>());
        assert!(fine.enumerate().all(|(bin, sum)| of_bin(bin) == sum));
        assert_eq!(known.histogram, all);
        assert_eq!(all.finite(), 4 * series.scalar_count() as u64);
        assert_ne!(known.steps[0], known.steps[3], "the test can fail");
    }

    #[test]
    fn holes_are_counted_apart_and_a_step_of_holes_has_no_mean() {
        let survey = StepSurvey::of(&[1.0, f32::NAN, 3.0, f32::INFINITY], Some([1.0, 3.0]));
        assert_eq!((survey.mean, survey.summary.nonfinite), (2.0, 2));
        assert_eq!((survey.counts[0], survey.counts[STEP_BINS - 1], survey.counts.iter().sum::<u64>()), (1, 1, 2));
        let holes = StepSurvey::of(&[f32::NAN; 3], None);
        assert!(holes.mean.is_nan() && holes.summary.range.is_none());
        let wide = StepSurvey::of(&[f32::MAX; 1000], Some([f32::MAX; 2]));
        assert_eq!(wide.mean, f64::from(f32::MAX));
    }

    #[test]
    fn what_cannot_be_read_is_counted_and_a_panic_ends_it_with_a_word() {
        let (series, log) = logged(5);
        log.fail_at(3);
        let known = whole(&silent(&series));
        assert_eq!((known.done, known.failed, known.steps[3].is_none()), (5, 1, true));
        assert!(known.problem.as_ref().unwrap().contains("damaged"));
        log.panic_at(1);
        let known = whole(&silent(&series));
        assert!(known.problem.as_ref().unwrap().contains("not meant"), "{known:?}");
    }

    #[test]
    fn paused_it_rests_and_goes_on_afterwards() {
        let (series, log) = logged(300);
        log.take(Duration::from_millis(1));
        let (woken, wake) = counted();
        let survey = Survey::start(series, wake).unwrap();
        wait_for("begin", || Some(survey.snapshot()).filter(|known| known.done > 0));
        survey.pause(true);
        // The current step is finished; after that none is decoded, however long one waits.
        let at_rest = wait_for("rest", || {
            let before = log.decoded().len();
            std::thread::sleep(Duration::from_millis(50));
            (log.decoded().len() == before).then_some(before)
        });
        assert!(at_rest < 300);
        survey.pause(false);
        assert_eq!(whole(&survey).done, 300);
        wait_for("calls at the first step and at the end", || (woken.load(Ordering::SeqCst) >= 2).then_some(()));
    }

    #[test]
    fn the_thread_ends_with_the_survey_at_work_or_at_rest() {
        for pauses in [false, true] {
            let (series, log) = logged(1000);
            log.hang(!pauses);
            let survey = silent(&series);
            survey.pause(pauses);
            drop(survey);
            wait_for("end", || (Arc::strong_count(&series) == 1).then_some(()));
        }
    }
}
