//! Series of several files: times, parts, and the checks of later steps against the first.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use tetreel::error::FileErrorKind;
use tetreel::field::{Association, Component, FieldInfo, SeriesSource};
use tetreel::import;
use tetreel::look::Look;
use tetreel::pipeline::Series;
use tetreel::task::Cancel;

/// A grid to be written as ASCII `.vtu`. Starts as two tetrahedra with a point array `T` and a cell array `c`.
#[derive(Clone)]
pub struct Grid {
    pub points: Vec<[f64; 3]>,
    pub cells: Vec<(u8, Vec<usize>)>,
    pub point_arrays: Vec<(&'static str, usize, Vec<f64>)>,
    pub cell_arrays: Vec<(&'static str, usize, Vec<f64>)>,
    pub time: Option<f64>,
    /// Faces of the cells that are polyhedra, by the index of the cell.
    pub faces: Vec<(usize, Vec<Vec<usize>>)>,
    /// Whether these are written as by VTK 9.4, each face on its own.
    pub has_shared_faces: bool,
    /// Blank lines put between the numbers, which changes the bytes and not the values.
    pub separator: &'static str,
}

impl Default for Grid {
    fn default() -> Self {
        Self {
            points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]],
            cells: vec![(10, vec![0, 1, 2, 3]), (10, vec![1, 2, 3, 4])],
            point_arrays: vec![("T", 1, vec![0.0, 1.0, 2.0, 3.0, 4.0])],
            cell_arrays: vec![("c", 1, vec![10.0, 20.0])],
            time: None,
            faces: Vec::new(),
            has_shared_faces: false,
            separator: " ",
        }
    }
}

impl Grid {
    pub fn text(&self) -> String {
        let mut out = String::from(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\"><UnstructuredGrid>\n",
        );
        let array = |out: &mut String, kind: &str, name: &str, components: usize, numbers: Vec<String>| {
            let numbers = numbers.join(self.separator);
            let tag = format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"");
            writeln!(out, "{tag} format=\"ascii\">\n{numbers}\n</DataArray>").expect("a string");
        };
        let floats = |values: &[f64]| values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>();
        if let Some(time) = self.time {
            out += "<FieldData>";
            array(&mut out, "Float64", "TimeValue", 1, floats(&[time]));
            out += "</FieldData>";
        }
        let (points, cells) = (self.points.len(), self.cells.len());
        write!(out, "<Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">").expect("a string");
        for (section, arrays) in [("PointData", &self.point_arrays), ("CellData", &self.cell_arrays)] {
            write!(out, "<{section}>").expect("a string");
            for (name, components, values) in arrays {
                array(&mut out, "Float64", name, *components, floats(values));
            }
            write!(out, "</{section}>").expect("a string");
        }
        out += "<Points>";
        array(&mut out, "Float64", "Points", 3, floats(self.points.as_flattened()));
        out += "</Points><Cells>";
        let mut end = 0;
        let offsets = self.cells.iter().map(|(_, vertices)| {
            end += vertices.len();
            end.to_string()
        });
        array(&mut out, "Int32", "offsets", 1, offsets.collect());
        let connectivity = self.cells.iter().flat_map(|(_, vertices)| vertices.iter().map(usize::to_string));
        array(&mut out, "Int32", "connectivity", 1, connectivity.collect());
        array(&mut out, "UInt8", "types", 1, self.cells.iter().map(|(kind, _)| kind.to_string()).collect());
        for (name, numbers) in self.face_arrays() {
            array(&mut out, "Int64", name, 1, numbers.iter().map(i64::to_string).collect());
        }
        out + "</Cells></Piece></UnstructuredGrid></VTKFile>\n"
    }
}

impl Grid {
    /// The arrays of polyhedra.
    fn face_arrays(&self) -> Vec<(&'static str, Vec<i64>)> {
        if self.faces.is_empty() {
            return Vec::new();
        }
        let of_cell = |cell: usize| self.faces.iter().find(|(of, _)| *of == cell).map(|(_, faces)| faces);
        let number = |n: &usize| *n as i64;
        let (mut words, mut ends) = (Vec::new(), Vec::new());
        let (mut corners, mut face_ends, mut cell_ends) = (Vec::new(), Vec::new(), Vec::new());
        for cell in 0..self.cells.len() {
            if let Some(faces) = of_cell(cell) {
                words.push(faces.len() as i64);
                for face in faces {
                    words.push(face.len() as i64);
                    words.extend(face.iter().map(number));
                    corners.extend(face.iter().map(number));
                    face_ends.push(corners.len() as i64);
                }
                ends.push(words.len() as i64);
            } else {
                ends.push(-1);
            }
            cell_ends.push(face_ends.len() as i64);
        }
        let faces = (0..face_ends.len() as i64).collect();
        if self.has_shared_faces {
            let arrays = [corners, face_ends, faces, cell_ends];
            let names = ["face_connectivity", "face_offsets", "polyhedron_to_faces", "polyhedron_offsets"];
            return names.into_iter().zip(arrays).collect();
        }
        vec![("faces", words), ("faceoffsets", ends)]
    }
}

