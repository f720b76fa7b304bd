//! Tables over several axes against the values at the sample.

use super::*;
use crate::transfer::ensemble::{Function, Member, Reduction, Space};
use crate::transfer::opacity::OpacityKind;
use crate::transfer::widget::{GAP, Widget};
use crate::transfer::{
    Blend, ColorWeighting, JOINT_TOLERANCE, Lengths, Polyline, PolylinePoint, Rectangle, Sample, TransferFunction,
    Triangle,
};
use proptest::prelude::*;

/// Counts whose second axis has its positions, times a factor, as values.
struct Unit(f64);

impl super::super::Counts2d for Unit {
    fn bins(&self) -> [usize; 2] {
        [4, 4]
    }

    fn count(&self, _: usize, _: usize) -> u64 {
        1
    }

    fn second_at(&self, position: f64) -> f64 {
        self.0 * position
    }
}

const UNIT: Unit = Unit(1.0);

fn context() -> Context<'static> {
    let (gradient, cov) = (Some(&UNIT as _), Some(&UNIT as _));
    Context {
        scalar_gradient: gradient,
        scalar_cov: cov,
        ..Context::new((0.0, 1.0), (0.0, 1.0), OpacityKind::Alpha, Lengths::of_unit_distance(1.0))
    }
}

fn ensemble(members: Vec<Member>) -> Ensemble {
    Ensemble { name: "test".to_owned(), colors: ColorWeighting::Plain, members }
}

fn kept(space: Space, widgets: Vec<Widget>) -> Member {
    Member { space, reduction: Reduction::Keep, ..Member::new("kept", Function::Widgets(widgets)) }
}

fn rectangle(x: [f64; 2], y: [f64; 2], opacity: [f64; 2]) -> Widget {
    Widget::Rectangle(Rectangle { x, y, rgb: [0.9, 0.4, 0.1], opacity })
}

/// Places spread evenly over the cube (a generalised golden ratio in each direction).
fn samples(count: usize) -> impl Iterator<Item = Sample> {
    let at = |i: usize, ratio: f64| (0.5 + ratio * i as f64).fract();
    (0..count).map(move |i| Sample {
        scalar: at(i, 0.819_172_513_396),
        gradient: at(i, 0.671_043_606_703),
        cov: at(i, 0.549_700_477_901),
    })
}

/// Errors of a table at samples that are `far`: the largest and the mean one of opacity, and the largest of colours where opacity is above
/// a hundredth.
fn errors(table: &JointTable, judge: &Ensemble, far: impl Fn(&Sample) -> bool) -> [f64; 3] {
    let context = context();
    let judge = judge.evaluator(&context).unwrap();
    let (mut count, mut max, mut sum, mut color) = (0, 0.0_f64, 0.0, 0.0_f64);
    for sample in samples(3000).filter(far) {
        let ((rgb, value), node) = (judge.eval(&sample), table.eval(sample.scalar, sample.cov, sample.gradient));
        let off = (1.0 - (-node.tau).exp() - value).abs();
        (count, max, sum) = (count + 1, max.max(off), sum + off);
        if value > 0.01 {
            color = (0..3).map(|c| (rgb[c] - node.rgb[c]).abs()).fold(color, f64::max);
        }
    }
    assert!(count > 1000, "{count} samples are left");
    [max, sum / f64::from(count), color]
}

/// Whether a sample is farther from all edges than a ramp is wide; along the scalar, tables have true steps.
fn is_far(edges: &[f64]) -> impl Fn(&Sample) -> bool {
    |sample| {
        edges.iter().all(|e| [sample.scalar, sample.gradient, sample.cov].iter().all(|x| (x - e).abs() > 2.0 * GAP))
    }
}

fn extent() -> impl Strategy<Value = [f64; 2]> {
    (0_u16..1024, 1_u16..=1024).prop_map(|(a, w)| [f64::from(a), f64::from((a + w).min(1024))].map(|x| x / 1024.0))
}

fn random_member(space: Space) -> impl Strategy<Value = Member> {
    let widget = (extent(), extent(), [0.0..=0.9_f64, 0.0..=0.9]).prop_map(|(x, y, opacity)| rectangle(x, y, opacity));
    let blend = prop::sample::select(vec![Blend::Add, Blend::And, Blend::Xor]);
    (prop::collection::vec(widget, 1..4), blend, 0.2..=1.0_f64).prop_map(move |(widgets, blend, weight)| Member {
        blend,
        weight,
        ..kept(space, widgets)
    })
}

