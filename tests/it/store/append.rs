//! Steps added to a store: the same as an import of all steps at once, and the old store or the new one at any moment.

use super::{Formulas, contents, field, import, list, sample};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::time::SystemTime;
use tetreel::codec::vq::{Search, VqOptions};
use tetreel::field::{Association, FieldSelector};
use tetreel::ingest::{
    AppendOptions, AppendReport, CodecChoice, IngestError, IngestOptions, append, ingest, plan_append,
};
use tetreel::store::{FieldReader, Store};
use tetreel::task::{Cancel, Silent};

const ALL: usize = 400;

/// Steps of one endless series, with their times: vectors, cell data, holes, a vertex that stands still, an infinity.
pub fn part(steps: Range<usize>) -> Formulas {
    let first = steps.start;
    let mut whole = sample(ALL);
    whole.fields.truncate(3);
    Formulas {
        times: tetreel::field::TimeAxis { values: whole.times.values[steps].to_vec() },
        value: Box::new(move |name, component, step, i| value(name, component, first + step, i)),
        ..whole
    }
}

pub fn value(name: &str, component: usize, step: usize, i: usize) -> f32 {
    match (name, step, i) {
        (_, 66..70, 20) | ("T", _, 33) => f32::NAN,
        ("p", 2, 7) => f32::NEG_INFINITY,
        ("velocity", _, 12) => -0.0,
        _ => (i as f32 * 0.37).sin() + (component + 1) as f32 * (0.1 * step as f32 + 0.01 * i as f32).cos(),
    }
}

pub fn vq(entries: usize, own_scales: bool) -> Option<CodecChoice> {
    Some(CodecChoice::new(VqOptions { entries, search: Search::Fast, own_scales }))
}

pub fn import_all(source: &Formulas, out: &Path, codec: Option<CodecChoice>) -> Store {
    import(source, out, &IngestOptions { codec: codec.unwrap_or_default(), ..Default::default() }).unwrap();
    Store::open(out).unwrap()
}

pub fn add(source: &Formulas, out: &Path, options: &AppendOptions) -> Result<AppendReport, IngestError> {
    let cancel = source.cancel_at.as_ref().map_or_else(Cancel::new, |(_, cancel)| cancel.clone());
    append(source, out, options, &Silent, &cancel)
}

/// A store that grew from step to step, from a source that lists all its steps again each time.
fn grown(ends: &[usize], out: &Path, codec: Option<CodecChoice>) -> Store {
    import_all(&part(0..ends[0]), out, codec.clone());
    for pair in ends.windows(2) {
        let report =
            add(&part(0..pair[1]), out, &AppendOptions { codec: codec.clone(), ..Default::default() }).unwrap();
        assert_eq!((report.plan.steps_before, report.plan.steps_added), (pair[0], pair[1] - pair[0]));
    }
    Store::open(out).unwrap()
}

/// Content of all files but those that may differ: the moments and what is made of them, and the attributes with the counter and
/// the quality. Histograms are gone where steps were added, to be counted again.
fn comparable(store: &Path) -> BTreeMap<String, Vec<u8>> {
    let differs = |name: &str| {
        let parts = ["/moments/c/", "/global/c/", "/histograms/"];
        name == "zarr.json" || parts.iter().any(|part| name.contains(part))
    };
    contents(store).into_iter().filter(|(name, _)| !differs(name)).collect()
}

