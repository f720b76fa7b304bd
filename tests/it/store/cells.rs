//! Fields of cells: they stay with their cells, whole ones or several tetrahedra each.

use super::append::{add, part, vq};
use super::{Formulas, field, import, sample};
use std::fs;
use tetreel::camera::Camera;
use tetreel::export::StoredSeries;
use tetreel::field::{Association, Component, FieldSelector, SeriesSource};
use tetreel::ingest::{AppendOptions, IngestOptions};
use tetreel::mesh::SolidShape;
use tetreel::node_table::{Node, NodeTable};
use tetreel::pipeline::{Backend, FrameRequest, FrameTime, Pipeline, Series, TetDraw};
use tetreel::store::{FieldReader, Store};
use tetreel::task::Cancel;

fn selector(name: &str) -> FieldSelector {
    name.parse().unwrap()
}

fn decode(reader: &FieldReader, step: usize) -> Vec<u32> {
    let mut values = vec![0.0; reader.value_count()];
    reader.decode_step(step, &mut values).unwrap();
    values.into_iter().map(f32::to_bits).collect()
}

/// NaN, infinities, the greatest number, denormal ones and zeros of both signs.
fn odd(name: &str, component: usize, step: usize, i: usize) -> f32 {
    match i % 11 {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => f32::MAX,
        3 => f32::from_bits(1),
        4 => -0.0,
        _ => super::distinct(name, component, step, i),
    }
}

#[test]
fn values_of_cells_come_back_bit_for_bit_in_a_group_of_their_own() {
    let source = Formulas { value: Box::new(odd), ..sample(3) };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    import(&source, &path, &IngestOptions::default()).unwrap();
    let store = Store::open(&path).unwrap();
    let mesh = store.mesh().unwrap();
    for (name, field, component) in [("p", "p", 0), ("flux/area:2", "flux/area", 2)] {
        let reader = store.field(&selector(name)).unwrap();
        assert_eq!((reader.info().values_of, reader.value_count()), (Association::Cell, mesh.topology.tets.len()));
        for step in 0..3 {
            let expected = mesh.cell_source.iter().map(|&of| odd(field, component, step, of as usize).to_bits());
            assert_eq!(decode(&reader, step), expected.collect::<Vec<_>>(), "{name}");
        }
    }
    // A reader of version 1.0 finds the fields of vertices, and no others.
    let listed = |group: &str| fs::read_to_string(path.join(group).join("zarr.json")).unwrap();
    assert!(listed("fields").contains("\"T\"") && !listed("fields").contains("\"p\""), "{}", listed("fields"));
    assert!(listed("cell_fields").contains("\"p\"") && path.join("cell_fields/p/raw").is_dir());
    let only = IngestOptions { fields: vec![selector("T")], ..Default::default() };
    import(&source, &dir.path().join("t.zarr"), &only).unwrap();
    assert!(!dir.path().join("t.zarr/cell_fields").exists());

    // The way back has them per cell.
    let back = StoredSeries::new(&store, &[]).unwrap();
    let (cells, mut values) = (back.mesh().unwrap().cells.len(), Vec::new());
    let p = back.fields().iter().find(|field| field.name == "p").unwrap();
    assert_eq!(p.association, Association::Cell);
    back.read(p, Component::Index(0), 1, &mut values).unwrap();
    let mut kept = mesh.cell_source.clone();
    kept.sort_unstable();
    let expected = kept.iter().map(|&of| odd("p", 0, 1, of as usize).to_bits());
    assert_eq!((cells, values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()), (kept.len(), expected.collect()));
}

