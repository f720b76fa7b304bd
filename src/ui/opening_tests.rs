//! Opening in the background: results, progress and leftovers.

use super::*;
use crate::ingest::{IngestOptions, ingest};
use crate::synth::{SeriesName, SynthSpec, generate};
use crate::task::Silent;
use std::fs;
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, channel};

const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/data/tornado");
const LONG: Duration = Duration::from_secs(120);

/// A folder with a cache, and a wake callback.
struct Place {
    dir: tempfile::TempDir,
    wake: Wake,
    woken: Receiver<()>,
}

impl Place {
    fn new() -> Self {
        let (to, woken) = channel();
        let wake: Wake = Arc::new(move || _ = to.send(()));
        Self { dir: tempfile::tempdir().unwrap(), wake, woken }
    }

    fn options(&self) -> OpeningOptions {
        OpeningOptions { cache: ImportCache::at(self.dir.path().join("cache")), ..Default::default() }
    }

    fn start(&self, paths: &[PathBuf]) -> Opening {
        Opening::start(paths.to_vec(), self.options(), self.wake.clone())
    }

    /// Waits for the end; returns all progress seen, the last one included.
    fn watch(&self, opening: &Opening) -> (OpeningEnd, Vec<OpeningProgress>) {
        let mut seen = vec![opening.progress()];
        loop {
            self.woken.recv_timeout(LONG).expect("it wakes");
            let end = opening.take();
            seen.push(opening.progress());
            if let Some(end) = end {
                assert!(opening.progress().fraction == 1.0 && opening.take().is_none(), "the end is handed over once");
                return (end, seen);
            }
        }
    }

    fn opened(&self, paths: &[PathBuf]) -> (Opened, Vec<OpeningProgress>) {
        match self.watch(&self.start(paths)) {
            (OpeningEnd::Opened(opened), seen) => (*opened, seen),
            (other, _) => panic!("{other:?}"),
        }
    }

    fn failed(&self, paths: &[PathBuf]) -> String {
        match self.watch(&self.start(paths)) {
            (OpeningEnd::Failed(text), _) => text,
            (other, _) => panic!("{other:?}"),
        }
    }

    fn cached(&self) -> usize {
        fs::read_dir(self.dir.path().join("cache")).map_or(0, Iterator::count)
    }
}

fn shipped() -> PathBuf {
    Path::new(SHIPPED).join("tornado.pvd")
}

fn assert_never_back(seen: &[OpeningProgress]) {
    for pair in seen.windows(2) {
        assert!(pair[0].fraction <= pair[1].fraction, "{seen:#?}");
        assert!(pair[0].stage != pair[1].stage || pair[0].done <= pair[1].done, "{seen:#?}");
    }
    assert!(seen.iter().all(|p| p.done <= p.total));
    assert_eq!(seen.last().map(|p| p.fraction), Some(1.0));
}

#[test]
fn a_source_is_imported_with_progress_and_the_second_time_it_is_there() {
    let place = Place::new();
    let (opened, seen) = place.opened(&[shipped()]);
    assert_never_back(&seen);
    assert!(matches!(opened.origin, Origin::Imported(_)));
    assert_eq!((opened.path.clone(), opened.name.as_str()), (shipped(), "tornado.pvd"));
    assert_eq!(opened.series.times().len(), opened.store.times().len());
    let (again, seen) = place.opened(&[shipped()]);
    assert_never_back(&seen);
    assert!(matches!(again.origin, Origin::Cached) && seen.iter().all(|p| p.total == 0), "{seen:#?}");
    assert_eq!(again.store.path(), opened.store.path());
    let (store, _) = place.opened(&[opened.store.path().to_owned()]);
    assert!(matches!(store.origin, Origin::Store) && store.path == opened.store.path());
}

#[test]
fn several_steps_are_one_series_that_opens_again_from_the_cache() {
    let place = Place::new();
    let paths: Vec<PathBuf> = [3, 1, 2].map(|i| Path::new(SHIPPED).join(format!("tornado_000{i}.vtu"))).to_vec();
    let (opened, _) = place.opened(&paths);
    assert_eq!((opened.store.times().len(), opened.name.as_str()), (3, "tornado_0003.vtu and 2 more"));
    assert!(matches!(place.opened(&[opened.path]).0.origin, Origin::Store));
}

#[test]
fn cancelling_in_the_middle_of_an_import_leaves_nothing() {
    let place = Place::new();
    // The wake call when the steps begin is on the importing thread.
    let cell: Arc<OnceLock<(Arc<Shared>, Cancel)>> = Arc::default();
    let (inner, outer) = (cell.clone(), place.wake.clone());
    let wake: Wake = Arc::new(move || {
        let (shared, cancel) = inner.wait();
        let is_in_steps = lock(&shared.state).now.total > 0;
        if is_in_steps {
            cancel.cancel();
        }
        outer();
    });
    let opening = Opening::start(vec![shipped()], place.options(), wake);
    assert!(cell.set((opening.shared.clone(), opening.cancel.clone())).is_ok());
    let (end, seen) = place.watch(&opening);
    assert!(matches!(end, OpeningEnd::Cancelled), "{end:?}");
    assert_never_back(&seen);
    assert!(place.dir.path().join("cache").is_dir() && place.cached() == 0, "it had begun, and left nothing");
    let opening = place.start(&[shipped()]);
    opening.cancel();
    assert!(matches!(place.watch(&opening).0, OpeningEnd::Cancelled));
    assert_eq!(place.cached(), 0);
    let shared = {
        let opening = place.start(&[shipped()]);
        opening.shared.clone()
    };
    while lock(&shared.state).end.is_none() {
        place.woken.recv_timeout(LONG).unwrap();
    }
    assert!(matches!(lock(&shared.state).end, Some(OpeningEnd::Cancelled)), "dropped");
    assert_eq!(place.cached(), 0);
}