/// That a store which grew is the one of one import; `interruptions` appends, the first behind so many steps.
fn assert_same(grown: &Store, whole: &Store, interruptions: usize, first: usize) {
    let (mut a, mut b) = (comparable(grown.path()), comparable(whole.path()));
    let quality = |files: &mut BTreeMap<String, Vec<u8>>| {
        files
            .retain(|name, _| !(name.contains("fields/") && name.matches('/').count() == 2 && name.ends_with(".json")));
    };
    quality(&mut a);
    quality(&mut b);
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(*bytes == b[name], "{name} differs");
    }
    let steps = whole.times().len();
    let unit = 0.5 * f64::EPSILON;
    // Derived at `Moments::resume`.
    let bound = 2.0 * unit * (interruptions + (steps - first) + 1) as f64;
    assert_eq!(grown.fields().len(), whole.fields().len());
    for (a, b) in grown.fields().iter().zip(whole.fields()) {
        let mut like = b.clone();
        like.quality = a.quality;
        assert_eq!(*a, like, "all but the quality");
        if let (Some(a), Some(b)) = (a.quality, b.quality) {
            assert_eq!((a.max_error, a.rmse), (b.max_error, b.rmse));
            // A share of the variance becomes decibels, or half of it a share of a deviation.
            let near = |a: f64, b: f64, tolerance: f64| {
                assert!((a - b).abs() <= tolerance && (a * (1.0 + 1e-9) - b).abs() > tolerance, "{a} {b}");
            };
            // 10 / ln 10 of a share, and two roundings of up to 750 dB. Measured: none.
            let db = |x: Option<f64>| x.unwrap_or(1.0);
            near(db(a.snr_db), db(b.snr_db), 5.0 * bound + 1e3 * f64::EPSILON);
            near(a.over_sigma.max, b.over_sigma.max, b.over_sigma.max * (bound + 4.0 * f64::EPSILON));
        }
        let name = b.name.clone();
        let [a, b] = [grown, whole].map(|store| reader(store, &name).statistics().unwrap().unwrap());
        let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!((bits(&a.mean), &a.finite_count), (bits(&b.mean), &b.finite_count));
        for (a, b) in a.variance.iter().zip(&b.variance) {
            assert!(a.is_nan() && b.is_nan() || (a - b).abs() <= bound * b, "{a:e} instead of {b:e}");
        }
        let is_noticed = |by: f64, a: f64, b: f64, bound: f64| (a * (1.0 + by) - b).abs() > bound * b;
        assert!(a.variance.iter().zip(&b.variance).any(|(&a, &b)| is_noticed(1e-12, a, b, bound)), "{name}");
        let [a, b] = [grown, whole].map(|store| reader(store, &name).variation().unwrap());
        // The root of a share is half of it; each is rounded to f32.
        let bound = 0.5 * bound + f64::from(f32::EPSILON);
        let mut noticed = 0;
        for (a, b) in a.iter().zip(&b).map(|(&a, &b)| (f64::from(a), f64::from(b))) {
            assert!((a - b).abs() <= bound * b, "{a:e} instead of {b:e}");
            noticed += usize::from(is_noticed(1e-6, a, b, bound));
        }
        assert!(noticed > 0, "{name}");
    }
}

pub fn reader(store: &Store, name: &str) -> FieldReader {
    store.field(&FieldSelector { name: name.to_owned(), component: None }).unwrap()
}

pub fn decode(reader: &FieldReader, step: usize) -> Vec<u32> {
    let mut out = vec![0.0; reader.value_count()];
    reader.decode_step(step, &mut out).unwrap();
    out.iter().map(|x| x.to_bits()).collect()
}

fn modified(folder: &Path) -> Vec<(String, SystemTime)> {
    let time = |name: String| (name.clone(), folder.join(&name).metadata().unwrap().modified().unwrap());
    contents(folder).into_iter().map(|(name, _)| time(name)).collect()
}

#[test]
fn a_raw_store_that_grew_is_the_one_of_one_import() {
    let dir = tempfile::tempdir().unwrap();
    let whole = import_all(&part(0..9), &dir.path().join("whole.zarr"), None);
    for ends in [&[5, 9][..], &[1, 2, 9], &[8, 9]] {
        let out = dir.path().join(format!("{}.zarr", ends[0]));
        assert_same(&grown(ends, &out, None), &whole, ends.len() - 1, ends[0]);
    }
    // The comparison notices a value.
    let other = dir.path().join("5.zarr/fields/T/raw/c/8/0");
    let mut bytes = std::fs::read(&other).unwrap();
    bytes[0] ^= 1;
    std::fs::write(&other, bytes).unwrap();
    assert_ne!(comparable(&dir.path().join("5.zarr")), comparable(whole.path()));
}

