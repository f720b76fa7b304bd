use super::*;
use crate::transfer::{
    COLOR_TOLERANCE, ColorMap, ColorPoint, DEPTH_SHARE, DEPTH_TOLERANCE, OpacityPoint, PositionKind,
};
use proptest::prelude::*;

/// Colour and opacity or depth by the definitions, without a profile or a table: the oracle.
fn formula(tf: &TransferFunction, range: &MappedRange, scalar: f64) -> ([f64; 3], f64) {
    let position = range.position_of(scalar);
    let x = if tf.positions() == PositionKind::Relative { position } else { scalar };
    let axis = |p: f64| if tf.positions() == PositionKind::Absolute && range.is_log() { p.ln() } else { p };
    let points = tf.points();
    let value = match points.iter().rposition(|p| p.position <= x) {
        None => points[0].value,
        Some(i) if i + 1 == points.len() => points[i].value,
        Some(i) => {
            let (a, b) = (points[i], points[i + 1]);
            a.value + (axis(x) - axis(a.position)) / (axis(b.position) - axis(a.position)) * (b.value - a.value)
        }
    };
    (tf.color_map().eval(position), value)
}

/// Largest error of a visible colour, and of an optical depth, relative to their tolerances; without errors that rounding of positions,
/// which moves colours and values by `slack`, explains.
fn errors(
    table: &NodeTable,
    tf: &TransferFunction,
    range: &MappedRange,
    (kind, lengths): (OpacityKind, Lengths),
    slack: [f64; 2],
    scalars: impl Iterator<Item = f64>,
) -> (f64, f64) {
    let units = lengths.longest_path / lengths.unit_distance;
    scalars.fold((0.0, 0.0), |(colour, depth): (f64, f64), s| {
        let (rgb, value) = formula(tf, range, s);
        let node = table.eval(s);
        let depth_of = |value: f64| match kind {
            OpacityKind::Alpha => (-(-value.clamp(0.0, 1.0)).ln_1p()).min(RAMP_DEPTH),
            OpacityKind::Extinction => value.max(0.0),
        };
        let found = node.tau * lengths.unit_distance;
        let (lowest, highest) = (depth_of(value - slack[1]), depth_of(value + slack[1]));
        // Beyond that a table is as opaque as can be seen.
        let highest = if kind == OpacityKind::Alpha && highest >= RAMP_DEPTH { f64::INFINITY } else { highest };
        let least = (0..3).map(|i| (node.rgb[i] - rgb[i]).abs()).fold(0.0, f64::max) - slack[0];
        let c = least.max(0.0) * (depth_of(value) * units).min(1.0) / (0.5 * COLOR_TOLERANCE);
        // The parts of the two tolerances: a path has places that use the one and places that use the other, and the parts add up to 1.
        let tolerance = (DEPTH_TOLERANCE / 16.0 / units).max(DEPTH_SHARE * 15.0 / 16.0 * lowest);
        let d = (lowest - found).max(found - highest).max(0.0) / tolerance;
        (colour.max(c), depth.max(d))
    })
}

/// 1 with a margin for rounding.
const WHOLE: f64 = 1.0 + 1e-6;

fn tf(text: &str) -> TransferFunction {
    TransferFunction::parse(text).unwrap()
}

fn unit_range() -> MappedRange {
    MappedRange::new(0.0, 1.0, false).unwrap()
}

fn table(text: &str, kind: OpacityKind) -> NodeTable {
    build_node_table(&tf(text), &unit_range(), kind, &Lengths::of_unit_distance(1.0)).unwrap()
}

#[test]
fn built_in_maps_need_no_more_nodes_than_they_have_points() {
    for name in ColorMap::built_in_names() {
        let table = |points: &str| table(&format!("{name}{points}"), OpacityKind::Alpha);
        let scalars = || (0..100_000).map(|i| f64::from(i) / 99_999.0);
        let tf = tf(&format!("{name}@0:0.1,1:0.1"));
        let measure = (OpacityKind::Alpha, Lengths::of_unit_distance(1.0));
        let error = |table: &NodeTable| errors(table, &tf, &unit_range(), measure, [1e-15; 2], scalars());
        let (found, nodes) = (error(&table("@0:0.1,1:0.1")), table("@0:0.1,1:0.1").nodes().len());
        assert!(found.0 <= WHOLE && found.1 <= WHOLE, "{name}: {found:?}");
        assert!(nodes <= tf.color_map().points().len(), "{name}: {nodes} nodes");
        // Another opacity is noticed, and the reversed map.
        let other = error(&table("_r@0:0.1,1:0.10001"));
        assert!(other.0 > 10.0 && other.1 > WHOLE, "{name}: {other:?}");
    }
    assert_eq!(table("gray@0:0.1,1:0.1", OpacityKind::Alpha).nodes().len(), 2);
}