#[test]
fn a_split_cell_has_one_value_in_the_store_and_all_its_tetrahedra_have_it() {
    let mut source = sample(2);
    source.mesh.cells.tets.clear();
    let at = |x: u32, y: u32, z: u32| 1 + x + 4 * (y + 4 * z);
    for (x, y, z) in (0..27).map(|i| (i % 3, i / 3 % 3, i / 9)) {
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)];
        let layer = |dz: u32| corners.map(|(dx, dy)| at(x + dx, y + dy, z + dz));
        let corners = [layer(0), layer(1)].concat();
        source.mesh.cells.solids.push(SolidShape::Hexahedron, corners.into_iter());
    }
    let count = source.mesh.cells.len();
    let source = Hexahedra(source);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    tetreel::ingest::ingest(&source, &path, &IngestOptions::default(), &tetreel::task::Silent, &Cancel::new()).unwrap();
    let store = Store::open(&path).unwrap();
    let (mesh, reader) = (store.mesh().unwrap(), store.field(&selector("p")).unwrap());
    assert_eq!((mesh.topology.tets.len(), reader.value_count()), (6 * count, 6 * count));
    let expected = mesh.cell_source.iter().map(|&of| super::distinct("p", 0, 1, of as usize).to_bits());
    assert_eq!(decode(&reader, 1), expected.collect::<Vec<_>>());
    let shape = fs::read_to_string(path.join("cell_fields/p/raw/zarr.json")).unwrap();
    assert!(shape.replace(char::is_whitespace, "").contains(&format!("\"shape\":[2,{count}]")), "{shape}");
    assert_eq!(reader.statistics().unwrap().unwrap().mean.len(), 6 * count);
    let back = StoredSeries::new(&store, &[]).unwrap();
    let mut values = Vec::new();
    back.read(&back.fields()[2], Component::Index(0), 1, &mut values).unwrap();
    assert_eq!(values, (0..count).map(|i| super::distinct("p", 0, 1, i)).collect::<Vec<_>>());
}

/// A source whose cells are hexahedra.
struct Hexahedra(Formulas);

impl SeriesSource for Hexahedra {
    fn describe(&self) -> String {
        self.0.describe()
    }

    fn times(&self) -> &tetreel::field::TimeAxis {
        self.0.times()
    }

    fn fields(&self) -> &[tetreel::field::FieldInfo] {
        self.0.fields()
    }

    fn mesh(&self) -> tetreel::error::FileResult<tetreel::mesh::RawMesh> {
        self.0.mesh()
    }

    fn read(
        &self,
        field: &tetreel::field::FieldInfo,
        component: Component,
        step: usize,
        out: &mut Vec<f32>,
    ) -> tetreel::error::FileResult<()> {
        self.0.read(field, component, step, out)?;
        if field.association == Association::Cell {
            let Component::Index(component) = component else { panic!("ingest reads components") };
            out.clear();
            let count = self.0.mesh.cells.len();
            out.extend((0..count).map(|i| super::distinct(&field.name, component, step, i)));
        }
        Ok(())
    }
}

#[test]
fn steps_are_added_to_fields_of_cells_where_the_import_has_left_them() {
    for (codec, cells_to_points) in [(None, false), (None, true), (vq(64, false), false)] {
        let dir = tempfile::tempdir().unwrap();
        let [grown, whole] = ["grown.zarr", "whole.zarr"].map(|name| dir.path().join(name));
        let options = IngestOptions { codec: codec.clone().unwrap_or_default(), cells_to_points, ..Default::default() };
        import(&part(0..66), &grown, &options).unwrap();
        add(&part(0..70), &grown, &AppendOptions { cells_to_points, ..Default::default() }).unwrap();
        import(&part(0..70), &whole, &options).unwrap();
        let [grown, whole] = [grown, whole].map(|path| Store::open(path).unwrap());
        let [a, b] = [&grown, &whole].map(|store| store.field(&selector("p")).unwrap());
        let expected = if cells_to_points { Association::Point } else { Association::Cell };
        assert_eq!((a.info().values_of, b.info().values_of), (expected, expected));
        for step in [0, 63, 65, 66, 69] {
            assert_eq!(decode(&a, step), decode(&b, step), "{codec:?}, {cells_to_points}, {step}");
        }
        let error = add(&part(0..72), grown.path(), &AppendOptions { cells_to_points: true, ..Default::default() });
        assert_eq!(error.is_ok(), cells_to_points);
        let text = error.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(cells_to_points || text.contains("'p'") && text.contains("leave --cells-to-points out"), "{text}");
    }
}