// Long: codebooks are trained again for every part.
#[test]
fn a_vq_store_that_grew_is_the_one_of_one_import() {
    for (ends, relative) in
        [(&[70, 100][..], true), (&[64, 65], false), (&[1, 2, 3], false), (&[128, 192], true), (&[30, 64, 130], false)]
    {
        let dir = tempfile::tempdir().unwrap();
        let codec = vq(16, relative);
        let whole = import_all(&part(0..ends[ends.len() - 1]), &dir.path().join("whole.zarr"), codec.clone());
        let grown = grown(ends, &dir.path().join("grown.zarr"), codec);
        assert_same(&grown, &whole, ends.len() - 1, ends[0]);
    }
}

#[test]
fn exponents_and_special_values_that_come_late_or_fill_chunks_go_on_as_in_one_import() {
    // Runs of one step at every second: 32 for each of 64 vertices and block, more than a chunk of them in ten blocks.
    let blinking = |steps: usize| {
        let mut source = part(0..1);
        source.times.values = (0..steps).map(|i| i as f64).collect();
        source.fields = vec![field("T", 1, Association::Point)];
        source.value = Box::new(|_, _, step, i| if step % 2 == 0 { f32::NAN } else { (i * step) as f32 });
        source
    };
    let late = |steps: usize| {
        let mut source = blinking(steps);
        source.value = Box::new(|_, _, step, i| match (step, i) {
            (150, 3) => f32::NAN,
            (140.., 5) => 3e38 * if step % 2 == 0 { 1.0 } else { -1.0 },
            _ => (i as f32 * 0.1 * step as f32).sin(),
        });
        source
    };
    type Source<'a> = (&'a dyn Fn(usize) -> Formulas, &'a [usize]);
    let sources: [Source; 2] = [(&blinking, &[600, 660, 661]), (&late, &[70, 135, 190, 200])];
    for (source, ends) in sources {
        let dir = tempfile::tempdir().unwrap();
        let (out, codec) = (dir.path().join("s.zarr"), vq(4, false));
        let whole = import_all(&source(ends[ends.len() - 1]), &dir.path().join("whole.zarr"), codec.clone());
        import_all(&source(ends[0]), &out, codec);
        for &end in &ends[1..] {
            add(&source(end), &out, &AppendOptions::default()).unwrap();
        }
        assert_same(&Store::open(&out).unwrap(), &whole, ends.len() - 1, ends[0]);
        let optional = |name: &str| whole.path().join("fields/T/vq").join(name).exists();
        assert!(optional("special/c/1/0") || optional("exponent"), "the case is there");
    }
}

#[test]
fn complete_blocks_and_the_mesh_are_the_same_files() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import_all(&part(0..70), &out, vq(16, false));
    let before: BTreeMap<_, _> = modified(&out).into_iter().collect();
    add(&part(0..75), &out, &AppendOptions::default()).unwrap();
    let after: BTreeMap<_, _> = modified(&out).into_iter().collect();
    let same = |name: &str| before[name] == after[name];
    assert!(same("fields/T/vq/mean/c/0/0") && same("fields/T/vq/cb64/c/0/0/0") && same("mesh/0/points/c/0/0"));
    assert!(!same("fields/T/vq/mean/c/1/0") && !same("fields/T/vq/cb64/c/1/0/0") && !same("time/values/c/0"));
    assert_eq!(list(dir.path()), ["s.zarr"]);
}

