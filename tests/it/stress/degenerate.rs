//! Next to nothing: one vertex, no cell, one cell, one step, one pixel.

use super::*;
use crate::meshes::{build, grid, sample};
use crate::series::{assert_agrees_from_all_sides, ingested};
use glam::DVec3;
use tetreel::field::FieldSelector;
use tetreel::mesh::{MeshError, RawMesh};
use tetreel::moments::CovDenominator;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::visibility::CellSet;

#[test]
fn points_without_cells_and_cells_without_volume_are_refused_and_said_so() {
    let points = |n: usize| (0..n).map(|i| DVec3::new(i as f64, 0.0, 0.0)).collect::<Vec<_>>();
    for (name, raw, expected) in [
        ("nothing", RawMesh::default(), MeshError::NoCells),
        ("one vertex", RawMesh { points: points(1), cells: vec![].into() }, MeshError::NoCells),
        ("one vertex four times", RawMesh { points: points(1), cells: vec![[0; 4]].into() }, MeshError::AllFlat(1)),
        (
            "four points of a line",
            RawMesh { points: points(4), cells: vec![[0, 1, 2, 3]; 2].into() },
            MeshError::AllFlat(2),
        ),
    ] {
        let error = Mesh::build(raw).unwrap_err();
        assert_eq!(error, expected, "{name}");
        assert!(!error.to_string().is_empty());
    }
}

#[test]
fn no_active_cells_and_no_faces_make_a_clear_image_on_every_path() {
    let mesh = Arc::new(build(grid(2, 0.1, 1, |_| true)));
    let case = Case::new("no active cells", &mesh, sample(&mesh, wave), dense());
    for mut job in case.jobs() {
        job.active = Arc::new(CellSet::none(mesh.topology.tets.len()));
        for path in paths() {
            if let Some(frame) = (path.render)(&job) {
                assert!(frame.planes.color.pixels.iter().flatten().all(|&v| v == 0.0), "{}", path.name);
                assert!(frame.planes.depth.pixels.iter().all(|&d| d == f32::INFINITY), "{}", path.name);
            }
        }
    }
}

/// One cell, squashed by `squash` along z.
fn one_cell(squash: f64) -> Case {
    let points = [[-1.0, -1.0, -1.0], [1.0, -0.9, -0.8], [-0.8, 1.0, -0.9], [-0.9, -0.8, 1.0]];
    let points = points.map(|[x, y, z]| DVec3::new(x, y, squash * z)).to_vec();
    let mesh = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }));
    let scalars = (0..4).map(|v| wave(mesh.positions.world(v) / DVec3::new(1.0, 1.0, squash)) as f32).collect();
    let name = format!("one cell, squashed by {squash:.0e}");
    Case::new(name, &mesh, scalars, dense_per(squash))
}

#[test]
fn one_cell_agrees_from_all_sides_and_from_within() {
    let inside = Case {
        name: "one cell, from within".into(),
        cameras: [40.0, 110.0].map(|angle| cameras::within(DVec3::new(-0.5, -0.4, -0.6), angle, 0.0)).to_vec(),
        ..one_cell(1.0)
    };
    run([one_cell(1.0), one_cell(1e-3), inside]);
}

#[test]
fn two_cells_that_share_a_face_an_edge_or_a_vertex_agree() {
    let apex = [[-1.0, -1.0, -1.0], [1.0, -0.9, -0.8], [-0.8, 1.0, -0.9], [-0.9, -0.8, 1.0]].map(DVec3::from_array);
    let beyond = [DVec3::new(1.0, 0.9, 0.8), DVec3::new(0.2, 1.0, 0.7), DVec3::new(0.7, 0.1, 1.0)];
    for (name, other) in [("face", [1, 2, 3, 4]), ("edge", [1, 2, 4, 5]), ("vertex", [1, 4, 5, 6])] {
        let points = apex.into_iter().chain(beyond).collect();
        let mesh = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3], other].into() }));
        run([Case::new(format!("two cells with one {name}"), &mesh, sample(&mesh, wave), dense())]);
    }
}

#[test]
fn one_pixel_agrees() {
    let mesh = Arc::new(build(grid(4, 0.16, 1, |_| true)));
    let case = Case::new("one pixel", &mesh, sample(&mesh, wave), dense());
    run([Case { size: (1, 1), ..case.clone() }, Case { name: "one row".into(), size: (33, 1), ..case }]);
}

#[test]
fn a_series_of_one_step_is_stored_ranked_and_drawn() {
    let temp = tempfile::tempdir().unwrap();
    for name in [SeriesName::Dipole, SeriesName::Slab] {
        let series = generate(&SynthSpec { cells: 2000, steps: 1, ..SynthSpec::new(name) }).unwrap();
        let store = ingested(&series, &temp.path().join(format!("{name}.zarr")), "0");
        for field in store.fields() {
            let selector = FieldSelector { name: field.name.clone(), component: None };
            let statistics = store.field(&selector).unwrap().statistics().unwrap().unwrap();
            assert!(statistics.variance.iter().all(|&v| v == 0.0), "{name}: one value does not vary");
            for denominator in [CovDenominator::default(), CovDenominator::Plain] {
                let cov = statistics.coefficient_of_variation(field.range, denominator);
                assert!(cov.iter().all(|&c| c == 0.0), "{name}, {}: {denominator:?}", field.name);
            }
        }
        assert_agrees_from_all_sides(&store, &store.fields()[store.fields().len() - 1].name, &[0]);
    }
}
