//! Interrupted imports that go on: the store of one import, to the byte, or an error that says why not.

use super::append::{part, value, vq};
use super::{Formulas, contents, import, list};
use std::collections::BTreeSet;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tetreel::field::FieldSelector;
use tetreel::ingest::{Checkpoints, CodecChoice, IngestError, IngestOptions, IngestReport, ingest};
use tetreel::store::Store;
use tetreel::task::{Cancel, Progress, Silent};

/// Checkpoints at the end of every block.
const ALWAYS: Option<Checkpoints> = Some(Checkpoints { pause: Duration::ZERO });
/// None in the time of a test.
const SELDOM: Option<Checkpoints> = Some(Checkpoints { pause: Duration::from_secs(3600) });

fn options(codec: &Option<CodecChoice>) -> IngestOptions {
    IngestOptions { codec: codec.clone().unwrap_or_default(), checkpoints: ALWAYS, ..Default::default() }
}

/// How an import ends early.
#[derive(Clone, Copy, Debug)]
enum End {
    FailsAt(usize),
    CancelledAt(usize),
}
use End::{CancelledAt, FailsAt};

fn ending(end: End, mut source: Formulas) -> Formulas {
    match end {
        FailsAt(step) => source.fail_at = Some(step),
        CancelledAt(step) => source.cancel_at = Some((step, Cancel::new())),
    }
    source
}

fn interrupt(end: End, source: Formulas, out: &Path, options: &IngestOptions) {
    let error = import(&ending(end, source), out, options).unwrap_err();
    assert_eq!(matches!(error, IngestError::Cancelled), matches!(end, CancelledAt(_)), "{error}");
}

/// A source, and the steps that are read from it.
fn watched(steps: Range<usize>) -> (Formulas, Arc<Mutex<BTreeSet<usize>>>) {
    let read: Arc<Mutex<BTreeSet<usize>>> = Arc::default();
    let seen = read.clone();
    let mut source = part(steps);
    source.value = Box::new(move |name, component, step, i| {
        seen.lock().unwrap().insert(step);
        value(name, component, step, i)
    });
    (source, read)
}

/// What an import says.
#[derive(Default)]
struct Said(Mutex<Vec<String>>);

impl Progress for Said {
    fn begin(&self, _stage: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _n: u64) {}
    fn end(&self) {}
    fn say(&self, line: &str) {
        self.0.lock().unwrap().push(line.to_owned());
    }
}

struct Place {
    dir: tempfile::TempDir,
    out: PathBuf,
    partial: PathBuf,
}

impl Place {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let [out, partial] = ["s.zarr", "s.zarr.partial"].map(|name| dir.path().join(name));
        Self { dir, out, partial }
    }

    fn names(&self) -> Vec<String> {
        list(self.dir.path())
    }

    /// The store of one import without a break.
    fn whole(&self, source: &Formulas, codec: &Option<CodecChoice>) -> Vec<(String, Vec<u8>)> {
        let out = self.dir.path().join("whole.zarr");
        import(source, &out, &IngestOptions { checkpoints: None, ..options(codec) }).unwrap();
        let whole = contents(&out);
        fs::remove_dir_all(&out).unwrap();
        whole
    }
}

/// Checks every file.
fn assert_same(out: &Path, whole: &[(String, Vec<u8>)]) {
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    let found = contents(out);
    assert_eq!(names(&found), names(whole));
    for ((name, bytes), (_, expected)) in found.iter().zip(whole) {
        assert!(bytes == expected, "{name} differs");
    }
}

/// Interrupts an import of `steps` at each of `ends`, and lets it go on; `kept` are the steps that are kept each time.
fn goes_on(steps: usize, ends: &[(End, usize)], codec: &Option<CodecChoice>) {
    let place = Place::new();
    let whole = place.whole(&part(0..steps), codec);
    let mut before = 0;
    for &(end, kept) in ends {
        interrupt(end, part(0..steps), &place.out, &options(codec));
        let left = if kept > 0 { vec!["s.zarr.partial"] } else { vec![] };
        assert_eq!(place.names(), left, "{end:?}");
        before = kept;
    }
    let (source, read) = watched(0..steps);
    let said = Said::default();
    let report = ingest(&source, &place.out, &options(codec), &said, &Cancel::new()).unwrap();
    assert_eq!(report.steps, steps);
    assert_same(&place.out, &whole);
    assert_eq!(place.names(), ["s.zarr"], "nothing else is left");
    assert_eq!(read.lock().unwrap().first().copied(), Some(before.saturating_sub(1)), "{ends:?}");
    let lines = said.0.lock().unwrap();
    let line = format!("goes on at step {} of {steps}", before + 1);
    assert_eq!(lines.iter().any(|said| said.contains(&line)), before > 0, "{lines:?}");
}