#[test]
fn a_source_with_only_the_new_steps_will_do_unless_a_block_of_vq_is_short() {
    let dir = tempfile::tempdir().unwrap();
    for (codec, end) in [(None, 5), (vq(16, false), 64)] {
        let out = dir.path().join(format!("{end}.zarr"));
        import_all(&part(0..end), &out, codec.clone());
        let report = add(&part(end..end + 3), &out, &AppendOptions::default()).unwrap();
        assert_eq!((report.plan.steps_added, report.plan.steps_coded_again), (3, 0));
        let whole = import_all(&part(0..end + 3), &dir.path().join("whole.zarr"), codec);
        assert_same(&Store::open(&out).unwrap(), &whole, 1, end);
        std::fs::remove_dir_all(whole.path()).unwrap();
    }
    let out = dir.path().join("64.zarr");
    let before = contents(&out);
    // Steps 64 and 65 are there, 66 is not.
    let mut source = part(64..70);
    source.times.values.remove(2);
    let error = add(&source, &out, &AppendOptions::default()).unwrap_err().to_string();
    for text in ["lacks steps", &format!("at {}:", 0.1 * 66.0), "codec vq", "codec raw has no such need"] {
        assert!(error.contains(text), "{text}: {error}");
    }
    let error = add(&part(67..70), &out, &AppendOptions::default()).unwrap_err().to_string();
    assert!(error.contains("at 6.4, 6.5"), "{error}");
    // Other values under the same times are noticed by their range.
    let mut source = part(60..70);
    source.value = Box::new(|_, _, step, i| (step * i) as f32);
    let error = add(&source, &out, &AppendOptions::default()).unwrap_err().to_string();
    assert!(error.contains("step 64 of the store") && error.contains("other values"), "{error}");
    assert_eq!(contents(&out), before);
}

#[test]
fn nothing_new_leaves_the_store_untouched_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import_all(&part(0..5), &out, None);
    let before = (contents(&out), modified(dir.path()));
    for source in [part(0..5), part(2..4), part(0..1)] {
        let report = add(&source, &out, &AppendOptions::default()).unwrap();
        assert_eq!(report.plan.steps_added, 0);
        assert!(report.to_string().contains("nothing new"), "{report}");
        assert_eq!(plan_append(&source, &out, &AppendOptions::default()).unwrap().steps_added, 0);
    }
    let plan = plan_append(&part(0..8), &out, &AppendOptions::default()).unwrap();
    assert_eq!((plan.steps_before, plan.steps_added, plan.times_added), (5, 3, Some([0.5, 0.1 * 7.0])));
    assert_eq!((contents(&out), modified(dir.path())), before);
    // Only every second step of the source.
    let options = AppendOptions { steps: "..:2".parse().unwrap(), ..Default::default() };
    assert_eq!(add(&part(0..9), &out, &options).unwrap().plan.steps_added, 2);
    assert_eq!(Store::open(&out).unwrap().times().values[5..], [0.1 * 6.0, 0.1 * 8.0]);
}

/// Runs `fail` on a store and checks that it is as it was, modification times included.
fn leaves_the_store_as_it_was(fail: impl Fn(&Path) -> IngestError, parts: &[&str]) {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import_all(&part(0..66), &out, vq(16, false));
    let before = (contents(dir.path()), modified(dir.path()));
    let error = fail(&out).to_string();
    for part in parts {
        assert!(error.contains(part), "'{part}' is missing in: {error}");
    }
    assert!((contents(dir.path()), modified(dir.path())) == before, "{error}");
    assert_eq!(list(dir.path()), ["s.zarr"], "{error}");
}

fn fails(change: impl Fn(&mut Formulas), parts: &[&str]) {
    let fail = |out: &Path| {
        let mut source = part(0..70);
        change(&mut source);
        add(&source, out, &AppendOptions::default()).unwrap_err()
    };
    leaves_the_store_as_it_was(fail, parts);
}

#[test]
fn a_source_that_fails_or_is_cancelled_midway_leaves_the_old_store() {
    fails(|source| source.fail_at = Some(69), &["step 69", "fails on purpose"]);
    fails(|source| source.long_at = Some(67), &["step 67", "has 66 values"]);
    fails(|source| source.cancel_at = Some((68, Cancel::new())), &["cancelled"]);
}