/// Writes the grids as `a_0.vtu`, `a_1.vtu`, ... and `run.pvd`, which lists them at times 0, 0.5, 1, ...
pub fn write_series(folder: &Path, grids: &[Grid]) -> PathBuf {
    let entries = grids.iter().enumerate().map(|(i, grid)| {
        fs::write(folder.join(format!("a_{i}.vtu")), grid.text()).expect("a file");
        format!("<DataSet timestep=\"{}\" part=\"0\" file=\"a_{i}.vtu\"/>\n", i as f64 * 0.5)
    });
    write_pvd(folder, &entries.collect::<String>())
}

fn write_pvd(folder: &Path, entries: &str) -> PathBuf {
    let path = folder.join("run.pvd");
    let text = format!("<VTKFile type=\"Collection\">\n<Collection>\n{entries}</Collection>\n</VTKFile>\n");
    fs::write(&path, text).expect("a file");
    path
}

fn read(source: &dyn SeriesSource, field: usize, step: usize) -> Result<Vec<f32>, String> {
    let mut out = Vec::new();
    let field = &source.fields()[field];
    source.read(field, Component::Index(0), step, &mut out).map(|()| out).map_err(|e| e.to_string())
}

/// Opens a series whose second step is `second`, and returns the error of reading it.
fn error_of_second(second: Grid) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = write_series(folder.path(), &[Grid::default(), second, Grid::default()]);
    let source = import::open(&path).expect("the first step is valid");
    assert_eq!(read(source.as_ref(), 0, 2).as_deref(), Ok(&[0.0, 1.0, 2.0, 3.0, 4.0][..]), "the others still play");
    let error = read(source.as_ref(), 0, 1).expect_err("the second step must be refused");
    assert!(error.contains("a_1.vtu"), "{error}");
    error
}

#[test]
fn values_change_from_step_to_step_while_the_mesh_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let grids: Vec<_> = (0..9)
        .map(|i| Grid {
            point_arrays: vec![("T", 1, (0..5).map(|v| f64::from(v * 10 + i)).collect())],
            // The same mesh in other bytes.
            separator: if i % 2 == 0 { " " } else { "\n " },
            ..Grid::default()
        })
        .collect();
    let source = import::open(&write_series(folder.path(), &grids)).expect("opens");
    assert_eq!(source.times().values, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]);
    for step in [8, 0, 3, 3, 1, 7, 0] {
        let wanted: Vec<_> = (0..5).map(|v| (v * 10 + step) as f32).collect();
        assert_eq!(read(source.as_ref(), 0, step), Ok(wanted));
        assert_eq!(read(source.as_ref(), 1, step), Ok(vec![10.0, 20.0]));
    }
    assert_eq!(source.notes(), [""; 0]);
}

#[test]
fn a_step_with_another_mesh_is_refused() {
    let changed = |change: fn(&mut Grid)| {
        let mut grid = Grid::default();
        change(&mut grid);
        error_of_second(grid)
    };
    let counts = changed(|g| {
        g.points.push([5.0; 3]);
        g.point_arrays[0].2.push(5.0);
    });
    assert!(counts.contains("5 points and 2 cells, then 6 and 2"), "{counts}");
    let moved = changed(|g| g.points[4] = [1.0, 1.0, 1.5]);
    assert!(moved.contains("mesh changes between steps 0 and 1") && moved.contains("points move"), "{moved}");
    let other = changed(|g| g.cells[1].1 = vec![0, 2, 3, 4]);
    assert!(other.contains("mesh changes between steps 0 and 1") && other.contains("other cells"), "{other}");
}