#[test]
fn what_cannot_be_opened_says_why_and_what_to_do() {
    let place = Place::new();
    let path = |name: &str| place.dir.path().join(name);
    fs::create_dir(path("none.zarr")).unwrap();
    fs::create_dir(path("folder")).unwrap();
    fs::write(path("a.stl"), "solid").unwrap();
    fs::write(path("a.vtu"), "no XML").unwrap();
    let store = path("s.zarr");
    let series = generate(&SynthSpec { cells: 600, steps: 2, ..SynthSpec::new(SeriesName::Slab) }).unwrap();
    ingest(&series, &store, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    let read = [".pvd", ".vtu", ".xdmf"];
    let cases: [(&[&str], &[&str]); 8] = [
        (&["none.zarr"], &["none.zarr", "not that of a tetreel store", "import the series first"]),
        (&["gone.zarr"], &["gone.zarr", "cannot open", "moved or renamed"]),
        (&["gone"], &["gone", "cannot open", "moved or renamed"]),
        (&["folder"], &read),
        (&["a.stl"], &read),
        (&["a.vtu"], &["a.vtu"]),
        (&["s.zarr", "a.vtu"], &["s.zarr", "open it alone"]),
        (&["a.stl", "a.vtu"], &read),
    ];
    for (names, parts) in cases {
        let text = place.failed(&names.iter().map(|name| path(name)).collect::<Vec<_>>());
        assert!(parts.iter().all(|part| text.contains(part)), "{names:?}: {text}");
    }
    assert!(place.failed(&[]).contains("no file"));
    let options = OpeningOptions { field: Some("nowhere".parse().unwrap()), ..place.options() };
    let opening = Opening::start(vec![store], options, place.wake.clone());
    let OpeningEnd::Failed(text) = place.watch(&opening).0 else { panic!("there is no such field") };
    assert!(text.contains("nowhere") && text.contains("the fields are"), "{text}");
    assert_eq!(place.cached(), 0);
}

#[test]
fn a_panic_becomes_an_error() {
    let place = Place::new();
    let opening = Opening::start_job(vec![shipped()], place.wake.clone(), |_, _| panic!("on purpose"));
    let (end, seen) = place.watch(&opening);
    let OpeningEnd::Failed(text) = end else { panic!("{end:?}") };
    assert!(text.contains("on purpose") && text.contains("report"), "{text}");
    assert_never_back(&seen);
}

#[test]
fn a_source_is_seen_before_it_is_imported() {
    let place = Place::new();
    let (calls, is_seen) = (Arc::new(Mutex::new(0)), Cancel::new());
    let (counted, seen) = (calls.clone(), is_seen.clone());
    // With its second call the import begins with the steps; the other thread calls when it has drawn.
    let wake: Wake = Arc::new(move || {
        if std::thread::current().name() != Some("opening") {
            seen.cancel();
            return;
        }
        let calls = {
            let mut calls = counted.lock().unwrap();
            *calls += 1;
            *calls
        };
        let begun = Instant::now();
        while calls == 2 && !seen.is_cancelled() && begun.elapsed() < LONG {
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    let look = |series: &Series| crate::look::Look::first_for(series, &Cancel::new()).ok();
    let first = FirstPicture { look: Arc::new(look), size_px: (60, 40), background: [0.25; 3] };
    let options = OpeningOptions { first_picture: Some(first), ..place.options() };
    let opening = Opening::start(vec![shipped()], options.clone(), wake);
    let begun = Instant::now();
    while !is_seen.is_cancelled() && begun.elapsed() < LONG {
        std::thread::sleep(Duration::from_millis(1));
    }
    let picture = opening.picture().expect("a picture while steps are imported");
    assert_eq!(picture.size, [60, 40]);
    let colors: std::collections::BTreeSet<[u8; 4]> = picture.pixels.iter().copied().collect();
    assert!(colors.len() > 50 && colors.contains(&[64, 64, 64, 255]), "{}", colors.len());
    let end = loop {
        if let Some(end) = opening.take() {
            break end;
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    assert!(matches!(end, OpeningEnd::Opened(_)), "{end:?}");
    // What was imported before is opened without one.
    let again = Opening::start(vec![shipped()], options, place.wake.clone());
    assert!(matches!(place.watch(&again).0, OpeningEnd::Opened(_)));
    assert!(again.picture().is_none());
}
