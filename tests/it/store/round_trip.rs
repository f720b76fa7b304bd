//! Values, times, mesh and statistics come back as they went in.

use super::{Formulas, contents, field, import, sample};
use std::collections::BTreeMap;
use tetreel::field::{Association, FieldSelector, TimeAxis};
use tetreel::ingest::{IngestError, IngestOptions};
use tetreel::moments::CovDenominator;
use tetreel::store::{FieldReader, Store};

fn selector(text: &str) -> FieldSelector {
    text.parse().unwrap()
}

fn decode(reader: &FieldReader, step: usize) -> Vec<f32> {
    let mut out = vec![0.0; reader.value_count()];
    let stats = reader.decode_step(step, &mut out).unwrap();
    assert_eq!(stats.vertices_decoded, out.len() as u64);
    assert!(stats.bytes_read >= 4 * stats.vertices_decoded);
    out
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Imports into a folder that lives as long as the first result.
fn store_of(source: &Formulas, options: &IngestOptions) -> (tempfile::TempDir, Store) {
    let dir = tempfile::tempdir().unwrap();
    import(source, &dir.path().join("s.zarr"), options).unwrap();
    let store = Store::open(dir.path().join("s.zarr")).unwrap();
    (dir, store)
}

#[test]
fn point_values_come_back_bit_for_bit_in_the_order_of_the_mesh() {
    let mut source = sample(4);
    let odd = [0x7fc0_1234, 0xff80_0000, 0x7f80_0000, 0x0000_0001, 0x8000_0000, 0x807f_ffff, 0x7f7f_ffff];
    source.value = Box::new(move |_, c, step, i| f32::from_bits(odd[(i + c + step) % odd.len()]));
    let (_dir, store) = store_of(&source, &IngestOptions::default());
    let mesh = store.mesh().unwrap();
    for (name, component) in [("T", 0), ("velocity:2", 2)] {
        let reader = store.field(&selector(name)).unwrap();
        for step in [3, 0, 2] {
            let expected: Vec<f32> =
                mesh.vertex_source.iter().map(|&s| (source.value)("", component, step, s as usize)).collect();
            assert_eq!(bits(&decode(&reader, step)), bits(&expected), "{name}, step {step}");
        }
    }
}

#[test]
fn the_mesh_comes_back_as_it_was_built() {
    let source = sample(1);
    let (_dir, store) = store_of(&source, &IngestOptions::default());
    let (built, report) = tetreel::mesh::Mesh::build(source.mesh.clone()).unwrap();
    assert!(report.zero_volume == 1 && report.duplicate_cells == 1 && report.unreferenced_vertices == 1);
    let read = store.mesh().unwrap();
    read.check().unwrap();
    assert_eq!(read.topology, built.topology);
    assert_eq!(read.positions, built.positions);
    assert_eq!((read.vertex_source, read.cell_source), (built.vertex_source, built.cell_source));
    assert!(read.cell_turned == built.cell_turned && built.cell_turned.contains(&true));
}

#[test]
fn points_that_the_mesh_does_not_give_back_are_kept_as_the_source_has_them() {
    for kind in ["", "float32", "float64"] {
        let mut source = sample(1);
        for point in &mut source.mesh.points {
            *point = match kind {
                // Cubes: small ones have finer bits than the shift to the middle of the box leaves.
                "float32" => ((*point - 1e6 * glam::DVec3::X) / 7.0).powf(3.0).as_vec3().as_dvec3(),
                "float64" => *point / 3.0,
                _ => *point,
            };
        }
        let (dir, store) = store_of(&source, &IngestOptions::default());
        let (mesh, points) = (store.mesh().unwrap(), store.source_points().unwrap());
        let folder = dir.path().join("s.zarr/mesh/0/source_points");
        let expected: Vec<_> = mesh.vertex_source.iter().map(|&s| source.mesh.points[s as usize]).collect();
        let drawn: Vec<_> = (0..expected.len()).map(|v| mesh.positions.world(v)).collect();
        assert_eq!(drawn == expected, kind.is_empty(), "{kind}");
        let Some(points) = points else {
            assert!(kind.is_empty() && !folder.exists(), "{kind}");
            continue;
        };
        assert_eq!(points, expected, "{kind}");
        let metadata = std::fs::read_to_string(folder.join("zarr.json")).unwrap();
        assert!(metadata.contains(kind) && !kind.is_empty(), "{metadata}");

        let chunk = folder.join("c/0/0");
        let mut bytes = std::fs::read(&chunk).unwrap();
        bytes[5] ^= 1;
        std::fs::write(&chunk, bytes).unwrap();
        assert_eq!(store.source_points().unwrap_err().path, chunk, "{kind}");
        std::fs::write(folder.join("zarr.json"), metadata.replace(kind, "uint32")).unwrap();
        assert!(store.source_points().unwrap_err().path.starts_with(&folder), "{kind}");
    }
}

#[test]
fn times_come_back_in_all_their_bits() {
    let mut source = sample(1);
    let values = vec![-1.0e-300, f64::from_bits(1), 0.1 + 0.2, 1.0 / 3.0, 1e15 + 0.125, f64::MAX];
    source.times = TimeAxis { values: values.clone() };
    let (_dir, store) = store_of(&source, &IngestOptions::default());
    let all: Vec<u64> = store.times().values.iter().map(|t| t.to_bits()).collect();
    assert_eq!(all, values.iter().map(|t| t.to_bits()).collect::<Vec<_>>());

    let options = IngestOptions { steps: "1..5:2".parse().unwrap(), ..Default::default() };
    let (_dir, store) = store_of(&source, &options);
    assert_eq!(store.times().values, [values[1], values[3], values[5]]);
    let reader = store.field(&selector("T")).unwrap();
    assert_eq!(decode(&reader, 2)[0], (source.value)("T", 0, 5, store.mesh().unwrap().vertex_source[0] as usize));
}

/// Mean over the cells around each vertex of the source, weighted by their volumes, by search.
fn naive_average(source: &Formulas, store: &Store, name: &str, component: usize, step: usize) -> Vec<f32> {
    let mesh = store.mesh().unwrap();
    let mean = |&vertex: &u32| {
        let (mut weighted, mut weights) = (0.0, 0.0);
        for (cell, &of) in (0..).zip(&mesh.cell_source) {
            if source.mesh.cells.tets[of as usize].contains(&vertex) {
                let volume = mesh.cell_volume(cell);
                weighted += volume * f64::from((source.value)(name, component, step, of as usize));
                weights += volume;
            }
        }
        (weighted / weights) as f32
    };
    mesh.vertex_source.iter().map(mean).collect()
}

#[test]
fn values_of_cells_brought_to_vertices_are_the_mean_over_the_kept_cells_around() {
    let mut source = sample(2);
    let flat = source.mesh.cells.tets.len() - 2;
    // What is dropped must not count: the flat cell and the duplicate are NaN.
    source.value = Box::new(move |name, c, s, i| if i >= flat { f32::NAN } else { super::distinct(name, c, s, i) });
    let options = IngestOptions { cells_to_points: true, ..Default::default() };
    let (_dir, store) = store_of(&source, &options);
    for (name, field, component) in [("p", "p", 0), ("flux/area:1", "flux/area", 1)] {
        let values = decode(&store.field(&selector(name)).unwrap(), 1);
        // The same sum in f64 in the same order.
        assert_eq!(bits(&values), bits(&naive_average(&source, &store, field, component, 1)));
    }
}

#[test]
fn a_cell_that_is_not_finite_reaches_its_vertices_and_no_others() {
    let mut source = sample(1);
    source.value = Box::new(|_, _, _, i| if i == 20 { f32::NAN } else { 2.5 });
    let corners = source.mesh.cells.tets[20];
    let options = IngestOptions { fields: vec![selector("p")], cells_to_points: true, ..Default::default() };
    let (_dir, store) = store_of(&source, &options);
    let values = decode(&store.field(&selector("p")).unwrap(), 0);
    for (value, vertex) in values.iter().zip(store.mesh().unwrap().vertex_source) {
        assert_eq!(value.is_nan(), corners.contains(&vertex));
        assert!(value.is_nan() || *value == 2.5);
    }
    assert_eq!(store.fields()[0].nonfinite, 4);
}

#[test]
fn a_vector_becomes_its_components_and_a_magnitude_that_is_not_stored() {
    let source = sample(2);
    let (dir, store) = store_of(&source, &IngestOptions::default());
    let names: Vec<&str> = store.fields().iter().map(|f| f.name.as_str()).collect();
    let flux = ["flux/area:0", "flux/area:1", "flux/area:2", "flux/area:mag"];
    assert_eq!(names, [&["T", "velocity:0", "velocity:1", "velocity:2", "velocity:mag", "p"][..], &flux].concat());

    let reader = store.field(&selector("velocity")).unwrap();
    assert_eq!(reader.info().name, "velocity:mag");
    assert_eq!(reader.info().magnitude_of, ["velocity:0", "velocity:1", "velocity:2"]);
    assert!(!dir.path().join("s.zarr/fields/velocity%3Amag/raw").exists());
    let components = [0, 1, 2].map(|i| decode(&store.field(&selector(&format!("velocity:{i}"))).unwrap(), 1));
    let values = decode(&reader, 1);
    for (v, value) in values.iter().enumerate() {
        let expected = components.iter().map(|c| f64::from(c[v]).powi(2)).sum::<f64>().sqrt();
        assert_eq!(*value, expected as f32);
    }
    // Its ranges and moments are there all the same.
    let range = reader.info().range_per_step[1].unwrap();
    assert_eq!(range[0], values.iter().copied().fold(f32::MAX, f32::min));
    assert_eq!(range[1], values.iter().copied().fold(f32::MIN, f32::max));
    assert_eq!(reader.statistics().unwrap().unwrap().mean.len(), values.len());
}

#[test]
fn a_magnitude_alone_is_stored_and_equals_the_one_computed_at_playback() {
    let source = sample(2);
    let (_dir, all) = store_of(&source, &IngestOptions::default());
    for name in ["velocity:mag", "flux/area:mag"] {
        let options = IngestOptions { fields: vec![selector(name)], ..Default::default() };
        let (_dir, one) = store_of(&source, &options);
        assert_eq!(one.fields().len(), 1);
        assert_eq!(one.fields()[0].codec, "raw");
        let [stored, computed] = [&one, &all].map(|s| decode(&s.field(&selector(name)).unwrap(), 1));
        assert_eq!(bits(&stored), bits(&computed));
    }
}

#[test]
fn selecting_what_is_not_there_lists_what_is() {
    let options = IngestOptions { fields: vec![selector("velocity:1"), selector("T")], ..Default::default() };
    let (_dir, store) = store_of(&sample(1), &options);
    assert!(store.field(&selector("T:0")).is_ok());
    for name in ["Q", "velocity", "velocity:0", "T:1", "t"] {
        let error = store.field(&selector(name)).unwrap_err().to_string();
        assert!(error.contains(&format!("'{name}'")) && error.contains("velocity:1, T"), "{error}");
    }
}

#[test]
fn ranges_and_moments_are_those_of_the_finite_values() {
    let mut source = sample(5);
    source.value = Box::new(|_, _, step, i| match (step, i % 5) {
        (2, _) => f32::NAN,
        (_, 4) => f32::INFINITY,
        _ => (step * step) as f32 + i as f32,
    });
    let (_dir, store) = store_of(&source, &IngestOptions { fields: vec![selector("T")], ..Default::default() });
    let reader = store.field(&selector("T")).unwrap();
    let info = reader.info();
    let vertices = reader.value_count();
    let steps: Vec<Vec<f32>> = (0..5).map(|step| decode(&reader, step)).collect();
    let nonfinite = steps.iter().flatten().filter(|v| !v.is_finite()).count();
    assert!(nonfinite > vertices);
    assert_eq!(info.nonfinite, nonfinite as u64);
    assert_eq!(info.range_per_step[2], None);
    for (step, range) in steps.iter().zip(&info.range_per_step).filter(|(_, range)| range.is_some()) {
        let finite = || step.iter().copied().filter(|v| v.is_finite());
        assert_eq!(*range, Some([finite().fold(f32::MAX, f32::min), finite().fold(f32::MIN, f32::max)]));
    }
    let statistics = reader.statistics().unwrap().unwrap();
    let mut noticed = 0;
    for v in 0..vertices {
        let finite: Vec<f64> = steps.iter().map(|s| f64::from(s[v])).filter(|x| x.is_finite()).collect();
        assert_eq!(statistics.finite_count[v], finite.len() as f64);
        let is_of = |finite: &[f64]| {
            let mean = finite.iter().sum::<f64>() / finite.len() as f64;
            let variance = finite.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / finite.len() as f64;
            // Five values below 100, each of which rounds the mean by an ulp of them (1.4e-14), and its product with deviations
            // below 16 twice.
            [(statistics.mean[v] - mean).abs() < 1e-13, (statistics.variance[v] - variance).abs() < 4e-12]
        };
        assert_eq!(statistics.mean[v].is_nan(), finite.is_empty());
        assert!(finite.is_empty() || is_of(&finite) == [true; 2], "vertex {v}");
        noticed += usize::from(finite.len() > 1 && is_of(&finite[1..]) == [false; 2]);
    }
    assert!(noticed > vertices / 2, "a step that is left out is noticed at {noticed} of {vertices} vertices");
    let importance = statistics.coefficient_of_variation(info.range, CovDenominator::default());
    assert!(importance.iter().all(|c| c.is_finite()) && importance.iter().any(|&c| c > 0.0));
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let run = |threads: usize| {
        let dir = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| import(&sample(3), &dir.path().join("s.zarr"), &IngestOptions::default()).unwrap());
        contents(&dir.path().join("s.zarr"))
    };
    let one = run(1);
    assert!(one.len() > 50);
    assert_eq!(one, run(4));
}

