//! Tests of the places of a joint table.

use super::*;
use crate::moments::{AxisScale, Bins, Histogram2d};
use crate::transfer::ensemble::Counts2d;
use crate::transfer::widget::Widget;
use crate::transfer::{ColorWeighting, Lengths, Polyline, PolylinePoint, Rectangle, Sample, Triangle};

/// Counts whose second axis has its positions as values.
struct Unit;

impl Counts2d for Unit {
    fn bins(&self) -> [usize; 2] {
        [4, 4]
    }

    fn count(&self, _: usize, _: usize) -> u64 {
        1
    }

    fn second_at(&self, position: f64) -> f64 {
        position
    }
}

fn context(counts: &dyn Counts2d) -> Context<'_> {
    Context {
        scalar_cov: Some(counts),
        ..Context::new((0.0, 1.0), (0.0, 1.0), OpacityKind::Alpha, Lengths::of_unit_distance(1.0))
    }
}

fn rectangle(y: [f64; 2]) -> Widget {
    Widget::Rectangle(Rectangle { x: [0.0, 1.0], y, rgb: [0.9, 0.4, 0.1], opacity: [0.5; 2] })
}

fn kept(space: Space, function: Function) -> Ensemble {
    let member = Member { space, reduction: Reduction::Keep, ..Member::new("kept", function) };
    Ensemble { name: "test".to_owned(), colors: ColorWeighting::Plain, members: vec![member] }
}

fn over_cov(text: &str) -> Ensemble {
    kept(Space::Cov, Function::TransferFunction(TransferFunction::parse(text).unwrap()))
}

fn rows(ensemble: &Ensemble) -> Vec<f64> {
    places(&[ensemble], Second::Cov, &context(&Unit)).unwrap().0
}

/// Checks a table against the values at the sample, at places that are not within a ramp of an edge.
fn check(ensemble: &Ensemble, edges: &[f64], tolerance: f64) -> f64 {
    let context = context(&Unit);
    let (table, judge) = (ensemble.joint_table(&context).unwrap(), ensemble.evaluator(&context).unwrap());
    let far = |cov: &f64| edges.iter().all(|edge| (cov - edge).abs() > 2.0 * GAP);
    let mut most = 0.0_f64;
    for cov in (0..=5000).map(|i| f64::from(i) / 5000.0).filter(far) {
        let ((rgb, value), node) = (judge.eval(&Sample { scalar: 0.9, gradient: 0.0, cov }), table.eval(0.9, cov, 0.0));
        let color = (0..3).map(|c| (rgb[c] - node.rgb[c]).abs()).fold(0.0, f64::max);
        let off = (1.0 - (-node.tau).exp() - value).abs().max(if value > 0.0 { color } else { 0.0 });
        assert!(off <= tolerance, "{cov}: {node:?} is not {rgb:?}, {value}");
        most = most.max(off);
    }
    most
}

#[test]
fn edges_next_to_each_other_or_to_a_place_are_not_lost() {
    let triangle = Triangle { base: [0.4, 0.1], top: 0.9, left: 0.1, right: 0.2, rgb: [0.2, 0.5, 0.9], opacity: 0.6 };
    for (widgets, edges) in [
        (vec![rectangle([0.1, 0.3]), rectangle([0.300_000_000_000_000_04, 0.9])], vec![0.1, 0.3, 0.9]),
        (vec![rectangle([1e-9, 1.0])], vec![1e-9]),
        (vec![Widget::Triangle(triangle), rectangle([0.750_000_000_000_000_1, 0.9])], vec![0.75, 0.9]),
        // Rectangles one before the other by less, and by more, than the place before an edge.
        (vec![rectangle([0.2, 0.5 - 0.3 * GAP]), rectangle([0.5, 0.6])], vec![0.2, 0.5, 0.6]),
        (vec![rectangle([0.2, 0.5 - 0.7 * GAP]), rectangle([0.5, 0.6])], vec![0.2, 0.5, 0.6]),
    ] {
        let one = kept(Space::ScalarCov, Function::Widgets(widgets));
        check(&one, &edges, JOINT_TOLERANCE);
        let context = context(&Unit);
        assert_eq!(one.joint_table(&context).unwrap().eval(0.3, 0.0, 0.0).tau, 0.0, "{one:?}");
    }
}

#[test]
fn points_of_colour_maps_are_places_only_where_these_bend_or_step() {
    for (text, most) in [("gray@0:0.1,1:0.4", 65), ("inferno@0:0.1,1:0.4", 111), ("viridis@0.8:0.1,0.95:0.3", 94)] {
        let one = over_cov(text);
        let count = rows(&one).len();
        // Opacity 0.4 is linear, extinction is not: 0.3^2 / 64^2 / 8 / 0.6 at most, far below the tolerance of colours.
        let off = check(&one, &[], 2.0 * JOINT_TOLERANCE);
        eprintln!("{text}: {count} rows, off by {off:.1e}");
        assert!((65..=most).contains(&count), "{text}: {count}");
    }
    for map in ["turbo", "vik", "batlow", "cividis", "plasma", "cool-to-warm"] {
        let one = over_cov(&format!("{map}@0:0.1,1:0.4"));
        eprintln!("{map}: {} rows, off by {:.1e}", rows(&one).len(), check(&one, &[], 2.0 * JOINT_TOLERANCE));
    }
}

#[test]
fn points_of_opacity_are_places_and_steps_are_two() {
    // A spike between two of the 64, and a step.
    let one = over_cov("gray@0:0,0.505:0,0.507:0.4,0.509:0,0.7:0,0.7:0.3,1:0.3");
    let covs = rows(&one);
    let near = |at: f64| covs.iter().filter(|cov| (**cov - at).abs() <= 2.0 * GAP).count();
    assert_eq!([0.505, 0.507, 0.509, 0.7].map(near), [1, 1, 1, 2]);
    check(&one, &[0.7], JOINT_TOLERANCE + 0.2_f64.powi(2));
    let point = |position: f64, opacity: f64| PolylinePoint { position, rgb: [0.4; 3], opacity };
    let points = vec![point(0.1, 0.2), point(0.407, 0.5), point(0.8, 0.1)];
    let line = kept(Space::Cov, Function::Widgets(vec![Widget::Polyline(Polyline { points })]));
    let covs = rows(&line);
    let near = |at: f64| covs.iter().filter(|cov| (**cov - at).abs() <= 2.0 * GAP).count();
    assert_eq!([0.1, 0.407, 0.8].map(near), [2, 1, 2]);
}

#[test]
fn a_series_of_one_step_has_one_row() {
    // No vertex has any variation: octaves over one value.
    let linear = Bins::new(Some([0.0, 1.0]), AxisScale::Linear, 256);
    let counts = Histogram2d::over(linear, Bins::new(Some([0.0, 0.0]), AxisScale::Octaves, 64));
    let context = context(&counts);
    let one = kept(Space::ScalarCov, Function::Widgets(vec![rectangle([0.0, 0.5]), rectangle([0.7, 0.8])]));
    let table = one.joint_table(&context).unwrap();
    assert_eq!(table.vertex_axis(), [0.0]);
    assert!((table.eval(0.5, 0.0, 0.0).tau - 2.0_f64.ln()).abs() < 1e-3);
    assert_eq!(over_cov("inferno@0:0.1,1:0.4").joint_table(&context).unwrap().vertex_axis(), [0.0]);
}