fn edges_of(ensemble: &Ensemble) -> Vec<f64> {
    let widgets = ensemble.members.iter().flat_map(|member| match &member.function {
        Function::Widgets(widgets) => &widgets[..],
        Function::TransferFunction(_) => &[],
    });
    widgets.flat_map(Widget::handles).flatten().collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Between their edges rectangles are constant along the second axis, and lines are taken at the edges: the only errors are those of
    /// the lines' tables ([`JOINT_TOLERANCE`]) and of f32 (2^-22 for as many operations). A wrong table, of the same ensemble without its
    /// last widget, is farther off.
    #[test]
    fn rectangles_are_as_exact_as_on_the_scalar(
        scalar in random_member(Space::Scalar), gradient in random_member(Space::ScalarGradient),
        cov in random_member(Space::ScalarCov), tf in 0.1..0.9_f64,
    ) {
        let line = TransferFunction::parse(format!("viridis@0:0,{tf}:0.5,1:0.1")).unwrap();
        let plain = Member { blend: Blend::Add, ..Member::new("line", Function::TransferFunction(line)) };
        let all = ensemble(vec![scalar, gradient, plain, cov]);
        let table = all.joint_table(&context()).unwrap();
        let edges = edges_of(&all);
        let [max, _, color] = errors(&table, &all, is_far(&edges));
        prop_assert!(max <= JOINT_TOLERANCE + 1e-6 && color <= JOINT_TOLERANCE + 1e-6, "{max:e}, {color:e}");
        let mut other = all.clone();
        other.members.push(kept(Space::ScalarCov, vec![rectangle([0.0, 1.0], [0.2, 0.6], [0.3, 0.5])]));
        let [max, ..] = errors(&table, &other, is_far(&edges));
        prop_assert!(max > 0.01, "{max:e}");
    }
}

#[test]
fn what_changes_gradually_is_followed_in_sixty_four_steps() {
    let triangle = |rgb| Triangle { base: [0.4, 0.1], top: 0.9, left: 0.1, right: 0.8, rgb, opacity: 0.6 };
    let boundary = kept(Space::ScalarGradient, vec![Widget::TriangleWithFallOff(triangle([0.2, 0.5, 0.9]))]);
    let flat = kept(Space::ScalarCov, vec![Widget::Triangle(triangle([0.9, 0.3, 0.1]))]);
    let points = [(0.0, 0.0), (0.3, 0.5), (1.0, 0.1)];
    let points = points.map(|(position, opacity)| PolylinePoint { position, rgb: [0.4; 3], opacity }).to_vec();
    let along = kept(Space::Cov, vec![Widget::Polyline(Polyline { points })]);
    // Greatest and mean error of opacity. Sides of a triangle move by up to 0.4 / 0.8 / 64 of the axis from line to line: where
    // there is a step, up to 0.6 of opacity is elsewhere in a strip of half that width, 0.006 of all samples at two sides (measured:
    // 0.5; 1.8e-3). With fall-off it is steepest near the base, where a whole rise lies between two lines (9.8e-2; 1.4e-4).
    // The polyline is linear, but opacity is not extinction: (0.5 / 0.3 / 64)^2 / 8 / 0.5 beside the tolerance (1.6e-4; 3.0e-5).
    for (member, [max, mean]) in
        [(boundary, [0.2, 3e-4]), (flat, [0.61, 4e-3]), (along, [JOINT_TOLERANCE + 2e-4, 6e-5])]
    {
        let one = ensemble(vec![member]);
        let table = one.joint_table(&context()).unwrap();
        let edges = edges_of(&one);
        let [most, middle, _] = errors(&table, &one, is_far(&edges));
        eprintln!("{:?}: opacity off by {most:.1e}, on average {middle:.1e}", one.members[0].space);
        assert!(most <= max && middle <= mean);
        // Moved by three lines.
        let mut other = one.clone();
        if let Function::Widgets(widgets) = &mut other.members[0].function {
            widgets.iter_mut().for_each(|w| *w = w.shifted([0.05, 0.05]));
        }
        if other != one {
            let [_, shifted, _] = errors(&table, &other, is_far(&edges));
            assert!(shifted > mean, "{shifted:e}");
        }
    }
}