#[test]
fn one_step_is_a_series() {
    let (_dir, store) = store_of(&sample(1), &IngestOptions::default());
    assert_eq!(store.times().len(), 1);
    let statistics = store.field(&selector("T")).unwrap().statistics().unwrap().unwrap();
    assert!(statistics.variance.iter().all(|&v| v == 0.0));
    let error = store.field(&selector("T")).unwrap().decode_step(1, &mut vec![0.0; 64]).unwrap_err();
    assert!(error.to_string().contains("step 1"), "{error}");
}

#[test]
fn names_that_no_file_system_likes_are_kept() {
    let mut source = sample(1);
    let names = ["T", "t", "a/b\\c", "..", "CON", "naïve\nname", "zarr.json", "x:y", "", "%54"];
    source.fields = names.iter().map(|name| field(name, 1, Association::Point)).collect();
    let (_dir, store) = store_of(&source, &IngestOptions::default());
    let vertex = store.mesh().unwrap().vertex_source[5] as usize;
    for (name, stored) in names.iter().zip(store.fields()) {
        assert_eq!(stored.name, *name);
        let reader = store.field(&FieldSelector { name: (*name).to_owned(), component: None }).unwrap();
        assert_eq!(decode(&reader, 0)[5], super::distinct(name, 0, 0, vertex));
    }
}

