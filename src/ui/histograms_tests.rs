//! Histograms of the job against direct counts, and what it does on the way.

use super::super::worker::tests::{counted, wait_for};
use super::*;
use crate::codec::vq::VqOptions;
use crate::error::FileResult;
use crate::field::{Association, Component, FieldInfo, FieldSelector, SeriesSource, TimeAxis};
use crate::histograms::{SeriesView, of_series, spread};
use crate::ingest::{CodecChoice, IngestOptions, ingest};
use crate::mesh::RawMesh;
use crate::mesh::test_meshes::kuhn_grid;
use crate::pipeline::test_series::{Log, jet, logged};
use crate::store::Store;
use crate::task::Silent;
use std::sync::atomic::Ordering;

const KINDS: [Space; 4] = [Space::Scalar, Space::ScalarGradient, Space::Cov, Space::ScalarCov];

/// A field of points and one of cells, with holes and larger values at later steps.
struct Waves {
    times: TimeAxis,
    fields: [FieldInfo; 2],
    mesh: RawMesh,
}

impl SeriesSource for Waves {
    fn describe(&self) -> String {
        "waves".to_owned()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }

    fn read(&self, field: &FieldInfo, _: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let count = match field.association {
            Association::Point => self.mesh.points.len(),
            Association::Cell => self.mesh.cells.tets.len(),
        };
        out.clear();
        out.extend((0..count).map(|i| ((i * 31 + step) as f32).sin() * (1 + step) as f32));
        out[step % 7] = f32::NAN;
        Ok(())
    }
}

/// A store in a temporary folder.
fn waves(steps: usize) -> (tempfile::TempDir, Store) {
    coded(steps, CodecChoice::default())
}

