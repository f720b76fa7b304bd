//! Tests of `transfer` across modules.

use tetreel::moments::Distribution;
use tetreel::node_table::Node;
use tetreel::transfer::{Lengths, OpacityKind, RangePolicy, TransferFunction, build_node_table, read_color_maps};

const PAGE: &str = include_str!("../../docs/transfer-functions.md");

/// Contents of the fenced blocks of a language.
fn blocks(language: &str) -> Vec<&'static str> {
    let fence = format!("```{language}\n");
    PAGE.split(fence.as_str()).skip(1).filter_map(|rest| rest.split("```").next()).collect()
}

#[test]
fn examples_of_tf_in_the_documentation_can_be_used() {
    let examples: Vec<&str> = PAGE.split("--tf '").skip(1).filter_map(|rest| rest.split('\'').next()).collect();
    assert!(examples.len() >= 4, "only {} examples found", examples.len());
    let range = RangePolicy::Series.resolve((-1.0, 1.0), (0.0, 0.0)).unwrap();
    for example in examples {
        let tf = TransferFunction::parse(example).unwrap_or_else(|e| panic!("{example}: {e}"));
        for kind in [OpacityKind::Alpha, OpacityKind::Extinction] {
            assert!(
                build_node_table(&tf, &range, kind, &Lengths::of_unit_distance(0.02)).unwrap().is_visible_in(-1.0, 1.0),
                "{example}"
            );
        }
    }
}

#[test]
fn files_in_the_documentation_can_be_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("example.json");
    let (mut maps, mut functions) = (0, 0);
    for block in blocks("json") {
        std::fs::write(&path, block).unwrap();
        if block.starts_with('[') {
            maps += read_color_maps(&path).unwrap().len();
        }
        TransferFunction::parse(path.to_str().unwrap()).unwrap();
        functions += 1;
    }
    assert_eq!((maps, functions), (1, 3));
}

#[test]
fn the_table_of_ranges_in_the_documentation_is_true() {
    let section = PAGE.split("## Range").nth(1).and_then(|s| s.split("## ").next()).unwrap();
    let rows: Vec<&str> = section.lines().filter(|l| l.starts_with("| `")).collect();
    assert_eq!(rows.len(), 8);
    let values = Distribution::new([(-2.0, 1.0), (0.5, 1.0), (5.0, 1.0)]);
    for row in rows {
        let text = row.split('`').nth(1).unwrap();
        let policy: RangePolicy = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
        policy.settled(&values).resolve((-2.0, 5.0), (0.0, 1.0)).unwrap();
    }
}

#[test]
fn maps_in_the_documentation_are_the_built_in_ones() {
    let section = PAGE.split("## Built-in maps").nth(1).and_then(|s| s.split("## ").next()).unwrap();
    let cells = section.lines().filter(|l| l.starts_with("| `")).filter_map(|l| l.split('|').nth(1));
    let mut named: Vec<&str> = cells.flat_map(|c| c.split('`').skip(1).step_by(2)).collect();
    let mut built_in: Vec<&str> = tetreel::transfer::ColorMap::built_in_names().collect();
    named.sort_unstable();
    built_in.sort_unstable();
    assert_eq!(named, built_in);
}

#[test]
fn one_transfer_function_serves_fields_of_any_magnitude() {
    let table = |tf: &str, lo: f64, hi: f64| {
        let range = RangePolicy::Series.resolve((lo, hi), (lo, hi)).unwrap();
        build_node_table(
            &TransferFunction::parse(tf).unwrap(),
            &range,
            OpacityKind::Alpha,
            &Lengths::of_unit_distance(1.0),
        )
        .unwrap()
    };
    let unit = table("vik@0:0.5,0.3:0,0.7:0,1:1", 0.0, 1.0);
    // Largest differences of opacity and of colour, where there is any opacity.
    let differences = |tf: &str, lo: f64, hi: f64| {
        let other = table(tf, lo, hi);
        (0..=1000).fold((0f64, 0f64), |worst, i| {
            let t = f64::from(i) / 1000.0;
            let (a, b): (Node, Node) = (unit.eval(t), other.eval(lo + t * (hi - lo)));
            let opacity = ((-a.tau).exp() - (-b.tau).exp()).abs();
            let colour = (0..3).map(|c| (a.rgb[c] - b.rgb[c]).abs()).fold(0.0, f64::max);
            (worst.0.max(opacity), worst.1.max(if a.tau == 0.0 { 0.0 } else { colour }))
        })
    };
    // Both tables have the same nodes but for the rounding of their scalars: of the last range, 1e6 2^-52 / 0.125 = 2e-9 of it, where
    // opacity and colours rise at most twenty times as fast. Measured: 3.9e-8.
    let bound = 2e-7;
    for (lo, hi) in [(1e-40, 1e-39), (-3e38, 3e38), (1e6, 1e6 + 0.125)] {
        let (opacity, colour) = differences("vik@0:0.5,0.3:0,0.7:0,1:1", lo, hi);
        assert!(opacity <= bound && colour <= bound, "{lo} {hi}: {opacity}, {colour}");
        let (opacity, _) = differences("vik@0:0.5,0.301:0,0.7:0,1:1", lo, hi);
        assert!(opacity > bound, "{lo} {hi}: a point that is off by a thousandth is not noticed: {opacity}");
        let (_, colour) = differences("viridis@0:0.5,0.3:0,0.7:0,1:1", lo, hi);
        assert!(colour > bound, "{lo} {hi}: another map is not noticed: {colour}");
    }
}