#[test]
fn several_threads_decode_through_one_reader() {
    let (_dir, store) = store_of(&sample(6), &IngestOptions::default());
    let reader = store.field(&selector("velocity:mag")).unwrap();
    let alone: Vec<Vec<f32>> = (0..6).map(|step| decode(&reader, step)).collect();
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (reader, alone) = (&reader, &alone);
            scope.spawn(move || {
                for step in (0..30).map(|i| (i * (thread + 1) + thread) % 6) {
                    assert_eq!(decode(reader, step), alone[step]);
                }
            });
        }
    });
}

#[test]
fn info_says_what_is_there() {
    let (dir, store) = store_of(&sample(3), &IngestOptions::default());
    let info = store.info().unwrap();
    let bytes: usize = contents(&dir.path().join("s.zarr")).iter().map(|(_, bytes)| bytes.len()).sum();
    assert_eq!(info.bytes, bytes as u64);
    let json = serde_json::to_value(&info).unwrap();
    let keys: Vec<&String> = json.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["mesh", "time", "fields", "bytes", "version"]);
    assert_eq!(json["mesh"]["cells"], 162);
    assert_eq!(json["mesh"]["repair"]["zero_volume"], 1);
    assert_eq!(json["mesh"]["bounds"][1], serde_json::json!([1e6 + 3.0, 3.0, 1.5]));
    assert_eq!(json["time"], serde_json::json!({"steps": 3, "first": 0.0, "last": 0.2}));
    assert_eq!(json["version"]["notes"][0], "3 lines skipped");
    let by_name: BTreeMap<&str, &serde_json::Value> =
        json["fields"].as_array().unwrap().iter().map(|f| (f["name"].as_str().unwrap(), f)).collect();
    assert_eq!(by_name["p"]["association"], "cell");
    assert!(info.to_string().contains("162 cells, 64 vertices"), "{info}");
}

#[test]
fn a_source_without_steps_fields_or_components_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |change: &dyn Fn(&mut Formulas), expected: &str| {
        let mut source = sample(3);
        change(&mut source);
        let error = import(&source, &dir.path().join("s.zarr"), &IngestOptions::default()).unwrap_err();
        assert!(matches!(error, IngestError::File(_) | IngestError::Mesh { .. }));
        assert!(error.to_string().contains(expected), "{error}");
        assert!(super::list(dir.path()).is_empty());
    };
    refused(&|s| s.times.values.clear(), "no step");
    refused(&|s| s.times.values[1] = f64::NAN, "step 1 is not finite");
    refused(&|s| s.times.values[2] = s.times.values[1], "step 1 is at 0.1, step 2 at 0.1");
    refused(&|s| s.fields.clear(), "no field");
    refused(&|s| s.fields[1].components = 0, "'velocity' has no components");
    refused(&|s| s.mesh.cells.tets.clear(), "no cells");
    refused(&|s| s.mesh.cells.tets[3][1] = 4_000_000, "cell 3");
}
