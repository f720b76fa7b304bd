use super::*;
use crate::transfer::{Function, Member, build_node_table};

fn source(text: &str, kind: OpacityKind, range: MappedRange) -> TransferSource {
    let content = TransferContent::Function { function: TransferFunction::parse(text).unwrap(), range };
    TransferSource { content, kind, lengths: Lengths::new(0.5, 50.0) }
}

fn unit_range() -> MappedRange {
    MappedRange::new(0.0, 1.0, false).unwrap()
}

#[test]
fn opacities_are_of_a_unit_distance_and_extinctions_as_they_are() {
    let alpha = source("gray@0:0,1:0.5", OpacityKind::Alpha, unit_range());
    let formula = alpha.formula().unwrap();
    let (rgb, tau) = formula.eval(0.25);
    // A logarithm, a quotient and a line: some roundings.
    assert!((tau - -(0.875_f64.ln()) / 0.5).abs() < 1e-15 && (rgb[0] - 0.25).abs() < 1e-15, "{rgb:?} {tau}");
    let extinction = source("gray@0:0,1:0.5", OpacityKind::Extinction, unit_range());
    assert_eq!(extinction.formula().unwrap().eval(0.5).1, 0.5);
    let opaque = source("gray@0:1,1:1", OpacityKind::Alpha, unit_range());
    assert_eq!(opaque.formula().unwrap().eval(0.5).1, f64::INFINITY);
}

#[test]
fn every_point_of_map_and_curve_is_a_knot() {
    let log = MappedRange::new(0.01, 100.0, true).unwrap();
    let source = source("gray@0:0,0.25:0.1,0.5:0,1:0.3", OpacityKind::Alpha, log);
    let knots = source.formula().unwrap().knots().to_vec();
    assert_eq!(knots.len(), 4, "{knots:?}");
    assert!(knots.is_sorted() && (knots[1] - 0.1).abs() < 1e-15 && knots[3] == 100.0, "{knots:?}");
}

#[test]
fn blended_functions_are_those_of_both_ensembles() {
    let ensemble = |text: &str| {
        let function = Function::TransferFunction(TransferFunction::parse(text).unwrap());
        Ensemble { members: vec![Member::new("m", function)], ..Ensemble::default() }
    };
    let blended = |weighting| BlendedEnsembles {
        ensemble: ensemble("gray@0:0.2,1:0.2"),
        toward: Some((ensemble("gray_r@0:0.6,1:0.6"), 0.25)),
        colors: weighting,
        series: (0.0, 1.0),
        step: (0.0, 1.0),
    };
    let eval = |weighting| {
        let content = TransferContent::Ensembles(Box::new(blended(weighting)));
        let source = TransferSource { content, kind: OpacityKind::Extinction, lengths: Lengths::new(1.0, 100.0) };
        let (rgb, tau) = source.formula().unwrap().eval(0.25);
        (rgb[0], tau)
    };
    // 3/4 of the one and 1/4 of the other: 0.15 + 0.15, and colours 0.25 and 0.75, weighted by these halves or not.
    let near = |a: (f64, f64), b: (f64, f64)| assert!((a.0 - b.0).abs() + (a.1 - b.1).abs() < 1e-15, "{a:?} {b:?}");
    near(eval(ColorWeighting::Plain), (0.375, 0.3));
    near(eval(ColorWeighting::Opacity), (0.5, 0.3));
    assert!(blended(ColorWeighting::Plain).is_of_scalars());
}

#[test]
fn lengths_that_make_no_table_make_no_formula() {
    for (unit, longest) in [(0.0, 1.0), (1.0, 0.0), (1.0, f64::NAN), (f64::INFINITY, 1.0), (1e-305, 1.0)] {
        let bad =
            TransferSource { lengths: Lengths::new(unit, longest), ..source("gray", OpacityKind::Alpha, unit_range()) };
        assert!(bad.formula().is_err(), "{unit} {longest}");
        let tf = TransferFunction::parse("gray").unwrap();
        assert!(build_node_table(&tf, &unit_range(), OpacityKind::Alpha, &bad.lengths).is_err(), "{unit} {longest}");
    }
}

#[test]
fn colours_alone_are_those_of_the_formula_also_where_it_is_clear() {
    let log = MappedRange::new(0.01, 100.0, true).unwrap();
    for (text, range) in [
        ("viridis@0:0,0.4:0,0.5:0.3,1:0", unit_range()),
        ("turbo@0:0,1:0", log),
        ("cool-to-warm@0:0,0.5:1,1:0", MappedRange::new(-3.0, 5.0, false).unwrap()),
    ] {
        let source = source(text, OpacityKind::Alpha, range);
        let formula = source.formula().unwrap();
        let colors = formula.colors().unwrap();
        let (first, last) = (formula.knots()[0], formula.knots()[formula.knots().len() - 1]);
        let mut worst = 0.0_f64;
        for i in 0..=20_000 {
            let scalar = first + f64::from(i) / 20_000.0 * 1.02 * (last - first);
            let (a, b) = (colors.eval(scalar).rgb, formula.eval(scalar).0);
            worst = (0..3).map(|c| (a[c] - b[c]).abs()).fold(worst, f64::max);
        }
        // Halving checks the middle and the quarters.
        assert!(worst <= crate::transfer::COLOR_TOLERANCE, "{text}: {worst:.1e}");
        assert!(colors.nodes().iter().all(|node| node.tau == 0.0));
        // The table of what is seen has other colours where nothing is.
        let table = build_node_table(
            &TransferFunction::parse(text).unwrap(),
            match &source.content {
                TransferContent::Function { range, .. } => range,
                TransferContent::Ensembles(_) => unreachable!(),
            },
            OpacityKind::Alpha,
            &Lengths::new(0.5, 50.0),
        );
        let (table, at) = (table.unwrap(), first + 0.2 * (last - first));
        let off = (0..3).map(|c| (table.eval(at).rgb[c] - formula.eval(at).0[c]).abs()).fold(0.0, f64::max);
        assert!(text.starts_with("cool") || off > 1e-2, "{text}: {off}");
    }
}
