//! Exported surfaces: what is in the files, what is refused, and what VTK says.

use super::Place;
use std::path::Path;
use std::process::{Command, Output};
use tetreel::export::surface::{Shape, SurfaceError, SurfaceOptions, write_surfaces};
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};

/// The steps of the tornado, as a store: the vector `velocity`.
fn tornado() -> Place {
    let place = Place::empty();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/tornado/tornado.pvd");
    place.ok(&["import", source.to_str().unwrap(), "-o", "t.zarr"]);
    place
}

const SLICE: &str = "point=0,0,0 normal=1,2,-3";

fn export<'a>(rest: &[&'a str]) -> Vec<&'a str> {
    [&["export", "t.zarr"], rest].concat()
}

/// One tet far away, its field `a b` at three steps; the last has none.
fn corner() -> Place {
    let place = Place::empty();
    let mut list = String::new();
    for (step, values) in ["0 1 0 0", "0 0.2 0 0", "nan nan nan nan"].into_iter().enumerate() {
        let array = |name: &str, kind: &str, width: usize, text: &str| {
            format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{width}\" format=\"ascii\">{text}</DataArray>"
            )
        };
        let points = "1e9 0 0 1000000001 0 0 1e9 1 0 1e9 0 1";
        let text = format!(
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\
             <PointData>{}</PointData><Points>{}</Points><Cells>{}{}{}</Cells></Piece></UnstructuredGrid></VTKFile>",
            array("a b", "Float32", 1, values),
            array("Points", "Float64", 3, points),
            array("connectivity", "Int64", 1, "0 1 2 3"),
            array("offsets", "Int64", 1, "4"),
            array("types", "UInt8", 1, "10"),
        );
        std::fs::write(place.path(&format!("{step}.vtu")), text).unwrap();
        list += &format!("<DataSet timestep=\"{step}.5\" file=\"{step}.vtu\"/>");
    }
    std::fs::write(
        place.path("c.pvd"),
        format!("<VTKFile type=\"Collection\"><Collection>{list}</Collection></VTKFile>"),
    )
    .unwrap();
    place.ok(&["import", "c.pvd", "-o", "t.zarr"]);
    place
}

#[test]
fn ply_files_have_every_digit_and_an_empty_step_is_an_empty_file() {
    let place = corner();
    let report = place.json(&export(&["-o", "s_%02d.ply", "--iso", "0.25", "--json"]));
    assert_eq!(report["output"], "s_%02d.ply");
    let counts = ["steps", "empty_steps", "triangles", "points", "dropped_triangles"].map(|key| report[key].as_u64());
    assert_eq!(counts, [3, 2, 1, 3, 0].map(Some));
    let head = |time: &str, points: usize, triangles: usize| {
        format!(
            "ply\nformat binary_little_endian 1.0\ncomment written by tetreel\ncomment time {time}\nelement vertex {points}\n\
             property double x\nproperty double y\nproperty double z\nproperty float a_b\nelement face {triangles}\n\
             property list uchar uint vertex_indices\nproperty double isovalue\nend_header\n"
        )
    };
    let file = std::fs::read(place.path("s_00.ply")).unwrap();
    let body = file.strip_prefix(head("0.5", 3, 1).as_bytes()).unwrap();
    assert_eq!(body.len(), 3 * 28 + 1 + 3 * 4 + 8);
    // All edges lead to the vertex with the value 1, which is away from the others along x.
    let number = |at: usize| f64::from_le_bytes(body[at..at + 8].try_into().unwrap());
    let mut points = [0, 28, 56].map(|at| [number(at), number(at + 8), number(at + 16)]);
    points.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(points, [[1e9 + 0.25, 0.0, 0.0], [1e9 + 0.25, 0.0, 0.75], [1e9 + 0.25, 0.75, 0.0]]);
    assert_eq!((&body[24..28], body[84], number(body.len() - 8)), (&0.25_f32.to_le_bytes()[..], 3, 0.25));
    for (step, time) in [(1, "1.5"), (2, "2.5")] {
        assert_eq!(std::fs::read(place.path(&format!("s_0{step}.ply"))).unwrap(), head(time, 0, 0).into_bytes());
    }
    assert_eq!(
        report["bytes"],
        (0..3).map(|n| place.path(&format!("s_0{n}.ply")).metadata().unwrap().len()).sum::<u64>()
    );
    let text = place.ok(&export(&["-o", "one.ply", "--surface", "--steps", "2"]));
    assert!(text.contains("1 steps, 0 triangles") && text.contains("1 steps have no triangle"), "{text}");
    let text = place.ok(&export(&["-o", "all.pvd", "--surface"]));
    assert!(text.contains("3 steps, 8 triangles of 8 points"), "{text}");
    let list = std::fs::read_to_string(place.path("all.pvd")).unwrap();
    assert!(list.contains("timestep=\"2.5\"") && list.contains("file=\"all/all_0002.vtp\""), "{list}");
    assert!(place.path("all/all_0002.vtp").is_file());
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let place = tornado();
    for threads in ["1", "2", "7"] {
        let name = format!("x{threads}_%d.vtp");
        place.ok(&export(&["-o", &name, "--iso", "0.5", "--field", "velocity:mag", "--threads", threads]));
    }
    for step in 0..8 {
        let file = |threads: u32| std::fs::read(place.path(&format!("x{threads}_{step}.vtp"))).unwrap();
        assert!(file(1).len() > 10_000 && file(1) == file(2) && file(1) == file(7));
    }
}