#[test]
fn a_store_of_an_older_version_keeps_its_unweighted_means() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    let stretched = |steps| {
        let mut source = part(steps);
        // Cells of different volumes.
        source.mesh.points.iter_mut().for_each(|p| p.y = p.y.powi(3));
        source
    };
    import(&stretched(0..2), &path, &IngestOptions { cells_to_points: true, ..Default::default() }).unwrap();
    let file = path.join("fields/p/zarr.json");
    let text = fs::read_to_string(&file).unwrap();
    let older = text.replace("\"weights\": \"volume\",", "");
    assert_ne!(older, text);
    fs::write(&file, older).unwrap();
    add(&stretched(0..3), &path, &AppendOptions::default()).unwrap();
    let store = Store::open(&path).unwrap();
    let (mesh, reader) = (store.mesh().unwrap(), store.field(&selector("p")).unwrap());
    let mut values = vec![0.0; reader.value_count()];
    reader.decode_step(2, &mut values).unwrap();
    let source = stretched(0..3);
    for (vertex, &found) in mesh.vertex_source.iter().zip(&values) {
        let around = mesh.cell_source.iter().filter(|&&c| source.mesh.cells.tets[c as usize].contains(vertex));
        let around: Vec<f64> = around.map(|&c| f64::from((source.value)("p", 0, 2, c as usize))).collect();
        let mean = (around.iter().sum::<f64>() / around.len() as f64) as f32;
        assert!(found.to_bits() == mean.to_bits() || found.is_nan() && mean.is_nan(), "{found} {mean}");
    }
}

#[test]
fn quantities_of_a_field_of_cells_are_of_cells() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    let mut source = sample(5);
    source.fields = vec![field("p", 1, Association::Cell)];
    source.value = Box::new(|_, _, step, i| 1.0 + (0.3 * i as f32).sin() + 0.1 * (i % 7) as f32 * step as f32);
    import(&source, &path, &IngestOptions::default()).unwrap();
    let store = Store::open(&path).unwrap();
    let series = Series::open(&store, None).unwrap();
    let (cells, cancel) = (series.mesh().topology.tets.len(), Cancel::new());
    assert_eq!(series.values_of(), Association::Cell);
    let cov = series.coefficients_of_variation(&cancel).unwrap().unwrap();
    assert_eq!(cov.len(), cells);
    for (cell, &of) in series.mesh().cell_source.iter().enumerate() {
        let values: Vec<f64> = (0..5).map(|step| f64::from((source.value)("p", 0, step, of as usize))).collect();
        let mean = values.iter().sum::<f64>() / 5.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 5.0;
        // The usual denominator is the mean here, which is far from 0.
        assert!((f64::from(cov[cell]) - variance.sqrt() / mean).abs() < 1e-5, "{cell}");
    }
    let histograms = series.histograms(&cancel).unwrap().unwrap();
    let sums = histograms.iter().map(|of| of.counts().iter().sum::<u64>()).collect::<Vec<_>>();
    assert_eq!(sums, [5 * cells as u64, 5 * cells as u64, cells as u64, 5 * cells as u64]);
    assert!(!series.distribution(&cancel).unwrap().unwrap().is_empty());
}

/// A store with a field of vertices and two of cells: number of a block, which changes at step 2, and a quantity.
fn blocks(dir: &std::path::Path) -> Store {
    let path = dir.join("s.zarr");
    let mut source = sample(4);
    source.fields =
        vec![field("T", 1, Association::Point), field("block", 1, Association::Cell), field("q", 1, Association::Cell)];
    source.value = Box::new(|name, _, step, i| match name {
        "block" if step < 2 => (i % 3) as f32,
        "block" => (i % 2) as f32,
        _ => (i as f32 * 0.37).sin(),
    });
    import(&source, &path, &IngestOptions::default()).unwrap();
    Store::open(&path).unwrap()
}

