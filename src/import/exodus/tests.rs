//! Tests of the reader on small files that are built here.

use super::built::{Classic, DOUBLE, Variable};
use super::*;
use crate::field::{Association, Component, FieldInfo};
use crate::random::SplitMix64;
use std::fs;

/// Three blocks on nine points: a hexahedron, a quadrilateral and two tetrahedra, one of them in each half of a pyramid.
fn example(version: u8) -> Classic {
    let mut file = Classic::new(version, 2);
    file.dimension("num_dim", 3);
    let nodes = file.dimension("num_nodes", 9);
    let blocks = file.dimension("num_el_blk", 3);
    file.doubles("time_whole", &[0], [0.5, 2.0]);
    file.ints("eb_prop1", &[blocks], [10, 7, 30]);
    file.names("eb_names", "names", &["left", "", "right"]);
    let coordinates: [[f64; 9]; 3] = [
        [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.5],
        [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.5],
        [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0],
    ];
    for (name, numbers) in ["coordx", "coordy", "coordz"].into_iter().zip(coordinates) {
        file.doubles(name, &[nodes], numbers);
    }
    for (number, element_type, corners, elements) in [
        (1, "hex", 8, vec![1, 2, 3, 4, 5, 6, 7, 8]),
        (2, "SHELL4", 4, vec![1, 2, 3, 4]),
        (3, "Tetra", 4, vec![5, 6, 7, 9, 5, 7, 8, 9]),
    ] {
        let rows = file.dimension(&format!("num_el_in_blk{number}"), elements.len() / corners);
        let corners = file.dimension(&format!("num_nod_per_el{number}"), corners);
        file.ints(&format!("connect{number}"), &[rows, corners], elements).element_type = element_type;
    }
    file.names("name_nod_var", "num_nod_var", &["u_x", "u_y", "T", "u_z"]);
    for number in 1..=4 {
        let values = (0..18).map(|i| f64::from(100 * number + i));
        file.doubles(&format!("vals_nod_var{number}"), &[0, nodes], values);
    }
    file.names("name_elem_var", "num_elem_var", &["p", "q"]);
    let variables = file.dimensions.iter().position(|(name, _)| name == "num_elem_var").unwrap();
    file.ints("elem_var_tab", &[blocks, variables], [1, 0, 0, 0, 1, 1]);
    let of_block = |file: &Classic, number: usize| {
        file.dimensions.iter().position(|(name, _)| *name == format!("num_el_in_blk{number}")).unwrap()
    };
    let (first, last) = (of_block(&file, 1), of_block(&file, 3));
    file.doubles("vals_elem_var1eb1", &[0, first], [1.5, 2.5]);
    file.doubles("vals_elem_var1eb3", &[0, last], [3.0, 4.0, 5.0, 6.0]);
    file.doubles("vals_elem_var2eb3", &[0, last], [7.0, 8.0, 9.0, 10.0]);
    file
}

#[test]
fn units_are_attributes_of_the_variables_of_all_components() {
    let mut file = example(1);
    for (name, attribute) in [
        ("vals_nod_var1", ("units", "m/s")),
        ("vals_nod_var2", ("Units", " m/s ")),
        ("vals_nod_var3", ("units", "")),
        ("vals_nod_var4", ("unit", "m/s")),
        ("vals_elem_var1eb3", ("units", "Pa\0")),
        ("vals_elem_var2eb3", ("long_name", "Pa")),
    ] {
        file.variables.iter_mut().find(|variable| variable.name == name).unwrap().attribute = Some(attribute);
    }
    let units = |file: &Classic| {
        let source = open_bytes(&file.bytes()).source.expect("is read");
        let unit = |field: &FieldInfo| source.unit(field).map(|unit| format!("{}={unit}", field.name));
        source.fields().iter().filter_map(unit).collect::<Vec<_>>()
    };
    assert_eq!(units(&file), ["u=m/s", "p=Pa"]);
    file.variables.iter_mut().find(|variable| variable.name == "vals_nod_var4").unwrap().attribute = None;
    assert_eq!(units(&file), ["p=Pa"], "a component has another unit, or none");
}

struct Opened {
    _folder: tempfile::TempDir,
    source: FileResult<Box<dyn SeriesSource>>,
}

fn open_bytes(bytes: &[u8]) -> Opened {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e");
    fs::write(&path, bytes).unwrap();
    let source = open(&[path]);
    Opened { _folder: folder, source }
}

fn refusal(file: &Classic) -> String {
    let opened = open_bytes(&file.bytes());
    let error = opened.source.and_then(|source| read_all(source.as_ref())).expect_err("is refused").to_string();
    assert!(error.contains("a.e: "), "{error}");
    error
}

fn read_all(source: &dyn SeriesSource) -> FileResult<()> {
    source.mesh()?;
    let mut out = Vec::new();
    for step in 0..source.times().len().min(3) {
        for field in source.fields() {
            source.read(field, Component::Index(field.components - 1), step, &mut out)?;
        }
    }
    Ok(())
}