#[test]
fn an_ensemble_that_keeps_no_axis_is_a_table_over_the_scalar() {
    let mut reduced = kept(Space::ScalarGradient, vec![rectangle([0.2, 0.8], [0.3, 0.6], [0.1, 0.4])]);
    reduced.reduction = Reduction::Intensity;
    let one = ensemble(vec![reduced]);
    assert!(!one.keeps_axes());
    let (table, curve) = (
        one.joint_table(&context()).unwrap(),
        one.curve(&context()).unwrap().line_of_joint_table(&Lengths::of_unit_distance(1.0)).unwrap(),
    );
    assert_eq!((table.vertex_axis().len(), table.cell_axis().len()), (1, 1));
    assert_eq!(table.scalars(), curve.nodes().iter().map(|n| n.scalar).collect::<Vec<_>>());
    for (i, node) in curve.nodes().iter().enumerate() {
        let [r, g, b] = node.rgb.map(|c| c as f32);
        assert_eq!(table.value(i, 0, 0), [r, g, b, node.tau as f32]);
    }
    // A disabled member does not count.
    let off = Member { enabled: false, ..kept(Space::Cov, vec![]) };
    assert!(!ensemble(vec![off]).keeps_axes());
}

#[test]
fn of_two_ensembles_on_different_spaces_there_is_one_table() {
    let gradient = ensemble(vec![kept(Space::ScalarGradient, vec![rectangle([0.2, 0.7], [0.3, 1.0], [0.3; 2])])]);
    let cov = ensemble(vec![kept(Space::ScalarCov, vec![rectangle([0.1, 0.6], [0.0, 0.5], [0.5; 2])])]);
    let context = context();
    let between = |f: f64| {
        let mix = |line: &Line| {
            let [a, b] = [&gradient, &cov].map(|e| e.curve_on(&context, line).unwrap());
            Curve::mix(&a, &b, f, ColorWeighting::Plain)
        };
        joint_table(&[&gradient, &cov], &context, mix).unwrap()
    };
    for (f, whole) in [(0.0, &gradient), (1.0, &cov)] {
        let [max, _, color] = errors(&between(f), whole, is_far(&edges_of(whole)));
        assert!(max <= JOINT_TOLERANCE + 1e-6 && color <= JOINT_TOLERANCE + 1e-6, "{max:e}, {color:e}");
    }
    let at = |scalar: f64, gradient: f64, cov: f64| 1.0 - (-between(0.25).eval(scalar, cov, gradient).tau).exp();
    let near = |a: f64, b: f64| assert!((a - b).abs() <= JOINT_TOLERANCE, "{a} is not {b}");
    near(at(0.4, 0.6, 0.2), 0.75 * 0.3 + 0.25 * 0.5);
    near(at(0.4, 0.1, 0.2), 0.25 * 0.5);
    near(at(0.65, 0.6, 0.2), 0.75 * 0.3);
}

#[test]
fn axes_without_extent_or_histogram() {
    let one = ensemble(vec![kept(Space::ScalarCov, vec![rectangle([0.0, 1.0], [0.0, 0.5], [0.3; 2])])]);
    // All values are alike, at position 0.
    let flat = Context { scalar_cov: Some(&Unit(0.0)), ..context() };
    let table = one.joint_table(&flat).unwrap();
    assert_eq!(table.vertex_axis(), [0.0]);
    assert!((table.eval(0.5, 7.0, 0.0).tau + 0.7_f64.ln()).abs() < 1e-3);
    let without = Context { scalar_cov: None, ..context() };
    assert!(one.joint_table(&without).unwrap_err().to_string().contains("'kept': has no histogram"));
    let none = ensemble(vec![]).joint_table(&context()).unwrap();
    assert_eq!((none.vertex_axis().len(), none.eval(0.3, 0.0, 0.0).tau), (1, 0.0));
}

#[test]
fn too_many_scalars_become_steps_near_to_where_they_were() {
    let node = |scalar: f64, tau: f64| Node { scalar, rgb: [0.5; 3], tau };
    let saw: Vec<Node> = (0..1000).map(|i| node(f64::from(i), f64::from(i % 2))).collect();
    let table = NodeTable::new(saw).unwrap();
    let columns = columns_of(std::slice::from_ref(&table), 40);
    let scalars: Vec<f64> = columns.iter().flat_map(Column::scalars).collect();
    assert!(scalars.len() <= 40 && scalars.len() > 30, "{}", scalars.len());
    assert!(scalars.windows(3).all(|w| w[0] < w[2]), "at most two at a place");
    // Of each run of teeth the left side is that of the first one's foot, and the right side a tip.
    let values: Vec<f32> = columns.iter().flat_map(|c| c.values(&table)).map(|v| v[3]).collect();
    assert_eq!(values, [0.0, 1.0].repeat(20));
    let step = NodeTable::new(vec![node(0.0, 1.0), node(5.0, 1.0), node(5.0, 2.0), node(9.0, 3.0)]).unwrap();
    let columns = columns_of(std::slice::from_ref(&step), 100);
    let values: Vec<f32> = columns.iter().flat_map(|c| c.values(&step)).map(|v| v[3]).collect();
    assert_eq!(values, [1.0, 1.0, 2.0, 3.0]);
    assert_eq!(columns.iter().flat_map(Column::scalars).collect::<Vec<_>>(), [0.0, 5.0, 5.0, 9.0]);
}