#[test]
fn points_that_move_are_shown_where_they_were_with_their_displacement_if_that_is_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut moved = Grid::default();
    moved.points[4][2] += 0.5;
    moved.points[1][0] -= 0.25;
    let grids = [Grid::default(), moved.clone(), Grid::default(), moved];
    let mut source = import::open(&write_series(folder.path(), &grids)).expect("opens");
    let field = source.fields()[0].clone();
    let error = source.read(&field, Component::Index(0), 1, &mut Vec::new()).expect_err("points move").to_string();
    assert!(error.contains("import with --fixed-points"), "{error}");
    source.fix_points().expect("reads the first step");
    source.fix_points().expect("is done once");
    let names: Vec<_> = source.fields().iter().map(|field| (field.name.as_str(), field.components)).collect();
    assert_eq!(names.last(), Some(&("displacement", 3)));
    assert_eq!(names.iter().filter(|(name, _)| *name == "displacement").count(), 1);
    let displacement = source.fields().last().expect("a field").clone();
    for step in 0..4 {
        let far = f32::from(u8::from(step % 2 == 1));
        let read = |component| {
            let mut values = Vec::new();
            source.read(&displacement, component, step, &mut values).expect("reads");
            values
        };
        assert_eq!(read(Component::Index(0)), [0.0, -0.25 * far, 0.0, 0.0, 0.0]);
        assert_eq!(read(Component::Index(2)), [0.0, 0.0, 0.0, 0.0, 0.5 * far]);
        assert_eq!(read(Component::Magnitude), [0.0, 0.25 * far, 0.0, 0.0, 0.5 * far]);
        source.read(&field, Component::Index(0), step, &mut Vec::new()).expect("values of all steps");
        source.check(step).expect("all steps fit");
    }
    let notes = source.notes();
    assert_eq!(notes.iter().filter(|note| note.contains("points move in 2 steps (1, 3)")).count(), 1, "{notes:?}");
    assert!(!notes.iter().any(|note| note.contains("missing")), "{notes:?}");
    let mesh = source.mesh().expect("the mesh of the first step");
    assert_eq!(mesh.points.iter().map(|point| point.to_array()).collect::<Vec<_>>(), Grid::default().points);
    // Other cells stay an error.
    let mut other = Grid::default();
    other.cells[1].1 = vec![0, 2, 3, 4];
    let place = tempfile::tempdir().expect("a folder");
    let mut source = import::open(&write_series(place.path(), &[Grid::default(), other])).expect("opens");
    source.fix_points().expect("reads the first step");
    assert!(source.check(1).expect_err("other cells").to_string().contains("other cells"));
}

#[test]
fn a_first_step_that_was_written_anew_with_another_mesh_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = import::open(&write_series(folder.path(), &vec![Grid::default(); 9])).expect("opens");
    // Those that are in memory would hide it.
    (1..9).for_each(|step| _ = read(source.as_ref(), 0, step).expect("values"));
    let mut other = Grid::default();
    other.points[4][2] += 0.5;
    fs::write(folder.path().join("a_0.vtu"), other.text()).expect("a file");
    let error = read(source.as_ref(), 0, 0).expect_err("points have moved");
    assert!(error.contains("a_0.vtu") && error.contains("points move"), "{error}");
}

#[test]
fn a_part_that_is_far_away_is_left_out_of_the_default_view_of_the_store() {
    let folder = tempfile::tempdir().expect("a folder");
    let near = Grid::default();
    let mut grid = near.clone();
    grid.points.extend(near.points[..4].iter().map(|[x, y, z]| [x - 3e4, *y, *z]));
    grid.cells.push((10, vec![5, 6, 7, 8]));
    grid.point_arrays[0].2.extend([7.0; 4]);
    grid.cell_arrays[0].2.push(70.0);
    let look_at = |grid: &Grid, name: &str| {
        let source = import::open(&write_series(folder.path(), std::slice::from_ref(grid))).expect("opens");
        let store = crate::series::ingested(&*source, &folder.path().join(name), "0..");
        let series = Series::open(&store, None).expect("opens");
        let look = Look::first_for(&series, &Cancel::new()).expect("a look");
        (look, store.info().expect("reads").mesh.repair["far_parts"].clone())
    };
    let (alone, none) = look_at(&near, "near.zarr");
    let (with_far, found) = look_at(&grid, "far.zarr");
    assert!(none.is_null());
    assert_eq!((&found["parts"], &found["cells"], &found["cell"]), (&1.into(), &1.into(), &2.into()));
    // Positions are rounded in a box that is 2^14 times as large.
    let near = |a: f64, b: f64| (a - b).abs() < 1e-2 * b.abs().max(1.0);
    assert!((alone.camera.position - with_far.camera.position).length() < 1e-2, "{:?}", with_far.camera);
    assert!(near(alone.lengths.unit_distance, with_far.lengths.unit_distance));
    assert!(with_far.lengths.longest_path > 3e4, "tables are for paths through all");
}

