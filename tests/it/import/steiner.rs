//! Cells that are cut from a vertex in their middle, from file to store and back.

use super::series::{Grid, write_series};
use glam::DVec3;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tetreel::export::StoredSeries;
use tetreel::field::{Component, FieldSelector, SeriesSource};
use tetreel::import;
use tetreel::ingest::{AppendOptions, IngestOptions, append, ingest, plan_append};
use tetreel::mesh::{Mesh, tet_volume};
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};

/// A cube with its second corner pushed in, and a cube beside it that shares the face which that warps. Points are no multiples of what f32
/// resolves in the frame, so that a store keeps them.
fn warped() -> Grid {
    let mut points: Vec<[f64; 3]> = [
        [0.0, 0.0, 0.0],
        [0.4375, 0.5, 0.5],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
    ]
    .to_vec();
    points.extend([[2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 0.0, 1.0], [2.0, 1.0, 1.0]]);
    points.iter_mut().flatten().for_each(|x| *x = *x / 3.0 + 7.0);
    let values = |count: usize, factor: f64| (0..count).map(|i| factor * i as f64).collect::<Vec<_>>();
    Grid {
        point_arrays: vec![("T", 1, values(12, 1.5)), ("U", 3, values(36, -0.25))],
        cell_arrays: vec![("c", 1, vec![10.0, 20.0])],
        points,
        cells: vec![(12, (0..8).collect()), (12, vec![1, 8, 9, 2, 5, 10, 11, 6])],
        ..Grid::default()
    }
}

/// Steps of it: the second has a NaN at a corner of the warped cell, the third an infinity at one of the other cell alone.
fn steps() -> Vec<Grid> {
    let mut steps = vec![warped(); 4];
    for (step, grid) in steps.iter_mut().enumerate() {
        grid.point_arrays[0].2.iter_mut().for_each(|value| *value += 0.1 * step as f64);
    }
    steps[1].point_arrays[0].2[3] = f64::NAN;
    steps[2].point_arrays[0].2[9] = f64::INFINITY;
    steps[3].point_arrays[0].2[4] = f64::NEG_INFINITY;
    steps
}

fn source(folder: &Path, steps: &[Grid]) -> Box<dyn SeriesSource> {
    import::open(&write_series(folder, steps)).expect("a series")
}

fn stored(folder: &Path, source: &dyn SeriesSource, options: &IngestOptions) -> Store {
    let path = folder.join("s.zarr");
    let report = ingest(source, &path, options, &Silent, &Cancel::new()).expect("an import");
    assert_eq!((report.repair.steiner_cells, report.repair.warped_cells, report.repair.vertices_in), (1, 0, 12));
    Store::open(path).expect("a store")
}

fn values(store: &Store, field: &str, step: usize) -> Vec<f32> {
    let Ok(selector) = field.parse::<FieldSelector>();
    let reader = store.field(&selector).expect("a field");
    let mut values = vec![0.0; reader.value_count()];
    reader.decode_step(step, &mut values).expect("a step");
    values
}

/// The vertex in the middle, and the corners of its cell.
fn middle(mesh: &Mesh) -> (usize, Vec<u32>) {
    let found: Vec<_> = mesh.split_cells.steiner_corners().collect();
    let [(vertex, corners)] = &found[..] else { panic!("one cell") };
    (*vertex as usize, corners.clone())
}

#[test]
fn a_vertex_in_the_middle_has_the_means_of_its_corners_at_each_step() {
    let folder = TempDir::new().expect("a folder");
    let source = source(folder.path(), &steps());
    let store = stored(folder.path(), source.as_ref(), &IngestOptions::default());
    let mesh = store.mesh().expect("a mesh");
    mesh.check().expect("a sound mesh");
    let (vertex, corners) = middle(&mesh);
    assert_eq!((corners.len(), mesh.vertex_source[vertex]), (8, 12));
    for field in ["T", "U:0", "U:1", "U:2"] {
        for step in 0..4 {
            let values = values(&store, field, step);
            let of_corners: Vec<f64> = corners.iter().map(|&corner| f64::from(values[corner as usize])).collect();
            let is_finite = of_corners.iter().all(|value| value.is_finite());
            let mean = if is_finite { (of_corners.iter().sum::<f64>() / 8.0) as f32 } else { f32::NAN };
            assert_eq!(values[vertex].is_nan(), !is_finite || mean.is_nan(), "{field} {step}");
            assert!(!is_finite || values[vertex] == mean, "{field} {step}: {} instead of {mean}", values[vertex]);
            assert_eq!(is_finite, field != "T" || [0, 2].contains(&step));
        }
    }
    // The magnitude is that of the mean.
    let [x, y, z] = ["U:0", "U:1", "U:2"].map(|name| f64::from(values(&store, name, 0)[vertex]));
    let magnitude = f64::from(values(&store, "U:mag", 0)[vertex]);
    assert!((magnitude / DVec3::new(x, y, z).length() - 1.0).abs() < 1e-6);
    // Seen from there, the cell is filled once.
    let volume: f64 = mesh.topology.tets.iter().map(|&tet| tet_volume(mesh.positions.corners(tet))).sum();
    let at = |point: u32| DVec3::from(warped().points[point as usize]);
    let tets = [[1, 2, 6, 0], [1, 6, 5, 0], [4, 5, 6, 0], [4, 6, 7, 0], [2, 3, 7, 0], [2, 7, 6, 0]];
    let signed = |[a, b, c, d]: [u32; 4]| (at(a) - at(d)).dot((at(b) - at(d)).cross(at(c) - at(d))) / 6.0;
    let cut: f64 = tets.map(signed).iter().sum::<f64>();
    let beside = [[8, 9, 11, 1], [8, 11, 10, 1], [5, 10, 11, 1], [5, 11, 6, 1], [2, 6, 11, 1], [2, 11, 9, 1]];
    let expected = cut + beside.map(signed).iter().sum::<f64>();
    let found = volume * mesh.positions.scale.powi(3);
    assert!((found / expected - 1.0).abs() < 1e-5, "{found} instead of {expected}");
}

