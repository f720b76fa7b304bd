//! Exporting what was imported.

use super::Place;
use std::path::Path;
use tetreel::field::{Component, SeriesSource};
use tetreel::import;

fn data(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name).display().to_string()
}

fn bits(source: &dyn SeriesSource, name: &str, step: usize) -> Vec<Vec<u32>> {
    let field = source.fields().iter().find(|f| f.name == name).unwrap_or_else(|| panic!("no field {name}"));
    let read = |i| {
        let mut out = Vec::new();
        source.read(field, Component::Index(i), step, &mut out).unwrap();
        out.into_iter().map(f32::to_bits).collect()
    };
    (0..field.components).map(read).collect()
}

#[test]
fn an_exported_series_has_the_times_and_the_values_of_its_source_in_its_order() {
    let place = Place::empty();
    let source = data("data/tornado/tornado.pvd");
    place.ok(&["import", &source, "-o", "t.zarr"]);
    place.ok(&["export", "t.zarr", "-o", "out.pvd"]);
    let (source, exported) = (import::open(Path::new(&source)).unwrap(), import::open(&place.path("out.pvd")).unwrap());
    assert_eq!(source.times(), exported.times());
    assert_eq!(source.fields().len(), exported.fields().len());
    for field in source.fields() {
        for step in 0..8 {
            assert_eq!(bits(&*source, &field.name, step), bits(&*exported, &field.name, step), "{} {step}", field.name);
        }
    }
    assert_eq!(source.mesh().unwrap(), exported.mesh().unwrap());
    place.ok(&[
        "export",
        "t.zarr",
        "-o",
        "part.pvd",
        "--steps",
        "1..7:3",
        "--field",
        "velocity:1",
        "--field",
        "velocity:mag",
    ]);
    let part = import::open(&place.path("part.pvd")).unwrap();
    let names: Vec<&str> = part.fields().iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["velocity:1", "velocity:mag"]);
    assert_eq!(part.times().values, [1, 4, 7].map(|i| source.times().values[i]));
    assert_eq!(bits(&*part, "velocity:1", 2)[0], bits(&*source, "velocity", 7)[1]);
}

#[test]
fn nothing_is_overwritten_and_a_failed_export_leaves_nothing() {
    let place = Place::empty();
    place.ok(&["import", &data("tests/data/xdmf/gzip_f32.xdmf"), "-o", "x.zarr"]);
    place.ok(&["export", "x.zarr", "-o", "x.pvd"]);
    let mesh = |path: &Path| import::open(path).unwrap().mesh().unwrap();
    assert_eq!(mesh(&place.path("x.pvd")), mesh(Path::new(&data("tests/data/xdmf/gzip_f32.xdmf"))));
    place.refuses(&["export", "x.zarr", "-o", "x.pvd"], &["x.pvd", "exists"]);
    std::fs::remove_file(place.path("x.pvd")).unwrap();
    place.refuses(&["export", "x.zarr", "-o", "x.pvd"], &["x", "not empty"]);
    place.refuses(&["export", "x.zarr", "-o", "y.vtu"], &["y.vtu", ".pvd"]);
    place.refuses(&["export", "x.zarr", "-o", "y.pvd", "--field", "Q"], &["Q", "T"]);
    place.refuses(&["export", "x.zarr", "-o", "y.pvd", "--steps", "5"], &["5"]);
    let chunk = place.path("x.zarr/fields/T/raw/c/2/0");
    std::fs::write(&chunk, [0]).unwrap();
    place.refuses(&["export", "x.zarr", "-o", "y.pvd"], &["x.zarr"]);
}

#[test]
fn damaged_xdmf_is_refused_by_import_without_output() {
    let place = Place::empty();
    for name in ["gzip_f32.xdmf", "gzip_f32.h5"] {
        std::fs::copy(data(&format!("tests/data/xdmf/{name}")), place.path(name)).unwrap();
    }
    let text = std::fs::read_to_string(place.path("gzip_f32.xdmf")).unwrap();
    std::fs::write(place.path("gzip_f32.xdmf"), text.replace("h5:/U/2", "h5:/U/7")).unwrap();
    place.refuses(&["import", "gzip_f32.xdmf", "-o", "x.zarr"], &["gzip_f32.h5", "/U/7"]);
    std::fs::remove_file(place.path("gzip_f32.h5")).unwrap();
    place.refuses(&["import", "gzip_f32.xdmf", "-o", "x.zarr"], &["gzip_f32.xdmf", "gzip_f32.h5 is missing"]);
}