#[test]
fn a_raw_import_goes_on_wherever_it_ended() {
    for (end, kept) in [(0, 0), (1, 1), (5, 5), (8, 8)] {
        goes_on(9, &[(FailsAt(end), kept)], &None);
    }
    goes_on(9, &[(FailsAt(3), 3), (FailsAt(3), 3), (FailsAt(7), 7)], &None);
}

#[test]
fn a_cancelled_import_goes_on_from_the_last_checkpoint() {
    for end in [0, 2, 6] {
        let place = Place::new();
        let whole = place.whole(&part(0..8), &None);
        interrupt(CancelledAt(end), part(0..8), &place.out, &options(&None));
        // The source is read ahead.
        assert!(place.names().len() <= 1 && !place.out.exists());
        let report = import(&part(0..8), &place.out, &options(&None)).unwrap();
        assert!(report.steps == 8 && place.names() == ["s.zarr"]);
        assert_same(&place.out, &whole);
    }
}

// Long: codebooks are trained.
#[test]
fn a_vq_import_goes_on_behind_its_last_complete_block() {
    goes_on(70, &[(FailsAt(30), 0)], &vq(16, false));
    goes_on(150, &[(FailsAt(66), 64), (FailsAt(140), 128)], &vq(16, true));
    goes_on(128, &[(FailsAt(100), 64)], &vq(16, false));
}

#[test]
fn the_comparison_notices_a_byte() {
    let place = Place::new();
    let whole = place.whole(&part(0..5), &None);
    interrupt(FailsAt(3), part(0..5), &place.out, &options(&None));
    let chunk = place.partial.join("store/fields/T/raw/c/1/0");
    let mut bytes = fs::read(&chunk).unwrap();
    bytes[5] ^= 1;
    fs::write(&chunk, bytes).unwrap();
    import(&part(0..5), &place.out, &options(&None)).unwrap();
    let found = contents(&place.out);
    let differ: Vec<_> = found.iter().zip(&whole).filter(|(a, b)| a != b).map(|(a, _)| a.0.as_str()).collect();
    assert_eq!(differ, ["fields/T/raw/c/1/0"]);
}

#[test]
fn means_single_components_and_every_second_step_go_on() {
    let options = |checkpoints| IngestOptions {
        fields: ["p", "velocity:1", "T:mag"].map(|name| name.parse::<FieldSelector>().unwrap()).to_vec(),
        units: vec!["p=Pa".parse().unwrap()],
        steps: "1..11:2".parse().unwrap(),
        cells_to_points: true,
        checkpoints,
        ..Default::default()
    };
    let place = Place::new();
    let whole = place.dir.path().join("whole.zarr");
    import(&part(0..12), &whole, &options(None)).unwrap();
    interrupt(FailsAt(7), part(0..12), &place.out, &options(ALWAYS));
    import(&part(0..12), &place.out, &options(ALWAYS)).unwrap();
    assert_same(&place.out, &contents(&whole));
}

#[test]
fn special_values_and_exponents_go_on_and_what_lies_behind_the_checkpoint_does_not() {
    // Runs of one step at every second: more than a chunk of them in ten blocks.
    let blinking = |steps: usize, wild: bool| {
        let mut source = part(0..1);
        source.times.values = (0..steps).map(|i| i as f64).collect();
        source.fields.truncate(1);
        source.value = Box::new(move |_, _, step, i| match step {
            // Exponents and further runs, of which a later run must see nothing.
            64.. if wild => [3e38, f32::NAN, -3e38][(step + i) % 3],
            600.. if i == 5 => 3e38 * if step % 2 == 0 { 1.0 } else { -1.0 },
            _ if step % 2 == 0 => f32::NAN,
            _ => (i * step) as f32,
        });
        source
    };
    let codec = vq(4, false);
    let place = Place::new();
    let whole = place.whole(&blinking(660, false), &codec);
    interrupt(FailsAt(70), blinking(660, false), &place.out, &options(&codec));
    let seldom = IngestOptions { checkpoints: SELDOM, ..options(&codec) };
    interrupt(FailsAt(140), blinking(660, true), &place.out, &seldom);
    assert!(place.partial.join("store/fields/T/vq/exponent/c/1/0").exists(), "left behind the checkpoint");
    for end in [600, 650] {
        interrupt(FailsAt(end), blinking(660, false), &place.out, &options(&codec));
    }
    import(&blinking(660, false), &place.out, &options(&codec)).unwrap();
    assert_same(&place.out, &whole);
}