/// The same with a codec.
fn coded(steps: usize, codec: CodecChoice) -> (tempfile::TempDir, Store) {
    let info = |name: &str, association| FieldInfo { name: name.to_owned(), components: 1, association };
    let fields = [info("p", Association::Point), info("c", Association::Cell)];
    let times = TimeAxis { values: (0..steps).map(|step| step as f64).collect() };
    let (dir, source) = (tempfile::tempdir().unwrap(), Waves { times, fields, mesh: kuhn_grid([4, 3, 2]) });
    let path = dir.path().join("waves.zarr");
    ingest(&source, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
    (dir, Store::open(path).unwrap())
}

fn series(store: &Store, field: &str) -> Arc<Series> {
    let selector: FieldSelector = field.parse().unwrap();
    Arc::new(Series::open(store, Some(&selector)).unwrap())
}

/// The histograms of all kinds of a series, counted here.
fn direct(series: &Series) -> Vec<Histogram> {
    let cov = series.coefficients_of_variation(&Cancel::new()).unwrap().unwrap();
    let (values_of, scalar_range) = (series.values_of(), series.field().range);
    let view = SeriesView { mesh: series.mesh(), values_of, scalar_range, cov: &cov };
    let read = |step: usize, out: &mut [f32]| series.decode_step(step, out, &Cancel::new());
    of_series(&Kind::ALL, &view, series.times().len(), read).unwrap().unwrap()
}

fn of_kind(all: &[Histogram], kind: Space) -> &Histogram {
    &all[Kind::ALL.iter().position(|other| other.name() == kind_of(kind).name()).unwrap()]
}

fn silent() -> Histograms {
    Histograms::start(Arc::new(|| ())).unwrap()
}

fn asked(series: &Arc<Series>, kind: Space, of: Wanted) -> Option<Asked> {
    Some(Asked { series: series.clone(), kind, of })
}

/// Waits for a histogram of these steps.
fn shown(job: &mut Histograms, of: Steps) -> Arc<Shown> {
    wait_for("histogram", || {
        job.take();
        job.shown().filter(|shown| shown.of == of).cloned()
    })
}

fn whole(job: &mut Histograms, steps: usize) -> Arc<Shown> {
    shown(job, Steps::Series { counted: steps, steps })
}

/// Waits for a message.
fn problem(job: &mut Histograms) -> String {
    wait_for("problem", || {
        job.take();
        job.problem().map(str::to_owned)
    })
}

#[test]
fn histograms_of_a_series_are_those_of_a_direct_count_and_are_kept() {
    let vq = || CodecChoice::new(VqOptions { entries: 16, ..VqOptions::default() });
    for (steps, codec) in [(7, CodecChoice::default()), (70, CodecChoice::default()), (130, vq())] {
        let (_dir, store) = coded(steps, codec);
        for field in ["p", "c"] {
            let (series, mut job) = (series(&store, field), silent());
            let expected = direct(&series);
            for kind in KINDS {
                job.ask(asked(&series, kind, Wanted::Series));
                let found = whole(&mut job, steps);
                assert_eq!((found.kind, &found.histogram), (kind, of_kind(&expected, kind)), "{field}");
                assert_eq!(job.problem(), None);
            }
            assert!(expected[0].nonfinite() > 0 && expected[0] != expected[3], "the test can fail");
            let selector: FieldSelector = field.parse().unwrap();
            let kept = store.field(&selector).unwrap().stored_histograms();
            assert_eq!(kept.as_ref(), Some(&expected));
        }
    }
}

#[test]
fn stored_histograms_come_at_once_and_nothing_is_decoded() {
    let series = jet();
    series.histograms(&Cancel::new()).unwrap();
    let (again, mut job) = (jet(), silent());
    job.ask(asked(&again, Space::Scalar, Wanted::Series));
    let first = wait_for("histogram", || job.take().then(|| job.shown().cloned())?);
    assert_eq!(first.of, Steps::Series { counted: 4, steps: 4 });
    assert_eq!(again.blocks().statistics().loads, 0);
}

#[test]
fn some_steps_are_shown_first_and_the_rest_is_added_to_them() {
    let (series, log) = logged(40);
    log.count();
    log.take(Duration::from_millis(8));
    let (woken, wake) = counted();
    let mut job = Histograms::start(wake).unwrap();
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    let mut seen = Vec::new();
    wait_for("end", || {
        let is_new = job.take();
        let Some(Shown { of: Steps::Series { counted, steps: 40 }, histogram, .. }) = job.shown().map(|s| &**s) else {
            return None;
        };
        if is_new {
            assert_eq!(histogram.counts().iter().sum::<u64>(), (counted * series.scalar_count()) as u64);
            assert_eq!(histogram.ranges()[0], series.field().range, "the bins of the whole");
            seen.push(*counted);
        }
        (*counted == 40).then_some(())
    });
    assert!(seen[0] < 40 && seen.windows(2).all(|pair| pair[0] < pair[1]), "{seen:?}");
    assert_eq!(log.decoded(), spread(40, 1, 40), "each step once");
    assert_eq!(&log.decoded()[..3], [0, 39, 19]);
    assert!(woken.load(Ordering::SeqCst) >= 2);
}

#[test]
fn what_was_counted_before_a_pause_or_when_nobody_looked_is_not_counted_again() {
    let (series, log) = logged(60);
    log.count();
    log.take(Duration::from_millis(3));
    let mut job = silent();
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    wait_for("some steps", || (log.decoded().len() > 4).then_some(()));
    job.pause(true);
    let at_rest = wait_for("rest", || {
        let before = log.decoded().len();
        std::thread::sleep(Duration::from_millis(50));
        (log.decoded().len() == before).then_some(before)
    });
    assert!(at_rest < 60);
    job.pause(false);
    wait_for("more steps", || (log.decoded().len() > at_rest + 2).then_some(()));
    job.ask(None);
    assert!(job.shown().is_none());
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    whole(&mut job, 60);
    assert_eq!(log.decoded(), spread(60, 1, 60));
}

#[test]
fn while_it_pauses_others_count_on() {
    let (series, log) = logged(50);
    log.count();
    log.take(Duration::from_millis(2));
    let mut job = silent();
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    wait_for("begin", || (!log.decoded().is_empty()).then_some(()));
    job.pause(true);
    assert!(series.histograms(&Cancel::new()).unwrap().is_some());
    assert_eq!(log.decoded().len(), 50);
    job.pause(false);
    whole(&mut job, 50);
    assert_eq!(log.decoded().len(), 50, "each step once, whoever counts");
}

#[test]
fn a_step_is_counted_over_the_axes_of_the_series() {
    let (_dir, store) = waves(5);
    for field in ["p", "c"] {
        let (series, mut job) = (series(&store, field), silent());
        let all = series.histograms(&Cancel::new()).unwrap().unwrap();
        for kind in KINDS {
            let mut found = Vec::new();
            for step in [3, 0] {
                job.ask(asked(&series, kind, Wanted::Step(step)));
                found.push(shown(&mut job, Steps::Step(step)));
                let cov = series.coefficients_of_variation(&Cancel::new()).unwrap().unwrap();
                let (values_of, scalar_range) = (series.values_of(), series.field().range);
                let view = SeriesView { mesh: series.mesh(), values_of, scalar_range, cov: &cov };
                let mut scalars = vec![0.0; series.scalar_count()];
                assert!(series.decode_step(step, &mut scalars, &Cancel::new()).unwrap());
                let ranges = of_kind(&all, kind).ranges();
                let expected = view.with_step(&scalars, |view| kind_of(kind).of_step(ranges, view));
                let last = found.last().unwrap();
                assert_eq!((last.kind, &last.histogram), (kind, &expected), "{field} {step}");
            }
            assert_eq!(found[0].histogram == found[1].histogram, kind == Space::Cov, "the test can fail");
        }
    }
}

#[test]
fn of_the_steps_that_wait_only_the_newest_is_counted_and_a_newer_one_ends_decoding() {
    let (series, log) = logged(100);
    log.hang(true);
    let mut job = silent();
    (0..100).for_each(|step| job.ask(asked(&series, Space::Scalar, Wanted::Step(step))));
    log.hang(false);
    shown(&mut job, Steps::Step(99));
    assert_eq!(log.decoded(), [99]);
    // The same request again does nothing.
    job.ask(asked(&series, Space::Scalar, Wanted::Step(99)));
    job.ask(asked(&series, Space::Scalar, Wanted::Step(5)));
    shown(&mut job, Steps::Step(5));
    assert_eq!(log.decoded(), [99, 5]);
}

#[test]
fn a_step_that_fails_or_panics_is_said_and_what_was_shown_stays() {
    let (series, log) = logged(5);
    log.fail_at(1);
    log.panic_at(2);
    let mut job = silent();
    job.ask(asked(&series, Space::Scalar, Wanted::Step(4)));
    shown(&mut job, Steps::Step(4));
    for (step, word) in [(1, "damaged"), (2, "not meant")] {
        job.ask(asked(&series, Space::Scalar, Wanted::Step(step)));
        let problem = problem(&mut job);
        assert!(problem.contains(word), "{problem}");
        assert_eq!(job.shown().unwrap().of, Steps::Step(4));
    }
    job.ask(asked(&series, Space::Scalar, Wanted::Step(3)));
    assert_eq!(job.problem(), None);
    shown(&mut job, Steps::Step(3));
}

#[test]
fn steps_that_cannot_be_read_end_the_counting_with_a_word_and_the_sample_stays() {
    let (series, log) = logged(9);
    let mut job = silent();
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    assert!(problem(&mut job).contains("no histograms"), "there are none");
    log.count();
    let order = spread(9, 1, 9);
    log.fail_at(order[6]);
    job.ask(None);
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    assert!(problem(&mut job).contains("damaged"));
    assert_eq!(job.shown().unwrap().of, Steps::Series { counted: 6, steps: 9 });
    // A step of the same series is shown meanwhile, and going back is enough to see the sample and the message again.
    job.ask(asked(&series, Space::Scalar, Wanted::Step(0)));
    shown(&mut job, Steps::Step(0));
    assert_eq!(job.problem(), None);
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    assert_eq!(job.shown().unwrap().of, Steps::Series { counted: 6, steps: 9 });
    assert!(job.problem().unwrap().contains("damaged"));
    // After a panic nothing that was counted is trusted.
    log.panic_at(order[7]);
    log.fail_at(100);
    job.ask(None);
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    assert!(problem(&mut job).contains("not meant"));
    log.panic_at(100);
    let before = log.decoded().len();
    assert_eq!(series.histograms(&Cancel::new()).unwrap().unwrap()[0], direct(&series)[0]);
    assert_eq!(&log.decoded()[before..][..9], order);
}

#[test]
fn a_store_that_cannot_keep_them_shows_them_with_a_word() {
    let (dir, store) = waves(4);
    // A name of the greatest length leaves none for the temporary folder beside it, also for a user who may write everywhere.
    let long = dir.path().join("w".repeat(255));
    std::fs::rename(store.path(), &long).unwrap();
    let (series, mut job) = (series(&Store::open(&long).unwrap(), "p"), silent());
    job.ask(asked(&series, Space::Scalar, Wanted::Series));
    let problem = problem(&mut job);
    assert!(problem.contains("again next time") && problem.contains(&*dir.path().to_string_lossy()), "{problem}");
    assert_eq!(job.shown().unwrap().histogram, direct(&series)[0]);
}

#[test]
fn another_series_replaces_what_was_shown_and_threads_end_with_the_job() {
    let ((one, log), (other, other_log)) = (logged(5), logged(6));
    [&log, &other_log].into_iter().for_each(Log::count);
    let mut job = silent();
    job.ask(asked(&one, Space::Scalar, Wanted::Series));
    whole(&mut job, 5);
    job.ask(asked(&other, Space::Scalar, Wanted::Series));
    assert!(job.shown().is_none());
    whole(&mut job, 6);
    for pauses in [false, true] {
        let ((series, log), mut job) = (logged(9), silent());
        log.count();
        log.hang(true);
        job.pause(pauses);
        job.ask(asked(&series, Space::Scalar, Wanted::Series));
        job.ask(asked(&series, Space::Scalar, Wanted::Step(3)));
        drop(job);
        wait_for("end", || (Arc::strong_count(&series) == 1).then_some(()));
    }
}
