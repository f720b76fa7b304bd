//! Stores with codec `vq`: what is reported, what is played, what is refused.

use super::{Formulas, import, sample};
use std::path::Path;
use tetreel::codec::vq::{VqOptions, paper_bytes};
use tetreel::ingest::{CodecChoice, IngestOptions, IngestReport};
use tetreel::store::Store;

const STEPS: usize = 70;

fn options(entries: usize) -> IngestOptions {
    IngestOptions { codec: CodecChoice::new(VqOptions { entries, ..VqOptions::default() }), ..IngestOptions::default() }
}

/// The sample, moving, with a hole.
fn source() -> Formulas {
    Formulas {
        value: Box::new(|_, component, step, i| match (step, i) {
            (66, 20) => f32::NAN,
            _ => (i as f32 * 0.37).sin() + (component + 1) as f32 * (0.1 * step as f32 + 0.01 * i as f32).cos(),
        }),
        ..sample(STEPS)
    }
}

fn imported(dir: &Path, name: &str, options: &IngestOptions) -> (Store, IngestReport) {
    let report = import(&source(), &dir.join(name), options).unwrap();
    (Store::open(dir.join(name)).unwrap(), report)
}

fn steps(store: &Store, field: &str) -> Vec<Vec<f32>> {
    let reader = store.field(&field.parse().unwrap()).unwrap();
    let decode = |step| {
        let mut out = vec![0.0; reader.value_count()];
        reader.decode_step(step, &mut out).unwrap();
        out
    };
    (0..STEPS).map(decode).collect()
}

#[test]
fn a_vq_store_plays_every_field_within_the_error_that_it_states() {
    let dir = tempfile::tempdir().unwrap();
    let (raw, _) = imported(dir.path(), "raw.zarr", &IngestOptions::default());
    let (vq, _) = imported(dir.path(), "vq.zarr", &options(16));
    for field in vq.fields() {
        let [a, b] = [&raw, &vq].map(|store| steps(store, &field.name).concat());
        let mut worst = 0.0f64;
        for (x, y) in a.iter().zip(&b) {
            assert_eq!(x.is_finite(), y.is_finite());
            if x.is_finite() {
                worst = worst.max((f64::from(*x) - f64::from(*y)).abs());
            }
        }
        match &field.quality {
            Some(quality) => assert_eq!(worst, quality.max_error, "{}", field.name),
            None => assert!(!field.magnitude_of.is_empty() && worst < 1.0),
        }
        assert!(worst > 0.0, "{}: 16 entries for 64 vertices have an error", field.name);
    }
    let info = vq.info().unwrap();
    assert!(info.to_string().contains("T (vq), ") && info.to_string().contains(" dB, errors up to "), "{info}");
    let json = serde_json::to_value(&info).unwrap();
    assert_eq!(json["fields"][0]["codec_parameters"]["entries"], 16);
    assert!(json["fields"][0]["quality"]["over_sigma"]["p99"].as_f64().unwrap() > 0.0);
}

#[test]
fn an_import_reports_the_columns_of_the_papers_table() {
    let dir = tempfile::tempdir().unwrap();
    let (store, report) = imported(dir.path(), "vq.zarr", &options(16));
    let field = report.fields.iter().find(|f| f.name == "T").unwrap();
    let row = field.compression.as_ref().unwrap();
    assert_eq!([row.values, row.tets, row.steps, row.entries], [64, 162, 70, 16]);
    assert_eq!([row.raw_bytes, row.paper_bytes], [64 * 70 * 4, paper_bytes(64, 70, 16)]);
    let mut bytes = 0;
    for file in super::contents(&store.path().join("fields/T/vq")) {
        bytes += if file.0.ends_with("zarr.json") { 0 } else { file.1.len() as u64 };
    }
    assert_eq!(row.bytes, bytes);
    assert_eq!(row.ratio, row.raw_bytes as f64 / bytes as f64);
    let quality = store.fields().iter().find(|f| f.name == "T").unwrap().quality.unwrap();
    assert_eq!(row.quality, quality);
    let (snr, min, max) = (quality.snr_db.unwrap(), quality.snr_min_db.unwrap(), quality.snr_max_db.unwrap());
    assert!(min <= snr && snr <= max && quality.rmse <= quality.max_error);
    let text = report.to_string();
    for part in ["64 values a step, 162 tets, 70 steps", "by the paper's formula", "SNR ", "max error", "sigma: median"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["fields"][0]["compression"]["snr_db"].as_f64(), quality.snr_db);
}

#[test]
fn parameters_that_cannot_be_and_missing_arrays_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _) = imported(dir.path(), "vq.zarr", &options(16));
    let metadata = store.path().join("fields/T/zarr.json");
    let text = std::fs::read_to_string(&metadata).unwrap();
    for (from, to) in [
        ("\"entries\": 16", "\"entries\": 17"),
        ("\"entries\": 16", "\"entries\": 0"),
        ("\"specials\": 1", "\"specials\": 2"),
    ] {
        assert!(text.contains(from), "{text}");
        std::fs::write(&metadata, text.replace(from, to)).unwrap();
        assert!(Store::open(store.path()).is_err(), "{to}");
    }
    std::fs::write(&metadata, &text).unwrap();
    Store::open(store.path()).unwrap();
    std::fs::rename(store.path().join("fields/T/vq/cb8"), store.path().join("fields/T/vq/cb9")).unwrap();
    assert!(Store::open(store.path()).unwrap_err().path.ends_with("fields/T/vq/cb8/zarr.json"));
}

#[test]
fn the_bytes_of_a_vq_store_do_not_depend_on_the_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let with = |threads: usize| {
        let name = format!("{threads}.zarr");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| imported(dir.path(), &name, &options(16)));
        super::contents(&dir.path().join(name))
    };
    assert!(with(1) == with(3));
}