#[test]
fn regions_are_the_cells_with_certain_values_at_the_last_step() {
    let dir = tempfile::tempdir().unwrap();
    let store = blocks(dir.path());
    let node = |scalar| Node { scalar, rgb: [0.9, 0.5, 0.1], tau: 2.0 };
    let table = std::sync::Arc::new(NodeTable::new(vec![node(-2.0), node(2.0)]).unwrap());
    for shown in ["T", "q"] {
        let mut pipeline = Pipeline::open(&store, Some(&selector(shown))).unwrap();
        let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
        let of = |time: FrameTime, regions: Option<&str>| {
            let request = FrameRequest::new(time, camera, table.clone(), (40, 30));
            FrameRequest { backend: Backend::Cpu, ..request }
                .with_tets(|tets| tets.regions = regions.map(|text| text.parse().unwrap()))
        };
        for (time, kept) in [
            (FrameTime::from(1), 3),
            (FrameTime::between(1, 2, 0.9), 3),
            (FrameTime::from(2), 2),
            (FrameTime::between(2, 3, 0.1), 2),
        ] {
            let request = of(time, Some("block=1"));
            let job = pipeline.prepare(&request).unwrap();
            let mesh = pipeline.mesh().clone();
            for (cell, &source) in (0..).zip(&mesh.cell_source) {
                assert_eq!(job.active.contains(cell), source % kept == 1, "{shown}, {time:?}, {cell}");
            }
            let all = pipeline.render(&of(time, None)).unwrap().planes.clone();
            let mut drawn = Vec::new();
            for draw in [TetDraw::Raycast, TetDraw::ALL_FACES, TetDraw::Reference] {
                drawn.push(pipeline.render(&request.clone().with_draw(draw)).unwrap().planes.clone());
            }
            let difference = |a: &tetreel::image::Planes, b: &tetreel::image::Planes| {
                let pairs = a.color.pixels.iter().flatten().zip(b.color.pixels.iter().flatten());
                pairs.map(|(a, b)| (a - b).abs()).fold(0f32, f32::max)
            };
            assert!(difference(&drawn[0], &drawn[2]) < 1e-5 && difference(&drawn[1], &drawn[2]) < 1e-5);
            assert!(difference(&drawn[0], &all) > 0.1, "something is left out");
        }
        // All regions are all cells, to the bit; and none of them is drawn of none.
        let all = pipeline.render(&of(1.into(), None)).unwrap().planes.clone();
        assert!(pipeline.render(&of(1.into(), Some("block=0..2"))).unwrap().planes == all);
        let none = pipeline.render(&of(1.into(), Some("block=7"))).unwrap();
        assert!(none.planes.color.pixels.iter().all(|p| *p == [0.0; 4]));
        for (regions, problem) in [("T=1", "has values of vertices"), ("nothing=1", "there is no field 'nothing'")] {
            let error = pipeline.render(&of(1.into(), Some(regions))).unwrap_err().to_string();
            assert!(error.contains(problem), "{error}");
        }
    }
}

#[test]
fn isosurfaces_of_a_field_of_cells_are_refused_with_the_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let mut pipeline = Pipeline::open(&blocks(dir.path()), Some(&selector("q"))).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let table = std::sync::Arc::new(NodeTable::transparent());
    let request = FrameRequest::new(0, camera, table, (8, 8))
        .with_tets(|tets| tets.surfaces = vec![tetreel::render::surfaces::Isosurface::new(0.1)]);
    let error = pipeline.render(&FrameRequest { backend: Backend::Cpu, ..request }).unwrap_err().to_string();
    assert!(error.contains("'q'") && error.contains("--cells-to-points"), "{error}");
}
