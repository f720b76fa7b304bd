//! Histograms in a store: those of a direct count, whenever they are made.

use super::append::{add, import_all, part, reader, vq};
use super::{distinct, field, sample};
use std::fs;
use std::path::Path;
use tetreel::codec::vq::VqOptions;
use tetreel::field::Association;
use tetreel::histograms::{Histogram, Kind};
use tetreel::ingest::CodecChoice;
use tetreel::moments::{Bins, Histogram1d};
use tetreel::store::Store;
use tetreel::task::Cancel;

fn histograms(store: &Store, field: &str) -> Vec<Histogram> {
    reader(store, field).histograms(&store.mesh().unwrap(), &Cancel::new()).unwrap().unwrap()
}

fn stored(store: &Path, field: &str) -> Option<Vec<Histogram>> {
    reader(&Store::open(store).unwrap(), field).stored_histograms()
}

/// What the steps that the store gives back hold.
fn direct(store: &Store, field: &str) -> Histogram1d {
    let reader = reader(store, field);
    let mut histogram = Histogram1d::new(reader.info().range);
    let mut values = vec![0.0; reader.value_count()];
    for step in 0..reader.step_count() {
        reader.decode_step(step, &mut values).unwrap();
        histogram.add(&values);
    }
    histogram
}

/// A store whose histograms somebody has asked for.
fn counted(source: &super::Formulas, out: &Path, codec: Option<CodecChoice>) -> Store {
    let store = import_all(source, out, codec);
    count_all(&store);
    store
}

/// Asks for the histograms of all fields.
pub fn count_all(store: &Store) {
    store.fields().iter().for_each(|field| _ = histograms(store, &field.name));
}

#[test]
fn a_store_keeps_the_histograms_of_every_field_and_codec_for_which_somebody_has_asked() {
    for codec in [None, vq(16, false)] {
        let dir = tempfile::tempdir().unwrap();
        let store = import_all(&part(0..70), &dir.path().join("s.zarr"), codec.clone());
        assert!(store.fields().iter().all(|field| stored(store.path(), &field.name).is_none()), "nobody has asked");
        let store = counted(&part(0..70), &dir.path().join("t.zarr"), codec);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2, "nothing is left beside");
        let mesh = store.mesh().unwrap();
        for info in store.fields() {
            let kept = stored(store.path(), &info.name).unwrap();
            let counted = reader(&store, &info.name).count_histograms(&Kind::ALL, &mesh, &Cancel::new());
            assert_eq!(Some(&kept), counted.unwrap().as_ref(), "{}", info.name);
            assert_eq!(kept[0].one(), Some(&direct(&store, &info.name)), "{}", info.name);
            assert_eq!(kept[0].nonfinite(), info.nonfinite);
            let samples: Vec<u64> = kept.iter().map(|h| h.counts().iter().sum::<u64>() + h.nonfinite()).collect();
            let of_field = if info.values_of == Association::Cell { 162 } else { 64 };
            assert_eq!(samples, [70 * of_field, 70 * 162, of_field, 70 * of_field]);
        }
        assert_ne!(histograms(&store, "T"), histograms(&store, "p"), "the test can fail");
    }
}

#[test]
fn a_store_without_histograms_or_with_old_or_damaged_ones_has_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    let store = counted(&part(0..5), &path, None);
    let expected = stored(&path, "T").unwrap();
    let folder = path.join("fields/T/histograms");
    let metadata = folder.join("scalar_gradient/zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    for (before, after) in [
        ("\"derived_version\": 1", "\"derived_version\": 0"),
        ("\"derived_version\": 1", "\"derived_version\": \"1\""),
        ("\"steps\": 5", "\"steps\": 4"),
        ("\"of\": ", "\"of\": 1"),
        ("\"nonfinite\"", "\"other\""),
        ("\"y_range\": [", "\"y_range\": [7e99,"),
        ("\"x_range\": [", "\"x_range\": [1e9,"),
        ("\"x_range\"", "\"z_range\""),
        ("64,", "63,"),
    ] {
        let other = text.replace(before, after);
        assert_ne!(text, other, "{before}");
        fs::write(&metadata, other).unwrap();
        assert!(stored(&path, "T").is_none(), "{after}");
        assert_eq!(histograms(&store, "T"), expected);
        assert_eq!(stored(&path, "T").as_ref(), Some(&expected), "they take the place of what was there");
        assert_eq!(fs::read_to_string(&metadata).unwrap(), text);
    }
    // Older versions wrote none.
    let (before, after) = text.split_once("\"of\": ").unwrap();
    fs::write(&metadata, format!("{before}{}", after.split_once("\n").unwrap().1.trim_start())).unwrap();
    assert_eq!(stored(&path, "T").as_ref(), Some(&expected));
    let chunk = folder.join("cov/c/0");
    let mut bytes = fs::read(&chunk).unwrap();
    bytes[0] ^= 1;
    fs::write(&chunk, bytes).unwrap();
    assert!(stored(&path, "T").is_none());
    assert_eq!(histograms(&store, "T"), expected);
    // As an older version wrote it; then without statistics as well.
    for missing in ["fields/T/histograms", "lod/T", "fields/T/moments"] {
        fs::remove_dir_all(path.join(missing)).unwrap();
        assert_eq!(histograms(&Store::open(&path).unwrap(), "T"), expected, "{missing}");
    }
}