#[test]
fn no_kink_is_dropped_and_little_opacity_is_followed_as_closely() {
    // The points of the first are within 2^-12 of a line, which over a path of 1000 unit distances is 0.2 of optical depth.
    for (text, lengths) in [
        ("viridis@0:0,0.1:0.002,0.2:0.0021,0.4:0.05,1:0.05", Lengths::new(1e-3, 1.0)),
        ("viridis@0:0,0.5:0.00002,1:0.0004", Lengths::new(1e-4, 1.0)),
        ("viridis@0:0,1:0.15", Lengths::new(1e-2, 1.0)),
        ("viridis@0:0,0.3:1e-9,0.6:5e-9,1:0", Lengths::new(0.1, 1.0)),
    ] {
        for kind in [OpacityKind::Alpha, OpacityKind::Extinction] {
            let tf = tf(text);
            let table = build_node_table(&tf, &unit_range(), kind, &lengths).unwrap();
            let scalars = (0..10_000).map(|i| f64::from(i) / 9999.0);
            let found = errors(&table, &tf, &unit_range(), (kind, lengths), [1e-15; 2], scalars);
            assert!(found.0 <= WHOLE && found.1 <= WHOLE, "{text}: {found:?}");
            for point in tf.points() {
                assert!(table.nodes().iter().any(|node| node.scalar == point.position), "{text}: {point:?}");
            }
        }
    }
}

#[test]
fn constant_opacity_costs_no_nodes() {
    // 0.1 (1 - f) + 0.1 f is not 0.1 for every f: rounding must not look like rise and fall.
    let (constant, rising) =
        (table("viridis@0:0.1,1:0.1", OpacityKind::Alpha), table("viridis@0:0,1:0.1", OpacityKind::Alpha));
    assert!(constant.nodes().len() <= rising.nodes().len());
    assert!(constant.nodes().iter().all(|n| n.tau == constant.nodes()[0].tau));
}

#[test]
fn a_ramp_to_opaque_is_refined_and_ends_finite() {
    let table = table("gray@0:0,0.5:1,1:0", OpacityKind::Alpha);
    let peak = table.eval(0.5).tau;
    assert_eq!(peak, RAMP_DEPTH);
    assert!(table.nodes().len() > 200 && table.nodes().len() < 2500, "{} nodes", table.nodes().len());
}

#[test]
fn a_plateau_of_one_is_opaque_from_its_first_point_to_its_last() {
    let table = table("gray@0:0,0.4:1,0.6:1,1:0", OpacityKind::Alpha);
    assert_eq!(table.eval(0.4).tau, OPAQUE_DEPTH);
    assert_eq!(table.eval(0.5).tau, OPAQUE_DEPTH);
    let steps = table.nodes().windows(2).filter(|n| n[0].scalar == n[1].scalar);
    let steps: Vec<_> = steps.map(|n| (n[0].scalar, n[0].tau, n[1].tau)).collect();
    assert_eq!(steps, [(0.4, RAMP_DEPTH, OPAQUE_DEPTH), (0.6, OPAQUE_DEPTH, RAMP_DEPTH)]);
}

#[test]
fn opacity_one_at_an_end_holds_on_outside() {
    let table = table("gray@0:1,0.2:0,0.8:0,1:1", OpacityKind::Alpha);
    assert_eq!((table.eval(-5.0).tau, table.eval(5.0).tau), (OPAQUE_DEPTH, OPAQUE_DEPTH));
    assert!(table.eval(0.999).tau <= RAMP_DEPTH && table.eval(0.001).tau <= RAMP_DEPTH);
    let all = super::build_node_table(
        &tf("gray@0:1,1:1"),
        &unit_range(),
        OpacityKind::Alpha,
        &Lengths::of_unit_distance(0.5),
    )
    .unwrap();
    assert_eq!(all.nodes().len(), 2);
    assert_eq!(all.eval(0.3).tau, OPAQUE_DEPTH / 0.5);
}

