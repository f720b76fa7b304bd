//! Tests of texts and files.

use super::*;
use std::path::{Path, PathBuf};

fn error(text: &str) -> String {
    TransferFunction::parse(text).unwrap_err().to_string()
}

fn numbers(tf: &TransferFunction) -> Vec<[f64; 2]> {
    tf.points().iter().map(|&p| p.into()).collect()
}

/// A folder with a file of two maps, one of a single map with opacities, and transfer functions.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write(
        "two.json",
        r#"[{"Name": "ink", "ColorSpace": "RGB", "RGBPoints": [0, 1, 1, 1, 8, 0, 0, 0], "Creator": "nobody"},
            {"Name": "hue_r", "ColorSpace": "HSV", "RGBPoints": [0, 1, 0, 0, 1, 0, 0, 1]}]"#,
    );
    write(
        "one.json",
        r#"[{"Name": "ink", "ColorSpace": "RGB", "NanColor": [1, 0, 0], "RGBPoints": [-4, 1, 1, 1, 4, 0, 0, 0],
             "Points": [-4, 0, 0.5, 0, 0, 0.25, 0.5, 0, 4, 0.5, 0.5, 0]}]"#,
    );
    write("tf.json", r#"{"color_map": "two.json#ink_r", "positions": "absolute", "points": [[-5, 0], [20.5, 0.5]]}"#);
    write("tau.json", r#"{"color_map": "vik", "values": "tau", "points": [[0, 0], [1, 40]]}"#);
    dir
}

fn path_text(dir: &tempfile::TempDir, name: &str) -> String {
    dir.path().join(name).to_str().unwrap().to_owned()
}

#[test]
fn a_map_with_points_is_read() {
    let tf = TransferFunction::parse("viridis@0:0, 0.4:0.2,0.4:1e-3,1:0").unwrap();
    assert_eq!(tf.color_map().name(), "viridis");
    assert_eq!(numbers(&tf), [[0.0, 0.0], [0.4, 0.2], [0.4, 0.001], [1.0, 0.0]]);
    assert_eq!((tf.positions(), tf.values()), (PositionKind::Relative, OpacityValues::Opacity));
    let reversed = TransferFunction::parse("vik_r@0:0.5").unwrap();
    assert_eq!(reversed.color_map(), &ColorMap::built_in("vik").unwrap().reversed());
}

#[test]
fn a_map_alone_has_a_ramp() {
    let tf = TransferFunction::parse("batlow").unwrap();
    assert_eq!(tf, TransferFunction::ramp(ColorMap::built_in("batlow").unwrap().clone()));
}

#[test]
fn grammar_errors_name_the_part() {
    for (text, part) in [
        ("gray@0:0,0.5", "'0.5'"),
        ("gray@0:0,x:1", "'x:1'"),
        ("gray@0:0,1:y", "'1:y'"),
        ("gray@0:0,1:nan", "'1:nan'"),
        ("gray@0:0,1.5:1", "'1.5:1'"),
        ("gray@0:0,1:-1", "'1:-1'"),
        ("gray@0.5:0,0.4:1", "'0.4:1'"),
        ("gray@0:0,0:1,0:0.5", "'0:0.5'"),
        ("gray@", "''"),
        ("gray@0:0,,1:1", "''"),
    ] {
        let error = error(text);
        assert!(error.starts_with(part), "{text}: {error}");
    }
}

#[test]
fn an_unknown_map_comes_with_the_list() {
    for text in ["jet", "jet@0:0,1:1", "jet_r", "", "@0:0"] {
        let error = error(text);
        assert!(error.contains("viridis, inferno, plasma") && error.contains("gray"), "{text}: {error}");
    }
}

#[test]
fn maps_come_from_files_by_name_and_reversed() {
    let dir = folder();
    let parse = |name: &str| TransferFunction::parse(path_text(&dir, name));
    let ink = parse("two.json#ink").unwrap();
    assert_eq!(ink.color_map().eval(0.25), [0.75; 3]);
    assert_eq!(parse("two.json#ink_r@0:0,1:1").unwrap().color_map(), &ink.color_map().reversed());
    assert_eq!(parse("two.json#hue_r").unwrap().color_map().eval(0.5), [0.0, 1.0, 0.0], "an exact name goes first");
    let single = parse("one.json").unwrap();
    assert_eq!(numbers(&single), [[0.0, 0.0], [0.5, 0.25], [1.0, 0.5]]);
    assert_eq!(single.color_map().nan_color(), Some([1.0, 0.0, 0.0]));
    assert_eq!(numbers(&parse("one.json_r").unwrap()), [[0.0, 0.5], [0.5, 0.25], [1.0, 0.0]]);
    assert_eq!(numbers(&parse("one.json@0:1").unwrap()), [[0.0, 1.0]]);
}

#[test]
fn file_errors_name_file_and_entry() {
    let dir = folder();
    let fails = |name: &str| error(&path_text(&dir, name));
    let several = fails("two.json");
    assert!(several.contains("two.json") && several.contains("'ink', 'hue_r'"), "{several}");
    let missing = fails("two.json#blue");
    assert!(missing.contains("'blue'") && missing.contains("'ink'"), "{missing}");
    assert!(fails("none.json").contains("none.json"));
    for (text, named) in [
        (r#"[{"Name": "a", "RGBPoints": [0, 1, 1]}]"#, "colour map 0 ('a'): RGBPoints has 3"),
        (r#"[{"Name": "a", "RGBPoints": [0, 1, 1, 2]}]"#, "colour map 0 ('a')"),
        (r#"[{"Name": "a", "RGBPoints": "x"}]"#, "colour map 0 ('a')"),
        (r#"[{"Name": "a", "IndexedColors": [1, 0, 0]}]"#, "has no RGBPoints"),
        (r#"[{"Name": "a", "ColorSpace": "CMYK", "RGBPoints": [0, 1, 1, 1]}]"#, "'CMYK'"),
        (r#"[{"Name": "a", "RGBPoints": [0, 1, 1, 1], "Points": [0, 1]}]"#, "Points has 2"),
        (r#"[{"RGBPoints": [0, 1, 1, 1], "Points": [0, -1, 0.5, 0]}]"#, "colour map 0 ('without a name')"),
        (r#"[{"Name": "a", "RGBPoints": [0, 0, 0, 0]}, 7]"#, "colour map 1"),
        ("[]", "has no colour map"),
        ("[1", "line 1 column 2"),
        ("", "line 1"),
    ] {
        std::fs::write(dir.path().join("bad.json"), text).unwrap();
        let error = fails("bad.json");
        assert!(error.contains("bad.json") && error.contains(named), "{text}: {error}");
    }
}

#[test]
fn transfer_function_files_are_read_with_maps_beside_them() {
    let dir = folder();
    let tf = TransferFunction::parse(path_text(&dir, "tf.json")).unwrap();
    assert_eq!((tf.positions(), tf.color_map().name()), (PositionKind::Absolute, "ink_r"));
    assert_eq!(numbers(&tf), [[-5.0, 0.0], [20.5, 0.5]]);
    let tau = TransferFunction::read(&dir.path().join("tau.json")).unwrap();
    assert_eq!(tau.values(), OpacityValues::Extinction);
}

#[test]
fn bad_transfer_function_files_name_file_and_place() {
    let dir = folder();
    for (text, named) in [
        (r#"{"color_map": "jet", "points": [[0, 1]]}"#, "no colour map 'jet'"),
        (r#"{"color_map": "vik", "points": []}"#, "at least one opacity point"),
        (r#"{"color_map": "vik", "points": [[0, 1], [2, 1]]}"#, "point 1 (2:1)"),
        (r#"{"color_map": "vik", "points": [[0, 1]], "colour": 1}"#, "colour"),
        (r#"{"color_map": "vik", "points": [[0, 1, 2]]}"#, "line 1"),
        (r#"{"color_map": "vik"}"#, "points"),
        (r#"{"color_map": "no/such.json", "points": [[0, 1]]}"#, "such.json"),
        (r#"{"color_map": "vik", "positions": "percent", "points": [[0, 1]]}"#, "percent"),
        ("{", "line 1"),
    ] {
        std::fs::write(dir.path().join("bad.json"), text).unwrap();
        let error = error(&path_text(&dir, "bad.json"));
        assert!(
            (error.contains("bad.json") || error.contains("such.json")) && error.contains(named),
            "{text}: {error}"
        );
    }
}

#[test]
fn transfer_functions_round_trip_through_json() {
    let dir = folder();
    let own = TransferFunction::parse(path_text(&dir, "one.json")).unwrap();
    let built_in = TransferFunction::parse("cool-to-warm_r@0:0,0.3:1,0.3:0.25").unwrap();
    assert!(built_in.to_json().contains("\"cool-to-warm_r\""), "a built-in map is its name");
    let own_absolute =
        TransferFunction::new(own.color_map().clone(), vec![], PositionKind::Absolute, OpacityValues::Extinction);
    assert!(matches!(own_absolute, Err(TransferError::NoPoints)));
    for tf in [own, built_in] {
        let path = dir.path().join("again.json");
        std::fs::write(&path, tf.to_json()).unwrap();
        assert_eq!(TransferFunction::read(&path).unwrap(), tf);
        assert_eq!(serde_json::from_str::<TransferFunction>(&serde_json::to_string(&tf).unwrap()).unwrap(), tf);
    }
}

#[test]
fn color_maps_round_trip_through_paraview_json() {
    let dir = folder();
    let mut entries = read_color_maps(&dir.path().join("two.json")).unwrap();
    entries.extend(read_color_maps(&dir.path().join("one.json")).unwrap());
    let again = dir.path().join("again.json");
    std::fs::write(&again, color_maps_to_json(&entries)).unwrap();
    assert_eq!(read_color_maps(&again).unwrap(), entries);
}

/// `vtkPiecewiseFunction::GetValue` of VTK 9.7.2 for two nodes (0, 0) and (1, 1): midpoint, sharpness, x, value.
const HERMITE: [(f64, f64, f64, f64); 7] = [
    (0.5, 0.5, 0.25, 0.003997325897216797),
    (0.5, 0.5, 0.6, 0.9109459960376852),
    (0.3, 0.2, 0.2, 0.13038662805466653),
    (0.3, 0.2, 0.7, 0.967608048024059),
    (0.8, 0.9, 0.75, 0.17942977761455126),
    (0.2, 0.0, 0.5, 0.6875),
    (0.5, 0.98, 0.49, 0.3558055874541378),
];

fn opacity_of(points: &str) -> Vec<OpacityPoint> {
    let text = format!(r#"[{{"Name": "a", "RGBPoints": [0, 0, 0, 0], "Points": {points}}}]"#);
    let entries = paraview::parse(Path::new("test.json"), &text).unwrap();
    entries.into_iter().next().unwrap().opacity.unwrap()
}

#[test]
fn midpoints_and_sharpness_follow_vtk() {
    for (midpoint, sharpness, x, value) in HERMITE {
        let points = opacity_of(&format!("[0, 0, {midpoint}, {sharpness}, 1, 1, 0.5, 0]"));
        let after = points.partition_point(|p| p.position <= x);
        let (a, b) = (points[after - 1], points[after]);
        let ours = |x: f64| a.value + (x - a.position) / (b.position - a.position) * (b.value - a.value);
        // As near as the straight pieces of a curve promise to be. Measured: 3.0e-5.
        let is_close = |ours: f64| (ours - value).abs() < 5e-5;
        assert!(is_close(ours(x)), "{midpoint} {sharpness} {x}: {} not {value}", ours(x));
        assert!(!is_close(ours(x + 0.003)), "{midpoint} {sharpness} {x}: a place off by 0.003");
    }
    let step = opacity_of("[0, 0.25, 0.3, 1, 10, 0.75, 0.5, 0]");
    let step: Vec<[f64; 2]> = step.into_iter().map(Into::into).collect();
    assert_eq!(step, [[0.0, 0.25], [0.3, 0.25], [0.3, 0.75], [1.0, 0.75]]);
}

#[test]
fn the_shipped_files_are_those_compiled_in() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("data/colormaps");
    let mut files = 0;
    for file in std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()) {
        if file.extension().is_some_and(|e| e == "json") {
            let entries = read_color_maps(&file).unwrap();
            assert_eq!(entries.len(), 1);
            assert_eq!(ColorMap::built_in(entries[0].map.name()), Some(&entries[0].map));
            files += 1;
        }
    }
    assert_eq!(files, ColorMap::built_in_names().count());
}

#[test]
fn extinction_is_that_of_the_opacity_of_a_unit_distance() {
    let (range, unit) = (MappedRange::new(2.0, 5.0, false).unwrap(), 0.25);
    // Constant, and a ramp so low that the table is the line between its ends, whatever the tolerance: a table that cannot follow a wrong
    // formula would be refined for ever.
    for ends in [[0.15, 0.15], [0.5, 0.5], [1e-9, 3e-9]] {
        let tf = TransferFunction::parse(format!("gray@0:{},1:{}", ends[0], ends[1])).unwrap();
        let table = build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_unit_distance(unit)).unwrap();
        for (scalar, opacity) in [2.0, 5.0].into_iter().zip(ends) {
            let (tau, expected) = (table.eval(scalar).tau, -f64::ln_1p(-opacity) / unit);
            // A logarithm, a quotient and an interpolation, each rounded.
            assert!((tau - expected).abs() <= 4.0 * f64::EPSILON * expected, "{opacity}: {tau} instead of {expected}");
        }
    }
}