fn values(source: &dyn SeriesSource, name: &str, component: usize, step: usize) -> Vec<f32> {
    let field = source.fields().iter().find(|field| field.name == name).unwrap_or_else(|| panic!("no field {name}"));
    let mut out = Vec::new();
    source.read(field, Component::Index(component), step, &mut out).unwrap();
    out
}

#[test]
fn blocks_steps_and_components_are_read_in_every_classic_format() {
    for version in [1, 2, 5] {
        let opened = open_bytes(&example(version).bytes());
        let source = opened.source.unwrap();
        let source = source.as_ref();
        assert_eq!(source.times().values, [0.5, 2.0]);
        let mesh = source.mesh().unwrap();
        assert_eq!((mesh.points.len(), mesh.cells.tets.len(), mesh.cells.len()), (9, 2, 3));
        assert_eq!(mesh.points[8].to_array(), [0.5, 0.5, 2.0]);
        assert_eq!(mesh.cells.tets, [[4, 5, 6, 8], [4, 6, 7, 8]]);
        assert_eq!([0, 1, 2].map(|cell| source.cell_number(cell)), [2, 3, 0]);
        let field = |name: &str, components, association| FieldInfo { name: name.to_owned(), components, association };
        use Association::{Cell, Point};
        let fields = [field("u", 3, Point), field("T", 1, Point), field("p", 1, Cell), field("q", 1, Cell)];
        assert_eq!(source.fields(), [&fields[..], &[field("block", 1, Cell)]].concat());
        assert_eq!(values(source, "T", 0, 1), (309..318).map(|v| v as f32).collect::<Vec<_>>());
        assert_eq!([0, 1, 2].map(|component| values(source, "u", component, 0)[2]), [102.0, 202.0, 402.0]);
        assert_eq!(values(source, "p", 0, 0), [3.0, 4.0, 1.5]);
        assert_eq!(values(source, "p", 0, 1), [5.0, 6.0, 2.5]);
        let q = values(source, "q", 0, 1);
        assert!(q[..2] == [9.0, 10.0] && q[2].is_nan(), "{q:?}");
        assert_eq!(values(source, "block", 0, 1), [30.0, 30.0, 10.0]);
        let notes = source.notes().join("\n");
        for expected in
            ["10 left (1 hex), 7 (1 SHELL4), 30 right (2 Tetra)", "'q' has no values (NaN) in 2 of 3", "1 quad"]
        {
            assert!(notes.contains(expected), "{notes}");
        }
    }
}

#[test]
fn old_files_have_their_coordinates_and_values_of_nodes_together() {
    let mut file = example(2);
    let find = |file: &Classic, name: &str| file.dimensions.iter().position(|(of, _)| of == name).unwrap();
    let (axes, nodes, variables) = (find(&file, "num_dim"), find(&file, "num_nodes"), find(&file, "num_nod_var"));
    let bytes = |file: &mut Classic, begin: &str| {
        let taken: Vec<Variable> = file.variables.extract_if(.., |variable| variable.name.starts_with(begin)).collect();
        taken.into_iter().map(|variable| variable.bytes).collect::<Vec<_>>()
    };
    let coordinates = bytes(&mut file, "coord").concat();
    file.put("coord", &[axes, nodes], DOUBLE, coordinates);
    let values_of_nodes = bytes(&mut file, "vals_nod_var");
    let steps = (0..2).flat_map(|step| values_of_nodes.iter().map(move |all| all[step * 72..(step + 1) * 72].to_vec()));
    let steps = steps.collect::<Vec<_>>().concat();
    file.put("vals_nod_var", &[0, variables, nodes], DOUBLE, steps);
    let (old, new) = (open_bytes(&file.bytes()), open_bytes(&example(2).bytes()));
    let (old, new) = (old.source.unwrap(), new.source.unwrap());
    assert_eq!(old.mesh().unwrap(), new.mesh().unwrap());
    for (name, component) in [("T", 0), ("u", 2)] {
        assert_eq!(values(old.as_ref(), name, component, 1), values(new.as_ref(), name, component, 1));
    }
}

#[test]
fn a_file_without_steps_has_its_blocks_at_time_zero() {
    let mut file = example(1);
    file.steps = 0;
    file.variables.retain(|variable| variable.dimensions.first() != Some(&0));
    let opened = open_bytes(&file.bytes());
    let source = opened.source.unwrap();
    assert_eq!((source.times().values.clone(), source.fields().len()), (vec![0.0], 1));
    assert!(source.notes().iter().any(|note| note.contains("no steps")), "{:?}", source.notes());
}