/// A shell narrower than a run of scalars is kept, wherever it lies in its run and in whichever table.
#[test]
fn nothing_that_is_seen_is_lost_where_scalars_become_one() {
    let node = |scalar: f64, tau: f64| Node { scalar, rgb: [tau / 8.0; 3], tau };
    let transparent: Vec<Node> = (0..=300).map(|i| node(f64::from(i), 0.0)).collect();
    for at in 1..300 {
        let points = [(0, 0.0), (at - 1, 0.0), (at, 7.0), (at + 1, 0.0), (300, 0.0)];
        let mut shell = points.map(|(scalar, tau)| node(f64::from(scalar), tau)).to_vec();
        shell.dedup_by(|next, kept| next.scalar == kept.scalar);
        let tables = [transparent.clone(), shell].map(|nodes| NodeTable::new(nodes).unwrap());
        let columns = columns_of(&tables, 20);
        let [none, seen] = tables.each_ref().map(|table| {
            let nodes = columns.iter().flat_map(|column| std::iter::zip(column.scalars(), column.values(table)));
            nodes.filter(|(_, value)| value[3] > 0.0).collect::<Vec<_>>()
        });
        assert!(none.is_empty());
        let [(scalar, value)] = seen[..] else { panic!("{at}: {seen:?}") };
        assert_eq!(value, [0.875, 0.875, 0.875, 7.0], "{at}");
        // No farther off than a run of 301 / 10 is long.
        assert!((scalar - f64::from(at)).abs() <= 30.0, "{at}: {scalar}");
    }
}

/// The members of an ensemble whose second axes make a table of many lines, and of a narrow shell over the scalar.
fn shell_among_lines() -> Ensemble {
    let line = |text: &str| Function::TransferFunction(TransferFunction::parse(text).unwrap());
    let shell = Member::new("shell", line("gray@0:0,0.5:0,0.502:0.9,0.504:0,1:0"));
    let on_cov = Member {
        space: Space::Cov,
        reduction: Reduction::Keep,
        ..Member::new("inferno", line("inferno@0.8:0,0.95:0.3"))
    };
    let triangle = Triangle { base: [0.4, 0.1], top: 0.9, left: 0.1, right: 0.8, rgb: [0.2, 0.5, 0.9], opacity: 0.6 };
    let boundary = kept(Space::ScalarGradient, vec![Widget::TriangleWithFallOff(triangle)]);
    ensemble(vec![shell, on_cov, boundary])
}

#[test]
fn a_narrow_shell_is_seen_in_a_table_of_many_lines() {
    let all = shell_among_lines();
    let table = all.joint_table(&context()).unwrap();
    eprintln!(
        "{} scalars, {} rows, {} layers",
        table.scalars().len(),
        table.vertex_axis().len(),
        table.cell_axis().len()
    );
    assert!(table.values().len() <= MOST_VALUES);
    assert!(table.projection().is_visible_in(0.5001, 0.5039));
    // Where there is no other member.
    let tau = |scalar: f64| table.eval(scalar, 0.1, 0.05).tau;
    assert!((tau(0.502) + 0.1_f64.ln()).abs() < 0.1, "{}", tau(0.502));
    assert_eq!((tau(0.4), tau(0.6)), (0.0, 0.0));
}

#[test]
fn tables_of_too_many_lines_are_an_error_that_says_what_to_do() {
    let widgets = |y: fn(usize) -> [f64; 2]| (0..400).map(|i| rectangle([0.0, 1.0], y(i), [0.1; 2])).collect();
    let extents = |i: usize| [i as f64 / 500.0, (i as f64 + 0.5) / 500.0];
    let both = ensemble(vec![kept(Space::ScalarGradient, widgets(extents)), kept(Space::ScalarCov, widgets(extents))]);
    let text = both.joint_table(&context()).unwrap_err().to_string();
    assert!(text.contains("1599 places of the coefficient") && text.contains("reduce members"), "{text}");
}