#[test]
fn a_field_that_is_missing_in_a_step_is_a_hole_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let without = Grid { point_arrays: vec![("U", 1, vec![0.0; 5])], ..Grid::default() };
    let source =
        import::open(&write_series(folder.path(), &[Grid::default(), without, Grid::default()])).expect("opens");
    assert_eq!(source.fields().len(), 2, "those of the first step");
    assert!(read(source.as_ref(), 0, 1).expect("holes").iter().all(|value| value.is_nan()));
    assert_eq!(read(source.as_ref(), 0, 2).expect("values"), [0.0, 1.0, 2.0, 3.0, 4.0]);
    let note = "field 'T' is missing in 1 step (1): holes";
    assert!(source.notes().iter().any(|found| found == note), "{:?}", source.notes());
}

#[test]
fn a_field_that_has_other_components_in_a_step_is_an_error_that_names_both() {
    let vector = error_of_second(Grid { point_arrays: vec![("T", 3, vec![0.0; 15])], ..Grid::default() });
    assert!(vector.contains("3 components, but 1"), "{vector}");
    let short = error_of_second(Grid { point_arrays: vec![("T", 1, vec![0.0; 4])], ..Grid::default() });
    assert!(short.contains("array 'T'") && short.contains("4 numbers, but 5"), "{short}");
}

#[test]
fn a_file_that_vanished_after_opening_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = import::open(&write_series(folder.path(), &vec![Grid::default(); 3])).expect("opens");
    fs::remove_file(folder.path().join("a_2.vtu")).expect("removes");
    let field = source.fields()[0].clone();
    let error = source.read(&field, Component::Index(0), 2, &mut Vec::new()).expect_err("gone");
    assert_eq!(error.kind, FileErrorKind::Io);
    assert!(error.to_string().contains("a_2.vtu"));
    fs::write(folder.path().join("a_2.vtu"), Grid::default().text()).expect("a file");
    assert!(read(source.as_ref(), 0, 2).is_ok(), "errors are not remembered");
}

#[test]
fn other_cells_are_skipped_or_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.vtu");
    let open = |kind: u8, vertices: Vec<usize>| {
        let mut grid = Grid::default();
        grid.cells.insert(1, (kind, vertices));
        grid.cell_arrays[0].2.insert(1, 15.0);
        fs::write(&path, grid.text()).expect("a file");
        import::open(&path)
    };
    for kind in [1, 3, 5, 7, 9, 21, 22, 34] {
        let source = open(kind, vec![0, 1, 2]).expect("is skipped");
        assert_eq!(read(source.as_ref(), 1, 0), Ok(vec![10.0, 20.0]), "cell values of tetrahedra only");
        assert!(source.notes()[0].starts_with("skipped 1 cells without volume: 1 "), "{:?}", source.notes());
    }
    for (kind, name) in [(41, "convex point set"), (55, "parametric"), (67, "higher order")] {
        let error = open(kind, vec![0, 1, 2, 3]).err().expect("is refused");
        assert_eq!(error.kind, FileErrorKind::Unsupported);
        let text = error.to_string();
        for part in ["a.vtu", "cell 1", &format!("type {kind} "), name, "Tetrahedralize"] {
            assert!(text.contains(part), "{text}");
        }
    }
    for (kind, name) in [(11, "voxel"), (12, "hexahedron"), (13, "wedge"), (24, "quadratic tetrahedron")] {
        let error = open(kind, vec![0, 1, 2, 3]).err().expect("too few vertices").to_string();
        assert!(error.contains("a.vtu") && error.contains(name) && error.contains("1 has 4 vertices"), "{error}");
    }
    let unknown = open(99, vec![0, 1, 2, 3]).err().expect("is refused");
    assert_eq!(unknown.kind, FileErrorKind::Invalid);
    assert!(unknown.to_string().contains("type 99"));
    assert!(open(10, vec![0, 1, 2]).err().expect("three vertices").to_string().contains("3 vertices"));
    assert!(open(10, vec![0, 1, 2, 5]).err().expect("out of range").to_string().contains("vertex 5"));
}