#[test]
fn a_mesh_that_moved_or_was_refined_is_refused_by_name() {
    let remedy = "moved or was refined";
    fails(|source| source.mesh.points[9].x += 1e-9, &["point 9 is at", "instead of at", "s.zarr", remedy]);
    fails(|source| source.mesh.cells.tets.swap(3, 4), &["cell ", " joins points ", remedy]);
    fails(|source| _ = source.mesh.cells.tets.pop(), &["65 points and 163 cells instead of 65 and 164", remedy]);
    fails(|source| source.mesh.points.push(glam::DVec3::ZERO), &["66 points", remedy]);
    // The flat cell becomes one with a volume, of points that are there.
    fails(
        |source| {
            let flat = source.mesh.cells.tets.len() - 2;
            source.mesh.cells.tets[flat] = [1, 2, 5, 23];
        },
        &["other cells are flat", remedy],
    );
}

#[test]
fn points_that_a_store_keeps_apart_are_compared_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    let odd = |end: usize| {
        let mut source = part(0..end);
        source.mesh.points.iter_mut().for_each(|p| *p /= 3.0);
        source
    };
    let out = dir.path().join("s.zarr");
    let store = import_all(&odd(2), &out, None);
    assert!(store.source_points().unwrap().is_some());
    let mut moved = odd(3);
    moved.mesh.points[9].y = moved.mesh.points[9].y.next_up();
    let error = add(&moved, &out, &AppendOptions::default()).unwrap_err().to_string();
    assert!(error.contains("point 9"), "{error}");
    add(&odd(3), &out, &AppendOptions::default()).unwrap();
}

#[test]
fn what_the_store_does_not_have_is_refused() {
    fails(
        |source| source.fields.truncate(1),
        &["lacks what", "'velocity:0', 'velocity:1', 'velocity:2', 'velocity:mag', 'p'", "it has: T"],
    );
    fails(|source| source.fields[0].association = Association::Cell, &["are not those of", "per point or per cell"]);
    fails(|source| source.fields[1].components = 2, &["lacks what", "'velocity:2'"]);
    let with = |options: AppendOptions| move |out: &Path| add(&part(0..70), out, &options).unwrap_err();
    let new = AppendOptions { fields: vec!["T:mag".parse().unwrap()], ..Default::default() };
    leaves_the_store_as_it_was(with(new), &["there is no field 'T:mag'", "import the series again for others"]);
    let units = AppendOptions { units: vec!["T=K".parse().unwrap()], ..Default::default() };
    leaves_the_store_as_it_was(with(units), &["field 'T'", "no unit, not 'K'"]);
    let codec = AppendOptions { codec: vq(17, false), ..Default::default() };
    leaves_the_store_as_it_was(with(codec), &["vq with 17 entries, fast search", "a store keeps its codec"]);
    let early = AppendOptions { steps: "80..".parse().unwrap(), ..Default::default() };
    leaves_the_store_as_it_was(with(early), &["80..", "beyond the series"]);
}

#[test]
fn a_store_of_some_fields_goes_on_with_these_and_their_units() {
    let dir = tempfile::tempdir().unwrap();
    let [out, whole] = ["s.zarr", "whole.zarr"].map(|name| dir.path().join(name));
    let fields: Vec<FieldSelector> = ["p", "velocity:mag", "T"].map(|f| f.parse().unwrap()).to_vec();
    let units = vec!["velocity=m/s".parse().unwrap()];
    let options = IngestOptions { fields: fields.clone(), units: units.clone(), ..Default::default() };
    import(&part(0..3), &out, &options).unwrap();
    import(&part(0..6), &whole, &options).unwrap();
    add(&part(0..5), &out, &AppendOptions::default()).unwrap();
    add(&part(0..6), &out, &AppendOptions { fields, units, ..Default::default() }).unwrap();
    assert_same(&Store::open(&out).unwrap(), &Store::open(&whole).unwrap(), 2, 3);
}