#[test]
fn points_and_cells_of_the_source_come_back_bit_for_bit_without_the_vertex_in_the_middle() {
    let folder = TempDir::new().expect("a folder");
    let source = source(folder.path(), &steps());
    let store = stored(folder.path(), source.as_ref(), &IngestOptions::default());
    let points = store.source_points().expect("points").expect("no f32 has them");
    let mesh = store.mesh().expect("a mesh");
    assert_eq!((points.len(), points[middle(&mesh).0]), (13, mesh.positions.world(middle(&mesh).0)));
    let back = StoredSeries::new(&store, &[]).expect("a source");
    assert_eq!(back.mesh().expect("a mesh"), source.mesh().expect("a mesh"));
    for (field, of) in back.fields().iter().zip(source.fields()) {
        for (step, component) in (0..4).flat_map(|step| (0..of.components).map(move |i| (step, Component::Index(i)))) {
            let read = |source: &dyn SeriesSource, field| {
                let mut values = Vec::new();
                source.read(field, component, step, &mut values).expect("values");
                values.into_iter().map(f32::to_bits).collect::<Vec<_>>()
            };
            assert_eq!(read(&back, field), read(source.as_ref(), of), "{} at step {step}", of.name);
        }
    }
}

#[test]
fn a_vertex_in_the_middle_of_a_cell_has_its_value_where_values_of_cells_are_brought_to_points() {
    let folder = TempDir::new().expect("a folder");
    let source = source(folder.path(), &steps());
    let options = IngestOptions { cells_to_points: true, ..Default::default() };
    let store = stored(folder.path(), source.as_ref(), &options);
    let (vertex, _) = middle(&store.mesh().expect("a mesh"));
    assert_eq!(values(&store, "c", 0)[vertex], 10.0);
}

#[test]
fn steps_are_appended_and_other_meshes_refused() {
    let folder = TempDir::new().expect("a folder");
    let [first, whole, moved] = ["first", "whole", "moved"].map(|name| {
        let path = folder.path().join(name);
        fs::create_dir(&path).expect("a folder");
        path
    });
    let store = stored(&first, source(&first, &steps()[..2]).as_ref(), &IngestOptions::default());
    let all = source(&whole, &steps());
    let expected = stored(&whole, all.as_ref(), &IngestOptions::default());
    append(all.as_ref(), store.path(), &AppendOptions::default(), &Silent, &Cancel::new()).expect("an append");
    let grown = Store::open(store.path()).expect("a store");
    let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
    for (field, step) in ["T", "U:2", "c"].into_iter().flat_map(|field| (0..4).map(move |step| (field, step))) {
        assert_eq!(bits(values(&grown, field, step)), bits(values(&expected, field, step)), "{field} {step}");
    }
    let mut others = steps();
    others.iter_mut().for_each(|grid| grid.points[1] = [7.3, 7.0, 7.0]);
    let other = source(&moved, &others);
    let error = plan_append(other.as_ref(), store.path(), &AppendOptions::default()).expect_err("a mesh that moved");
    assert!(error.to_string().contains("point 1 is at"), "{error}");
}

#[test]
fn stores_of_meshes_without_such_cells_have_no_such_array_and_damaged_ones_are_named() {
    let folder = TempDir::new().expect("a folder");
    let source = source(folder.path(), &steps());
    let store = stored(folder.path(), source.as_ref(), &IngestOptions::default());
    let array = store.path().join("mesh/0/split_cells/steiner");
    let names: BTreeSet<_> =
        fs::read_dir(&array).expect("a folder").map(|e| e.expect("an entry").file_name()).collect();
    assert!(names.contains(std::ffi::OsStr::new("zarr.json")), "{names:?}");
    let chunk = array.join("c/0/0");
    let good = fs::read(&chunk).expect("a chunk");
    for word in [0, 4] {
        let mut bad = good[..good.len() - 4].to_vec();
        bad[word] = 250;
        bad.extend(crc32c::crc32c(&bad).to_le_bytes());
        fs::write(&chunk, bad).expect("is written");
        let error = store.mesh().expect_err("is damaged").to_string();
        assert!(error.contains("steiner") && error.contains("import the series again"), "{error}");
    }
    fs::write(&chunk, good).expect("is written");
    assert!(store.mesh().is_ok());

    let ordinary = TempDir::new().expect("a folder");
    let mut grids = steps();
    grids.iter_mut().for_each(|grid| grid.points[1] = [1.0 / 3.0 + 7.0, 7.0, 7.0]);
    let source = self::source(ordinary.path(), &grids);
    let path = ordinary.path().join("s.zarr");
    ingest(source.as_ref(), &path, &IngestOptions::default(), &Silent, &Cancel::new()).expect("an import");
    assert!(path.join("mesh/0/split_cells/types").exists() && !path.join("mesh/0/split_cells/steiner").exists());
}