#[test]
fn parts_of_a_step_are_joined() {
    let folder = tempfile::tempdir().expect("a folder");
    let cell_arrays = vec![("c", 1, vec![30.0, 40.0]), ("vtkGhostType", 1, vec![0.0, 0.0])];
    let ghosted = Grid { cell_arrays, ..Grid::default() };
    fs::write(folder.path().join("a.vtu"), Grid::default().text()).expect("a file");
    // Ghost flags are bytes.
    let text = ghosted.text().replace("Float64\" Name=\"vtkGhostType", "UInt8\" Name=\"vtkGhostType");
    let text = text.replace("\n0.0 0.0\n", "\n1 0\n");
    fs::write(folder.path().join("b.vtu"), text).expect("a file");
    let entries: String = ["b", "a"]
        .iter()
        .zip([1, 0])
        .map(|(name, part)| format!("<DataSet timestep=\"3\" group=\"\" part=\"{part}\" file=\"{name}.vtu\"/>"))
        .collect();
    let source = import::open(&write_pvd(folder.path(), &entries)).expect("opens");
    let mesh = source.mesh().expect("reads");
    assert_eq!(mesh.points.len(), 5);
    assert_eq!(
        mesh.cells.tets,
        [[0, 1, 2, 3], [1, 2, 3, 4], [1, 2, 3, 4]],
        "the ghost is a copy of another part's cell"
    );
    assert_eq!(read(source.as_ref(), 1, 0), Ok(vec![10.0, 20.0, 40.0]));
    assert_eq!(source.times().values, [3.0]);
    let notes = source.notes().join("\n");
    for part in
        ["1 ghost cells", "joined 5 points on borders between pieces", "'vtkGhostType' (not the same in all pieces)"]
    {
        assert!(notes.contains(part), "{part}: {notes}");
    }
}

#[test]
fn several_files_become_a_series_in_natural_order_or_in_that_of_their_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, value: f64, time: Option<f64>| {
        let grid = Grid { point_arrays: vec![("T", 1, vec![value; 5])], time, ..Grid::default() };
        let path = folder.path().join(name);
        fs::write(&path, grid.text()).expect("a file");
        path
    };
    let plain = [write("s10.vtu", 10.0, None), write("s9.vtu", 9.0, None)];
    let source = import::open_many(&plain).expect("opens");
    assert_eq!(source.times().values, [0.0, 1.0]);
    assert_eq!(read(source.as_ref(), 0, 0), Ok(vec![9.0; 5]));
    assert!(source.notes()[0].contains("times are 0, 1, 2"));

    let timed = [write("t1.vtu", 1.0, Some(7.5)), write("t2.vtu", 2.0, Some(0.1))];
    let source = import::open_many(&timed).expect("opens");
    assert_eq!(source.times().values, [0.1, 7.5]);
    assert_eq!(read(source.as_ref(), 0, 0), Ok(vec![2.0; 5]));
    assert!(source.notes()[0].contains("TimeValue"));
    assert_eq!(import::open_many(&timed[..1]).expect("opens").times().values, [7.5]);
}

#[test]
fn values_beyond_f32_are_counted_once_however_often_they_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let huge =
        Grid { point_arrays: vec![("T", 1, vec![1e39, -1e300, 3.0, f64::INFINITY, f64::NAN])], ..Grid::default() };
    let source = import::open(&write_series(folder.path(), &[Grid::default(), huge.clone(), huge])).expect("opens");
    for step in [0, 1, 2, 1, 1] {
        let values = read(source.as_ref(), 0, step).expect("reads");
        if step > 0 {
            assert_eq!(values[..4], [f32::INFINITY, f32::NEG_INFINITY, 3.0, f32::INFINITY]);
            assert!(values[4].is_nan());
        }
    }
    assert_eq!(source.notes().len(), 1);
    assert!(source.notes()[0].contains("'T': 4 values in 2 steps"), "{:?}", source.notes());
}

#[test]
fn many_threads_read_the_same_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let grids: Vec<_> =
        (0..12).map(|i| Grid { point_arrays: vec![("T", 1, vec![f64::from(i); 5])], ..Grid::default() }).collect();
    let source = import::open(&write_series(folder.path(), &grids)).expect("opens");
    let source = source.as_ref();
    std::thread::scope(|scope| {
        for thread in 0..4 {
            scope.spawn(move || {
                for i in 0..60 {
                    let step = (i * (thread + 1)) % 12;
                    assert_eq!(read(source, 0, step), Ok(vec![step as f32; 5]));
                }
            });
        }
    });
}

#[test]
fn a_field_that_the_source_does_not_offer_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = import::open(&write_series(folder.path(), &[Grid::default()])).expect("opens");
    for association in [Association::Point, Association::Cell] {
        let field = FieldInfo { name: "nothing".to_owned(), components: 1, association };
        let error =
            source.read(&field, Component::Index(0), 0, &mut Vec::new()).expect_err("no such field").to_string();
        assert!(error.contains("'nothing'"), "{error}");
    }
}