#[test]
fn narrow_and_low_spikes_are_kept() {
    for height in ["1", "0.5", "1e-5", "1e-12"] {
        let text = format!("viridis@0:0,0.7:0,0.7000001:{height},0.7000002:0,1:0");
        for kind in [OpacityKind::Alpha, OpacityKind::Extinction] {
            let table = table(&text, kind);
            assert!(table.is_visible_in(0.7, 0.7000002), "{height}");
            assert!(!table.is_visible_in(0.0, 0.7) && !table.is_visible_in(0.7000002, 1.0), "{height}");
            assert!(table.eval(0.7000001).tau > 0.0);
        }
    }
}

#[test]
fn steps_are_kept_with_both_sides() {
    let table = table("viridis@0:0,0.3:0,0.3:0.5,0.6:0.5,0.6:0,1:0", OpacityKind::Extinction);
    let nodes: Vec<(f64, f64)> = table.nodes().iter().map(|n| (n.scalar, n.tau)).collect();
    assert_eq!((nodes[0], nodes[1]), ((0.3, 0.0), (0.3, 0.5)));
    assert_eq!((nodes[nodes.len() - 2], nodes[nodes.len() - 1]), ((0.6, 0.5), (0.6, 0.0)));
    assert_eq!((table.eval(0.0).tau, table.eval(1.0).tau), (0.0, 0.0));
}

#[test]
fn intervals_without_opacity_have_no_inner_nodes() {
    let table = table("viridis@0:0,0.1:0.2,0.2:0,0.8:0,0.9:0.2,1:0", OpacityKind::Extinction);
    assert!(table.nodes().iter().all(|n| n.scalar <= 0.2 || n.scalar >= 0.8));
    let nothing = super::tests::table("viridis@0:0,1:0", OpacityKind::Alpha);
    assert_eq!((nothing.nodes().len(), nothing.is_visible_in(-1e9, 1e9)), (1, false));
}

#[test]
fn extinction_is_opacity_over_unit_distance_and_unbounded() {
    let t = build_node_table(
        &tf("gray@0:0,1:50"),
        &unit_range(),
        OpacityKind::Extinction,
        &Lengths::of_unit_distance(0.01),
    )
    .unwrap();
    assert_eq!(t.eval(0.5).tau, 2500.0);
    assert!(
        build_node_table(&tf("gray@0:0,1:50"), &unit_range(), OpacityKind::Alpha, &Lengths::of_unit_distance(0.01))
            .is_err()
    );
    let as_is = TransferFunction::new(
        ColorMap::built_in("gray").unwrap().clone(),
        vec![OpacityPoint { position: 2.0, value: 3.0 }],
        PositionKind::Absolute,
        OpacityValues::Extinction,
    );
    let t =
        build_node_table(&as_is.unwrap(), &unit_range(), OpacityKind::Alpha, &Lengths::of_unit_distance(0.25)).unwrap();
    assert_eq!((t.eval(0.0).tau, t.eval(9.0).tau), (3.0, 3.0));
}

#[test]
fn unit_distances_that_make_no_table_are_errors() {
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-305] {
        let result = build_node_table(&tf("gray"), &unit_range(), OpacityKind::Alpha, &Lengths::of_unit_distance(unit));
        assert!(matches!(result, Err(TransferError::BadUnitDistance(_))), "{unit}");
    }
    assert!(
        build_node_table(&tf("gray"), &unit_range(), OpacityKind::Alpha, &Lengths::of_unit_distance(1e-30)).is_ok()
    );
}