#[test]
fn polyhedra_have_the_faces_of_blocks_of_faces() {
    let polyhedra = |connect: &[i32]| {
        let mut file = Classic::new(2, 0);
        let nodes = file.dimension("num_nodes", 5);
        file.dimension("num_el_blk", 1);
        file.dimension("num_fa_blk", 1);
        let (faces, all) = (file.dimension("num_fa_in_blk1", 7), file.dimension("num_nod_per_fa1", 21));
        let (cells, sides) = (file.dimension("num_el_in_blk1", 2), file.dimension("num_fac_per_el1", connect.len()));
        let points = [[0.0, 1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0, 1.0]];
        for (name, numbers) in ["coordx", "coordy", "coordz"].into_iter().zip(points) {
            file.doubles(name, &[nodes], numbers);
        }
        let nodes = [1, 3, 2, 1, 2, 4, 1, 4, 3, 2, 3, 4, 2, 3, 5, 3, 4, 5, 4, 2, 5];
        file.ints("fbconn1", &[all], nodes);
        file.ints("fbepecnt1", &[faces], [3; 7]);
        file.ints("facconn1", &[sides], connect.to_vec()).element_type = "nfaced";
        file.ints("ebepecnt1", &[cells], [4; 2]);
        file
    };
    let opened = open_bytes(&polyhedra(&[1, 2, 3, 4, 4, 5, 6, 7]).bytes());
    let mesh = opened.source.unwrap().mesh().unwrap();
    assert_eq!((mesh.points.len(), mesh.cells.len()), (5, 2));
    for (connect, expected) in [
        (&[1, 2, 3, 4, 4, 5, 6, 8][..], "has face 8, but there are 7 faces"),
        (&[1, 2, 3, 4, 4, 4, 6, 7], "which two have already"),
        (&[1, 2, 3, 4, 4, 5, 6], "ends in list 1 of 2"),
        (&[1, 2, 3, 4, 4, 5, 6, 7, 7], "1 numbers too many"),
        (&[1, 2, 3, 0, 4, 5, 6, 7], "counted from 1"),
    ] {
        let error = refusal(&polyhedra(connect));
        assert!(error.contains(expected) && error.contains("facconn1"), "{error}");
    }
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    type Change = fn(&mut Classic);
    fn find<'a>(file: &'a mut Classic, name: &str) -> &'a mut Variable {
        file.variables.iter_mut().find(|variable| variable.name == name).unwrap()
    }
    let cases: &[(Change, &[&str])] = &[
        (|file| find(file, "connect3").bytes[3] = 10, &["connect3", "vertex 9, but there are 9 points"]),
        (|file| find(file, "connect1").bytes[3] = 0, &["connect1", "element 0", "counted from 1"]),
        (|file| find(file, "connect1").element_type = "MONSTER", &["block 1", "'MONSTER'", "not read"]),
        (|file| find(file, "connect3").element_type = "", &["block 3", "elem_type"]),
        (|file| find(file, "connect3").element_type = "HEX", &["connect3", "has 4 vertices"]),
        (|file| find(file, "coordz").name = "z".to_owned(), &["'coordz'", "is missing"]),
        (
            |file| find(file, "vals_elem_var1eb3").name = "x".to_owned(),
            &["vals_elem_var1eb3", "block 3", "elem_var_tab"],
        ),
        (
            |file| find(file, "time_whole").bytes[..8].copy_from_slice(&2_f64.to_be_bytes()),
            &["time_whole", "same time 2"],
        ),
        (
            |file| find(file, "time_whole").bytes[..8].copy_from_slice(&f64::NAN.to_be_bytes()),
            &["time_whole", "finite"],
        ),
        (|file| file.dimensions[2].0 = "x".to_owned(), &["no Exodus file"]),
        (|file| file.dimensions[3].1 = 1 << 31, &["num_el_blk", "claims 2147483648"]),
        (|file| file.dimensions[1].1 = 4, &["num_dim", "is 4"]),
        (|file| file.dimensions[1].0 = "a".repeat(1 << 10), &["header", "dimension 1"]),
    ];
    for (change, expected) in cases {
        let mut file = example(2);
        change(&mut file);
        let error = refusal(&file);
        assert!(expected.iter().all(|text| error.contains(text)), "{error}, not {expected:?}");
    }
    for bytes in [&b""[..], b"CDF", b"CDF\x03aaaa", b"\x89HDF\r\n\x1a\n", b"solid a"] {
        assert!(open_bytes(bytes).source.is_err());
    }
}

#[test]
fn later_meshes_are_refused_by_their_names() {
    for name in ["out.e-s002", "out.E-s010.4.0"] {
        let error = super::super::open(Path::new(name)).err().unwrap().to_string();
        assert!(error.contains("later mesh"), "{error}");
    }
    for name in ["a.4.0", "a.b-s2", "e-s2", "4.0", "e", "a.e.4.0"] {
        assert!(refused_by_name(Path::new(name)).is_none(), "{name}");
    }
}

#[test]
fn no_cut_and_no_flipped_bit_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e");
    let run = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        open(std::slice::from_ref(&path)).and_then(|source| read_all(source.as_ref()))
    };
    let sound = example(5).bytes();
    assert!(run(&sound).is_ok());
    for end in 0..sound.len() {
        assert!(run(&sound[..end]).is_err(), "cut at {end}");
    }
    let mut random = SplitMix64::new(7);
    for version in [1, 2, 5] {
        let sound = example(version).bytes();
        for _ in 0..700 {
            let mut bytes = sound.clone();
            for _ in 0..1 + random.below(3) {
                bytes[random.below(sound.len())] ^= 1 << random.below(8);
            }
            let _ = run(&bytes);
        }
    }
}