#[test]
fn what_makes_no_surface_is_refused_before_anything_is_written() {
    let place = tornado();
    let mag = ["-o", "x.pvd", "--field", "velocity:mag"];
    let cases: [(&[&str], &[&str]); 12] = [
        (&["--iso", "1e6"], &["isovalue 1000000 is never met", "field velocity:mag goes from", "in between"]),
        (&["--iso", "-1"], &["isovalue -1 is never met"]),
        (&["--iso", "nan"], &["--iso", "finite number"]),
        (&["--iso", "x"], &["--iso", "finite number"]),
        (&["--iso", "0.5", "--iso", "0.5"], &["--iso 0.5", "twice"]),
        (&["--iso", "0.5", "--surface"], &["--iso", "--surface"]),
        (&["--slice", "point=0,0,0"], &["--slice", "normal= is missing"]),
        (&["--slice", "point=0,0,0 normal=0,0,0"], &["--slice", "has no direction"]),
        (&["--slice", "point=0,0,nan normal=0,0,1"], &["--slice", "finite"]),
        (&["--slice", "point=0,0,1e6 normal=0,0,1"], &["point=0,0,1000000 normal=0,0,1", "does not meet the mesh"]),
        (&["--iso", "0.5", "--steps", "9"], &["9"]),
        (&["--iso", "0.5", "--field", "velocity:0"], &["one field"]),
    ];
    for (options, parts) in cases {
        place.refuses(&export(&[&mag[..], options].concat()), parts);
    }
    for (options, parts) in [
        (&["x.pvd", "--iso", "0.5"][..], &["one field", "choose one of pressure, velocity:0"][..]),
        (&["x.pvd", "--iso", "0.5", "--field", "velocity"], &["'velocity' is a vector", "velocity:mag or velocity:0"]),
        (&["x.pvd", "--iso", "0.5", "--field", "q"], &["'q'", "velocity"]),
        (&["x.vtp", "--surface"], &["8 steps", "surface_%04d.vtp"]),
        (&["x_%d_%d.ply", "--surface"], &["two places", "surface_%04d.ply"]),
        (&["x_%d/a.ply", "--surface"], &["name of a folder"]),
        (&["none/x_%d.ply", "--surface"], &["none", "create it first"]),
        (&["x.stl", "--surface"], &["x.stl", ".pvd, .vtp or .ply"]),
        (&["x.ply"], &["x.ply", "--iso, --slice or --surface"]),
    ] {
        place.refuses(&export(&[&["-o"], options].concat()), parts);
    }
    std::fs::write(place.path("x_3.vtp"), "mine").unwrap();
    place.refuses(&export(&["-o", "x_%d.vtp", "--surface"]), &["x_3.vtp", "exists"]);
    // The last step is damaged: those before it leave nothing behind.
    std::fs::write(last_chunk(&place), [0]).unwrap();
    for output in ["y_%d.ply", "y.pvd"] {
        place.refuses(&export(&["-o", output, "--surface"]), &["step 7"]);
    }
}