#[test]
fn positions_out_of_reach_of_a_logarithmic_range_are_errors() {
    let absolute = TransferFunction::new(
        ColorMap::built_in("gray").unwrap().clone(),
        vec![OpacityPoint { position: -1.0, value: 0.0 }, OpacityPoint { position: 5.0, value: 0.1 }],
        PositionKind::Absolute,
        OpacityValues::Opacity,
    )
    .unwrap();
    let log = MappedRange::new(1.0, 100.0, true).unwrap();
    let error =
        build_node_table(&absolute, &log, OpacityKind::Alpha, &Lengths::of_unit_distance(1.0)).unwrap_err().to_string();
    assert!(error.contains("point 0 (-1:0)"), "{error}");
}

fn color_map() -> impl Strategy<Value = ColorMap> {
    let point = (0.0..1.0, [0.0..=1.0, 0.0..=1.0, 0.0..=1.0]);
    let own = proptest::collection::vec(point, 1..12).prop_map(|mut points: Vec<_>| {
        points.sort_by(|a: &(f64, [f64; 3]), b| a.0.total_cmp(&b.0));
        let points = points.into_iter().map(|(position, rgb)| ColorPoint { position, rgb }).collect();
        ColorMap::new("random", points, None).unwrap()
    });
    let built_in = proptest::sample::select(ColorMap::built_in_names().collect::<Vec<_>>());
    prop_oneof![own, built_in.prop_map(|name| ColorMap::built_in(name).unwrap().clone())]
}

/// Opacity points with plateaus, steps, spikes, zeros and ones.
fn points() -> impl Strategy<Value = Vec<OpacityPoint>> {
    let position = prop_oneof![0.0..=1.0, Just(0.0), Just(0.5), Just(1.0), 0.5..=0.5000001];
    let value = prop_oneof![0.0..=1.0, Just(0.0), Just(1.0), 0.0..1e-6, 0.999..1.0];
    proptest::collection::vec((position, value), 1..10).prop_map(|mut points: Vec<_>| {
        points.sort_by(|a: &(f64, f64), b| a.0.total_cmp(&b.0));
        let mut kept: Vec<OpacityPoint> = Vec::new();
        for (position, value) in points {
            if kept.len() < 2 || kept[kept.len() - 2].position != position {
                kept.push(OpacityPoint { position, value });
            }
        }
        kept
    })
}

fn range() -> impl Strategy<Value = MappedRange> {
    proptest::sample::select(vec![
        MappedRange::new(0.0, 1.0, false).unwrap(),
        MappedRange::new(-3e38, 3e38, false).unwrap(),
        MappedRange::new(1e-40, 1e-39, false).unwrap(),
        MappedRange::new(1e9, 1e9 + 64.0, false).unwrap(),
        MappedRange::new(1e-3, 10.0, true).unwrap(),
        MappedRange::new(1e-40, 3e38, true).unwrap(),
        MappedRange::new(7.0, 7.5, true).unwrap(),
    ])
}

/// How far the position of a scalar may be off: a few roundings of the scalar, seen from the axis, and the least length of a line.
fn position_rounding(range: &MappedRange) -> f64 {
    let magnification = if range.is_log() {
        (range.lo().ln().abs() + range.hi().ln().abs() + 1.0) / (range.hi() / range.lo()).ln()
    } else {
        range.lo().abs().max(range.hi().abs()) / (range.hi() - range.lo())
    };
    (8.0 * f64::EPSILON + SHORTEST) * (1.0 + magnification)
}