#[test]
fn a_source_that_has_grown_meanwhile_is_imported_to_its_end() {
    let place = Place::new();
    let whole = place.whole(&part(0..12), &None);
    interrupt(FailsAt(4), part(0..6), &place.out, &options(&None));
    import(&part(0..12), &place.out, &options(&None)).unwrap();
    assert_same(&place.out, &whole);
}

#[test]
fn an_import_of_something_else_is_refused_and_nothing_is_lost() {
    let place = Place::new();
    let whole = place.whole(&part(0..8), &None);
    interrupt(FailsAt(5), part(0..8), &place.out, &options(&None));
    let before = contents(&place.partial);
    let refuses = |source: Formulas, options: IngestOptions, parts: &[&str]| {
        let error = import(&source, &place.out, &options).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        assert!(contents(&place.partial) == before, "{error}");
        assert_eq!(place.names(), ["s.zarr.partial"]);
    };
    let begun = |parts: &[&'static str]| [parts, &["s.zarr.partial", "to begin again", "leave --resume out"]].concat();
    let changed = |change: &dyn Fn(&mut Formulas)| {
        let mut source = part(0..8);
        change(&mut source);
        source
    };
    let only = |fields: &[&str]| fields.iter().map(|name| name.parse().unwrap()).collect::<Vec<FieldSelector>>();
    refuses(part(0..8), options(&vq(16, false)), &begun(&["another codec", "'raw' instead of 'vq with 16 entries"]));
    let fields = IngestOptions { fields: only(&["T", "p"]), ..options(&None) };
    refuses(part(0..8), fields, &begun(&["another field", "velocity:0", "'p: "]));
    let units = IngestOptions { units: vec!["T=K".parse().unwrap()], ..options(&None) };
    refuses(part(0..8), units, &begun(&["another field", "unit 'K'"]));
    let means = IngestOptions { cells_to_points: true, ..options(&None) };
    refuses(part(0..8), means, &begun(&["another field", "averaged to vertices"]));
    let strided = IngestOptions { steps: "0..7:2".parse().unwrap(), ..options(&None) };
    refuses(part(0..8), strided, &begun(&["has 5 steps", "more than the 4"]));
    let later = IngestOptions { steps: "1..7".parse().unwrap(), ..options(&None) };
    refuses(part(0..8), later, &begun(&["other steps: 0 at time 0 instead of 1"]));
    refuses(changed(&|s| s.times.values[3] += 0.01), options(&None), &begun(&["other steps: 3 at time"]));
    refuses(changed(&|s| s.mesh.points[40].z += 1e-9), options(&None), &begun(&["another mesh"]));
    let other = |name: &str, component: usize, step: usize, i: usize| match (name, component, step, i) {
        ("velocity", 2, 4, 30) => 0.0,
        _ => value(name, component, step, i),
    };
    let parts = begun(&["field 'velocity:2'", "step 4 of the store", "other values", "in the same range"]);
    refuses(changed(&|s| s.value = Box::new(other)), options(&None), &parts);
    import(&part(0..8), &place.out, &options(&None)).unwrap();
    assert_same(&place.out, &whole);
}

/// Files and folders of an interrupted import, to be put back.
fn restore(partial: &Path, files: &[(String, Vec<u8>)]) {
    let _ = fs::remove_dir_all(partial);
    for (name, bytes) in files {
        let path = partial.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

fn resume(place: &Place) -> Result<IngestReport, IngestError> {
    import(&part(0..4), &place.out, &options(&None))
}

#[test]
fn damaged_checkpoints_are_refused_with_a_remedy_and_never_panic() {
    let place = Place::new();
    interrupt(FailsAt(3), part(0..4), &place.out, &options(&None));
    let kept = contents(&place.partial);
    let path = place.partial.join("checkpoint");
    let whole = fs::read(&path).unwrap();
    let refused = || {
        let error = resume(&place).unwrap_err().to_string();
        assert!(error.contains("s.zarr.partial") && error.contains("leave --resume out"), "{error}");
        assert!(!place.out.exists());
        error
    };
    for length in [0, 3, 21, 22, 400, whole.len() - 1] {
        fs::write(&path, &whole[..length]).unwrap();
        assert!(refused().contains("is damaged"));
    }
    for at in (0..whole.len()).step_by(whole.len() / 50) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        fs::write(&path, bytes).unwrap();
        refused();
    }
    let later = [b"tetreel checkpoint 9\n", &whole[21..]].concat();
    fs::write(&path, later).unwrap();
    assert!(refused().contains("another version"));
    // Chunks that are gone or cut.
    restore(&place.partial, &kept);
    let chunk = place.partial.join("store/cell_fields/p/raw/c/1/0");
    fs::write(&chunk, "").unwrap();
    assert!(refused().contains("cell_fields/p"));
    restore(&place.partial, &kept);
    fs::remove_file(&chunk).unwrap();
    assert!(refused().contains("that were written before"));
    restore(&place.partial, &kept);
    resume(&place).unwrap();
}

#[test]
fn forged_checkpoints_with_a_right_checksum_never_panic() {
    let place = Place::new();
    interrupt(FailsAt(3), part(0..4), &place.out, &options(&None));
    let kept = contents(&place.partial);
    let path = place.partial.join("checkpoint");
    let whole = fs::read(&path).unwrap();
    let end = whole.len() - 4;
    let mut refused = 0;
    for at in (21..end).step_by(end / 150) {
        restore(&place.partial, &kept);
        let mut bytes = whole.clone();
        bytes[at] = bytes[at].wrapping_add(0x7f);
        let checksum = crc32c::crc32c(&bytes[..end]).to_le_bytes();
        bytes[end..].copy_from_slice(&checksum);
        fs::write(&path, bytes).unwrap();
        refused += usize::from(resume(&place).is_err());
        let _ = fs::remove_dir_all(&place.out);
    }
    assert!(refused > 20, "{refused}");
}

#[test]
fn without_the_unfinished_store_the_import_begins_again() {
    let place = Place::new();
    let whole = place.whole(&part(0..4), &None);
    interrupt(FailsAt(3), part(0..4), &place.out, &options(&None));
    fs::remove_dir_all(place.partial.join("store")).unwrap();
    resume(&place).unwrap();
    assert_same(&place.out, &whole);
    assert_eq!(place.names(), ["s.zarr"]);
}

#[test]
fn of_two_at_once_the_second_is_refused_and_the_first_is_not_disturbed() {
    let place = Place::new();
    let whole = place.whole(&part(0..6), &None);
    let errors: Arc<Mutex<BTreeSet<String>>> = Arc::default();
    let (mut source, seen, out) = (part(0..6), errors.clone(), place.out.clone());
    source.value = Box::new(move |name, component, step, i| {
        if i == 0 {
            let error = ingest(&part(0..6), &out, &options(&None), &Silent, &Cancel::new()).unwrap_err();
            seen.lock().unwrap().insert(error.to_string());
        }
        value(name, component, step, i)
    });
    import(&source, &place.out, &options(&None)).unwrap();
    assert_same(&place.out, &whole);
    let errors = errors.lock().unwrap();
    let first = errors.first().unwrap();
    assert!(errors.len() == 1 && first.contains("is being written by another import"), "{errors:?}");
}

#[test]
fn an_existing_store_stays_until_the_import_that_replaces_it_is_complete() {
    let place = Place::new();
    let old = place.whole(&part(0..3), &None);
    let whole = place.whole(&part(0..8), &None);
    import(&part(0..3), &place.out, &IngestOptions::default()).unwrap();
    let error = import(&part(0..8), &place.out, &options(&None)).unwrap_err().to_string();
    assert!(error.contains("exists") && place.names() == ["s.zarr"], "{error}");
    let overwrite = IngestOptions { overwrite: true, ..options(&None) };
    interrupt(FailsAt(5), part(0..8), &place.out, &overwrite);
    assert_same(&place.out, &old);
    assert_eq!(place.names(), ["s.zarr", "s.zarr.partial"]);
    import(&part(0..8), &place.out, &overwrite).unwrap();
    assert_same(&place.out, &whole);
    assert_eq!(place.names(), ["s.zarr"]);
    // Steps can be added to it as to any other.
    super::append::add(&part(0..9), &place.out, &Default::default()).unwrap();
    assert_eq!(Store::open(&place.out).unwrap().times().len(), 9);
}

#[test]
fn what_is_not_resumed_leaves_an_unfinished_import_alone() {
    let place = Place::new();
    interrupt(FailsAt(3), part(0..4), &place.out, &options(&None));
    let kept = contents(&place.partial);
    interrupt(FailsAt(2), part(0..4), &place.out, &IngestOptions::default());
    import(&part(0..4), &place.out, &IngestOptions::default()).unwrap();
    assert!(contents(&place.partial) == kept);
    assert_eq!(place.names(), ["s.zarr", "s.zarr.partial"]);
}
