//! What a follower reports while steps are added, and what it does not.

use super::*;
use crate::ingest::{AppendOptions, CodecChoice, IngestOptions, append, ingest};
use crate::synth::{SeriesName, Synth, SynthSpec, generate};
use crate::task::{Cancel, Silent};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError as NotWoken, channel};

const LONG: Duration = Duration::from_secs(120);
const SHORT: Duration = Duration::from_millis(1);
/// Several checks of a follower at that interval, also where a store is missing, which takes a quarter of a second each.
const QUIET: Duration = Duration::from_millis(600);
const STEPS: usize = 8;

/// A store that grows.
struct Growing {
    dir: tempfile::TempDir,
    source: Synth,
}

impl Growing {
    /// A store with the first three steps.
    fn new(codec: CodecChoice) -> Self {
        let source = generate(&SynthSpec { cells: 600, steps: STEPS, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
        let new = Self { dir: tempfile::tempdir().unwrap(), source };
        let options = IngestOptions { steps: "0..2".parse().unwrap(), codec, ..Default::default() };
        ingest(&new.source, &new.path(), &options, &Silent, &Cancel::new()).unwrap();
        new
    }

    fn path(&self) -> PathBuf {
        self.dir.path().join("s.zarr")
    }

    fn grow_to(&self, steps: usize) {
        let options = AppendOptions { steps: format!("0..{}", steps - 1).parse().unwrap(), ..Default::default() };
        append(&self.source, &self.path(), &options, &Silent, &Cancel::new()).unwrap();
    }

    fn open(&self, field: usize) -> (Arc<Store>, Arc<Series>) {
        let store = Store::open(self.path()).unwrap();
        let name = FieldSelector { name: store.fields()[field].name.clone(), component: None };
        let series = Series::open(&store, Some(&name)).unwrap();
        (Arc::new(store), Arc::new(series))
    }
}

/// A follower and its wake-ups.
struct Following {
    follower: Follower,
    woken: std::sync::mpsc::Receiver<()>,
}

impl Following {
    fn of((store, series): &(Arc<Store>, Arc<Series>)) -> Self {
        let (to, woken) = channel();
        let wake: Wake = Arc::new(move || _ = to.send(()));
        Self { follower: Follower::start_every(SHORT, store.clone(), series.clone(), wake), woken }
    }

    /// The next result.
    fn next(&self) -> Result<Grown, String> {
        loop {
            if let Some(found) = self.follower.take() {
                return found;
            }
            self.woken.recv_timeout(LONG).expect("it wakes");
        }
    }

    /// Checks that no result comes; wake-ups for earlier ones may still be pending.
    fn stays_quiet(&self) {
        let wakes = (0..6).take_while(|_| self.woken.recv_timeout(QUIET).is_ok()).count();
        assert!(wakes < 6 && self.follower.take().is_none(), "{wakes} wakes");
    }

    /// Takes results until a series has this many steps.
    fn until(&self, steps: usize) -> Grown {
        loop {
            let grown = self.next().unwrap();
            assert_eq!(grown.series.times(), grown.store.times());
            if grown.series.times().len() == steps {
                return grown;
            }
        }
    }
}

fn vq() -> CodecChoice {
    CodecChoice::new(crate::codec::vq::VqOptions { entries: 16, ..Default::default() })
}

#[test]
fn every_append_arrives_with_the_mesh_and_the_field_that_were_open() {
    for codec in [CodecChoice::default(), vq()] {
        let growing = Growing::new(codec);
        let open = growing.open(0);
        let following = Following::of(&open);
        for steps in [4, 5, STEPS] {
            growing.grow_to(steps);
            let grown = following.until(steps);
            assert!(Arc::ptr_eq(grown.series.mesh(), open.1.mesh()), "the mesh is read once");
            assert_eq!(grown.series.field().name, open.1.field().name);
            let name = FieldSelector { name: grown.series.field().name.clone(), component: None };
            let mut values = vec![0.0; grown.series.mesh().positions.local.len()];
            grown.store.field(&name).unwrap().decode_step(steps - 1, &mut values).unwrap();
        }
        assert!(following.follower.take().is_none());
    }
}

#[test]
fn steps_that_come_all_the_time_arrive_in_order_up_to_the_last() {
    let growing = Growing::new(vq());
    let open = growing.open(0);
    let following = Following::of(&open);
    std::thread::scope(|scope| {
        scope.spawn(|| (4..=STEPS).for_each(|steps| growing.grow_to(steps)));
        let mut seen = vec![open.0.times().len()];
        while seen[seen.len() - 1] < STEPS {
            seen.push(following.next().unwrap().store.times().len());
        }
        assert!(seen.is_sorted(), "{seen:?}");
    });
}

#[test]
fn another_field_is_followed_as_soon_as_it_is_told() {
    let growing = Growing::new(CodecChoice::default());
    let (open, other) = (growing.open(0), growing.open(1).1);
    assert_ne!(open.1.field().name, other.field().name);
    let following = Following::of(&open);
    growing.grow_to(5);
    while lock(&following.follower.shared.state).found.is_none() {
        following.woken.recv_timeout(LONG).unwrap();
    }
    // The result is for the first field, and was not taken.
    following.follower.set_field(other.clone());
    assert!(following.follower.take().is_none_or(|found| found.unwrap().series.field().name == other.field().name));
    growing.grow_to(6);
    assert_eq!(following.until(6).series.field().name, other.field().name);
    // A field opened from an old store.
    following.follower.set_field(open.1.clone());
    assert_eq!(following.until(6).series.field().name, open.1.field().name);
}

#[test]
fn while_nothing_changes_nobody_is_woken() {
    let growing = Growing::new(CodecChoice::default());
    let following = Following::of(&growing.open(0));
    assert_eq!(following.woken.recv_timeout(QUIET), Err(NotWoken::Timeout));
    assert!(following.follower.take().is_none());
}

#[test]
fn an_error_is_told_once_and_what_comes_after_it_is_taken_up() {
    let growing = Growing::new(CodecChoice::default());
    let following = Following::of(&growing.open(0));
    let aside = growing.dir.path().join("aside");
    std::fs::rename(growing.path(), &aside).unwrap();
    let error = following.next().unwrap_err();
    assert!(error.contains("s.zarr") && error.contains("does not exist"), "{error}");
    following.stays_quiet();
    std::fs::rename(&aside, growing.path()).unwrap();
    growing.grow_to(4);
    following.until(4);
    let other = generate(&SynthSpec { cells: 900, steps: 4, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    let options = IngestOptions { overwrite: true, ..Default::default() };
    ingest(&other, &growing.path(), &options, &Silent, &Cancel::new()).unwrap();
    let error = following.next().unwrap_err();
    assert!(error.contains("another mesh") && error.contains("open it again"), "{error}");
    following.stays_quiet();
}

#[test]
fn a_change_that_leaves_no_sign_is_found_later() {
    let growing = Growing::new(CodecChoice::default());
    let mut watch = Watch::new(growing.open(0).0);
    growing.grow_to(5);
    watch.seen = signs(&growing.path());
    let looks: Vec<bool> = (0..LOOKS_TRUSTED).map(|_| watch.look().unwrap()).collect();
    assert_eq!(looks.iter().position(|asked| *asked), Some(LOOKS_TRUSTED as usize - 1));
    assert_eq!(watch.store.times().len(), 5);
}

#[test]
fn a_follower_that_is_dropped_ends() {
    let growing = Growing::new(CodecChoice::default());
    let shared = Arc::downgrade(&Following::of(&growing.open(0)).follower.shared);
    while shared.strong_count() > 0 {
        std::thread::yield_now();
    }
}