/// Largest slope of a piecewise linear curve, steps aside.
fn steepest(points: impl Iterator<Item = (f64, [f64; 3])>) -> f64 {
    let points: Vec<_> = points.collect();
    let slope = |p: &[(f64, [f64; 3])]| {
        let rise = (0..3).map(|c| (p[1].1[c] - p[0].1[c]).abs()).fold(0.0, f64::max);
        if p[0].0 < p[1].0 { rise / (p[1].0 - p[0].0) } else { 0.0 }
    };
    points.windows(2).map(slope).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn tables_are_within_tolerance_of_the_formula(
        map in color_map(), points in points(), range in range(), unit in 1e-3..1e3, length in prop_oneof![Just(10.0), Just(100.0), Just(1e4)], gain in 1.0..1e4,
        random in proptest::collection::vec(-0.1..1.1, 50),
    ) {
        for kind in [OpacityKind::Alpha, OpacityKind::Extinction] {
            let scale = if kind == OpacityKind::Alpha { 1.0 } else { gain };
            let points: Vec<_> = points.iter().map(|p| OpacityPoint { value: p.value * scale, ..*p }).collect();
            let tf = TransferFunction::new(map.clone(), points.clone(), PositionKind::Relative, OpacityValues::Opacity).unwrap();
            let lengths = Lengths::new(unit, unit * length);
            let table = build_node_table(&tf, &range, kind, &lengths).unwrap();
            // Random places, and places evenly spread between each two nodes, where a line is farthest from its curve.
            let spread = table.nodes().windows(2).flat_map(|n| (1..8).map(|i| {
                let f = f64::from(i) / 8.0;
                n[0].scalar * (1.0 - f) + n[1].scalar * f
            }));
            // From a tenth of the axis below the range to a tenth above it.
            let end = |t: f64| if t < 0.0 { range.lo() } else { range.hi() };
            let outside = |t: f64| end(t) + (t - t.clamp(0.0, 1.0)) * (range.hi() - range.lo());
            let is_inside = |t: f64| (0.0..=1.0).contains(&t);
            let at_random = random.iter().map(|&t| if is_inside(t) { range.scalar_at(t) } else { outside(t) });
            // A scalar within rounding of a step may be taken for either side of it.
            let rounding = position_rounding(&range);
            let is_near_a_step = |s: f64| {
                let near = |q: f64| (range.position_of(s) - q).abs() <= rounding;
                points.iter().any(|p| near(p.position)) || map.points().iter().any(|p| near(p.position))
            };
            let scalars: Vec<f64> = at_random.chain(spread).filter(|&s| !is_near_a_step(s)).collect();
            // That these errors can be too large: `built_in_maps_need_no_more_nodes_than_they_have_points`.
            let colour_slope = steepest(map.points().iter().map(|p| (p.position, p.rgb)));
            let value_slope = steepest(points.iter().map(|p| (p.position, [p.value; 3])));
            let slack = [colour_slope, value_slope].map(|slope| slope * rounding + 1e-15 * scale);
            let (colour, depth) = errors(&table, &tf, &range, (kind, lengths), slack, scalars.into_iter());
            prop_assert!(colour <= WHOLE, "{kind:?} colour {colour}");
            prop_assert!(depth <= WHOLE, "{kind:?} depth {depth}");
        }
    }

    #[test]
    fn extinction_is_zero_exactly_where_the_formula_is(map in color_map(), points in points(), range in range()) {
        let tf = TransferFunction::new(map, points.clone(), PositionKind::Relative, OpacityValues::Opacity).unwrap();
        for kind in [OpacityKind::Alpha, OpacityKind::Extinction] {
            let table = build_node_table(&tf, &range, kind, &Lengths::of_unit_distance(1.0)).unwrap();
            for pair in points.windows(2).filter(|p| p[0].position + 1e-5 < p[1].position) {
                let inside = |f: f64| range.scalar_at(pair[0].position + f * (pair[1].position - pair[0].position));
                let expected = pair[0].value > 0.0 || pair[1].value > 0.0;
                prop_assert_eq!(table.is_visible_in(inside(0.1), inside(0.9)), expected);
            }
            for point in points.iter().filter(|p| p.value > 0.0) {
                let s = range.scalar_at(point.position);
                prop_assert!(table.is_visible_in(s, s), "the point at {} is lost", point.position);
            }
        }
    }

    #[test]
    fn steps_of_opacity_are_preserved(at in 0.01..0.99, low in 0.0..0.5, jump in 1e-6..0.4, range in range()) {
        let (a, b) = (OpacityPoint { position: at, value: low }, OpacityPoint { position: at, value: low + jump });
        let map = ColorMap::built_in("turbo").unwrap().clone();
        let tf = TransferFunction::new(map, vec![a, b], PositionKind::Relative, OpacityValues::Opacity).unwrap();
        let table = build_node_table(&tf, &range, OpacityKind::Extinction, &Lengths::of_unit_distance(1.0)).unwrap();
        let step = table.nodes().windows(2).find(|n| n[0].scalar == n[1].scalar).unwrap();
        prop_assert_eq!((step[0].scalar, step[0].tau, step[1].tau), (range.scalar_at(at), low, low + jump));
    }
}