#[test]
fn a_cancelled_export_leaves_nothing() {
    let place = corner();
    let store = Store::open(place.path("t.zarr")).unwrap();
    let before = super::files(place.0.path());
    let options = SurfaceOptions { shape: Shape::Boundary, fields: Vec::new(), steps: None };
    for output in ["x.pvd", "x_%d.ply"] {
        let cancel = Cancel::new();
        cancel.cancel();
        let result = write_surfaces(&store, &place.path(output), &options, &Silent, &cancel);
        assert!(matches!(result, Err(SurfaceError::Cancelled)));
        assert!(super::files(place.0.path()) == before);
    }
}

/// The file of the last step of a component of velocity.
fn last_chunk(place: &Place) -> std::path::PathBuf {
    let files = super::files(&place.path("t.zarr/fields"));
    files.into_keys().find(|path| path.ends_with("raw/c/7/0")).unwrap()
}

/// VTK's Python, or a word about the skip.
fn python() -> Option<String> {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    match Command::new(&python).args(["-c", "import numpy, vtk"]).output() {
        Ok(output) if output.status.success() => return Some(python),
        Ok(output) => {
            let error = String::from_utf8_lossy(&output.stderr);
            crate::common::skip("python", error.lines().last().unwrap_or("vtk cannot be imported"));
        }
        Err(error) => crate::common::skip("python", &error.to_string()),
    }
    None
}

#[test]
fn vtk_reads_the_files_and_finds_the_same_surfaces() {
    let Some(python) = python() else { return };
    let place = tornado();
    place.ok(&export(&["-o", "all.pvd", "--field", "velocity", "--field", "velocity:mag", "--steps", "5"]));
    let isovalues = ["--field", "velocity:mag", "--iso", "0.5", "--iso", "1"];
    place.ok(&export(&[&["-o", "iso.pvd", "--steps", "5"], &isovalues[..]].concat()));
    place.ok(&export(&[&["-o", "iso_%d.ply", "--steps", "5"], &isovalues[..]].concat()));
    let all = ["--field", "velocity", "--field", "velocity:mag"];
    place.ok(&export(&[&["-o", "cut.vtp", "--steps", "5", "--slice", SLICE], &all[..]].concat()));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop/read_surfaces.py");
    let compare = |file: &str, rest: &[&str]| -> Output {
        let mut command = Command::new(&python);
        command.current_dir(place.path(".")).arg(&script).args(["all/all_0000.vtu", file]).args(rest);
        command.output().unwrap()
    };
    let iso = ["iso", "velocity:mag", "0.5", "1"];
    let slice = ["slice", "0,0,0", "1,2,-3"];
    for (file, rest) in [("iso/iso_0000.vtp", &iso[..]), ("iso_0.ply", &iso), ("cut.vtp", &slice)] {
        let output = compare(file, rest);
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        for spoiled in ["move", "flip", "drop", "value"] {
            let is_seen = spoiled != "value" || file.ends_with(".vtp");
            let output = compare(file, &[&["--perturb", spoiled], rest].concat());
            assert_eq!(!output.status.success(), is_seen, "{file}: {spoiled}");
        }
    }
    assert!(!compare("iso/iso_0000.vtp", &["iso", "velocity:mag", "0.5", "1.01"]).status.success());
}