/// Stores of the first version have the histogram of coefficients of variation up to the bin of the greatest.
#[test]
fn the_first_version_of_coefficients_of_variation_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    let store = counted(&part(0..5), &path, None);
    let expected = stored(&path, "T").unwrap();
    let metadata = path.join("fields/T/histograms/cov/zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    assert_eq!(text.matches("\"derived_version\": 2").count(), 1, "{text}");
    fs::write(&metadata, text.replace("\"derived_version\": 2", "\"derived_version\": 1")).unwrap();
    let first = stored(&path, "T").unwrap();
    // What is written now, taken for the first version: every bin further down, or the same where the greatest is in the last.
    let counts = expected[2].counts();
    let last = counts.iter().rposition(|count| *count > 0).unwrap();
    let down = counts.len() - 1 - last;
    assert!(down < 4, "{down}");
    assert_eq!(first[2].counts()[1..counts.len() - down], counts[1 + down..]);
    assert_eq!((&first[3], first[2].ranges()), (&expected[3], expected[2].ranges()));
    fs::write(&metadata, text.replace("\"derived_version\": 2", "\"derived_version\": 3")).unwrap();
    assert!(stored(&path, "T").is_none());
    assert_eq!(histograms(&store, "T"), expected);
}

#[test]
fn a_store_that_grew_has_the_histograms_of_one_import() {
    for codec in [None, vq(16, false)] {
        let dir = tempfile::tempdir().unwrap();
        let [grown, whole] = ["grown.zarr", "whole.zarr"].map(|name| dir.path().join(name));
        counted(&part(0..3), &grown, codec.clone());
        let before = stored(&grown, "T").unwrap();
        for end in [5, 67, 70] {
            add(&part(0..end), &grown, &Default::default()).unwrap();
            assert!(stored(&grown, "T").is_none(), "none is better than an old one");
            histograms(&Store::open(&grown).unwrap(), "T");
            assert!(stored(&grown, "T").is_some(), "those of {end} steps");
        }
        let [grown, whole] = [Store::open(&grown).unwrap(), import_all(&part(0..70), &whole, codec)];
        for info in whole.fields() {
            let [a, b] = [&grown, &whole].map(|store| histograms(store, &info.name));
            assert_eq!(a[..2], b[..2], "{}", info.name);
            // Variances differ by their last bits, and with them coefficients: by an ulp of f32 at most, which moves the top of their
            // axis by as much, and of the samples those next to an edge: one vertex at most, out of one bin and into another.
            // Measured: none.
            let moved = |a: &Histogram, b: &Histogram| -> u64 {
                a.counts().iter().zip(b.counts()).map(|(a, b)| a.abs_diff(*b)).sum()
            };
            for (kind, steps) in [(2, 1), (3, 70)] {
                assert!(moved(&a[kind], &b[kind]) <= 2 * steps, "{}: {}", info.name, moved(&a[kind], &b[kind]));
                assert!(info.name != "T" || moved(&before[kind], &b[kind]) > 2 * steps, "three steps are noticed");
            }
        }
        assert_ne!(before, histograms(&grown, "T"));
    }
}

#[test]
fn a_raised_flag_ends_counting_and_keeps_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    let store = import_all(&part(0..2), &path, None);
    let cancel = Cancel::new();
    cancel.cancel();
    let reader = reader(&store, "T");
    let mesh = store.mesh().unwrap();
    assert!(reader.histograms(&mesh, &cancel).unwrap().is_none() && stored(&path, "T").is_none());
    assert!(reader.histograms(&mesh, &Cancel::new()).unwrap().is_some());
    assert!(reader.histograms(&mesh, &cancel).unwrap().is_some(), "they are there");
}

/// Of another series with as many steps, such as one that took the place of the store while its steps were counted.
#[test]
fn histograms_of_other_values_are_counted_again() {
    let dir = tempfile::tempdir().unwrap();
    let [one, other] = ["one.zarr", "other.zarr"].map(|name| dir.path().join(name));
    let mut source = part(0..5);
    source.value = Box::new(|name, component, step, i| distinct(name, component, step + 3, i));
    counted(&source, &one, None);
    let taken = |source: &super::Formulas, codec| {
        let _ = fs::remove_dir_all(&other);
        import_all(source, &other, codec);
        copy(&one.join("fields/T/histograms"), &other.join("fields/T/histograms"));
        stored(&other, "T").is_some()
    };
    assert!(taken(&source, None), "they are those of a second import");
    assert!(!taken(&part(0..5), None) && !taken(&source, vq(16, false)));
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let to = to.join(entry.file_name());
        if entry.path().is_dir() { copy(&entry.path(), &to) } else { _ = fs::copy(entry.path(), to).unwrap() }
    }
}

#[test]
fn what_vq_gives_back_beyond_the_range_of_the_source_is_in_the_bins_at_its_ends() {
    let dir = tempfile::tempdir().unwrap();
    let mut source = sample(64);
    source.fields = vec![field("T", 1, Association::Point)];
    source.value = Box::new(|name, component, step, i| distinct(name, component, step % 7, i));
    let codec = CodecChoice::new(VqOptions { entries: 2, ..VqOptions::default() });
    let store = import_all(&source, &dir.path().join("s.zarr"), Some(codec));
    let found = histograms(&store, "T");
    let counted = found[0].one().unwrap();
    assert_eq!((counted, counted.finite()), (&direct(&store, "T"), 64 * 64));
    let bins: &Bins = counted.bins();
    assert_eq!(bins.range(), store.fields()[0].range);
}