#[test]
fn a_vq_store_of_an_older_version_is_refused_and_a_raw_one_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let old = |name: &str, end: usize, codec| {
        let out = dir.path().join(name);
        import_all(&part(0..end), &out, codec);
        for (file, bytes) in contents(&out) {
            let path = out.join(&file);
            if file.contains("/errors_per_") {
                std::fs::remove_file(path).unwrap();
            } else if file.ends_with("zarr.json") {
                let mut json: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
                for (group, name) in [("/attributes", "revision"), ("/attributes/codec_parameters", "relative")] {
                    json.pointer_mut(group).and_then(|g| g.as_object_mut()).map(|g| g.remove(name));
                }
                std::fs::write(path, serde_json::to_vec(&json).unwrap()).unwrap();
            }
        }
        out
    };
    let out = old("vq.zarr", 70, vq(16, false));
    let before = contents(&out);
    let error = add(&part(0..72), &out, &AppendOptions::default()).unwrap_err().to_string();
    assert!(error.contains("older version") && error.contains("import the series again"), "{error}");
    assert_eq!(contents(&out), before);
    let out = old("raw.zarr", 4, None);
    add(&part(0..6), &out, &AppendOptions::default()).unwrap();
    assert_eq!(Store::open(&out).unwrap().times().len(), 6);
}

#[cfg(unix)]
#[test]
fn a_store_behind_a_link_grows_where_it_is() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("big")).unwrap();
    import_all(&part(0..2), &dir.path().join("big/s.zarr"), None);
    let link = dir.path().join("s.zarr");
    std::os::unix::fs::symlink("big/s.zarr", &link).unwrap();
    add(&part(0..3), &link, &AppendOptions::default()).unwrap();
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(Store::open(dir.path().join("big/s.zarr")).unwrap().times().len(), 3);
    assert_eq!(list(&dir.path().join("big")), ["s.zarr"]);
}

#[cfg(unix)]
#[test]
fn a_folder_that_cannot_be_written_is_named_and_the_store_stays() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import_all(&part(0..2), &out, None);
    let allow = |mode: u32| std::fs::set_permissions(dir.path(), std::fs::Permissions::from_mode(mode)).unwrap();
    allow(0o555);
    let as_root = std::fs::write(dir.path().join("probe"), "").is_ok();
    let result = add(&part(0..3), &out, &AppendOptions::default());
    allow(0o755);
    if as_root {
        return; // whom no permission stops
    }
    let error = result.unwrap_err().to_string();
    assert!(error.contains("cannot write in"), "{error}");
    assert_eq!(Store::open(&out).unwrap().times().len(), 2);
}

#[test]
fn what_lies_in_a_store_besides_stays_and_damage_is_not_carried_on() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import_all(&part(0..70), &out, vq(16, false));
    std::fs::write(out.join("fields/T/notes.txt"), "mine").unwrap();
    add(&part(0..71), &out, &AppendOptions::default()).unwrap();
    assert_eq!(std::fs::read_to_string(out.join("fields/T/notes.txt")).unwrap(), "mine");
    for damaged in ["fields/T/moments/c/1/0", "fields/T/errors_per_vertex/c/0"] {
        let path = out.join(damaged);
        let whole = std::fs::read(&path).unwrap();
        let mut bytes = whole.clone();
        bytes[9] ^= 4;
        std::fs::write(&path, bytes).unwrap();
        let before = contents(&out);
        let error = add(&part(0..72), &out, &AppendOptions::default()).unwrap_err();
        assert!(error.to_string().contains(damaged), "{error}");
        assert_eq!(contents(&out), before);
        std::fs::write(&path, whole).unwrap();
    }
    add(&part(0..72), &out, &AppendOptions::default()).unwrap();
}

#[test]
fn the_store_itself_can_be_a_source_again() {
    let dir = tempfile::tempdir().unwrap();
    let store = grown(&[3, 5], &dir.path().join("s.zarr"), None);
    let series = tetreel::export::StoredSeries::new(&store, &[]).unwrap();
    let out = dir.path().join("again.zarr");
    ingest(&series, &out, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    assert_eq!(Store::open(&out).unwrap().times(), store.times());
}
