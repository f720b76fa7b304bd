//! Segments through a [`JointTable`] against thin slices, closed forms and the integrator for the scalar alone.

use super::super::exact::ExactTable;
use super::super::{Accumulator, Integrator};
use super::*;
use crate::node_table::{Node, NodeTable};
use proptest::prelude::*;

fn table(scalars: &[f64], rows: &[f64], layers: &[f64], value: impl Fn(usize, usize, usize) -> [f32; 4]) -> JointTable {
    let mut values = Vec::new();
    for k in 0..layers.len() {
        for j in 0..rows.len() {
            values.extend((0..scalars.len()).map(|i| value(i, j, k)));
        }
    }
    JointTable::new(scalars.to_vec(), rows.to_vec(), layers.to_vec(), values).unwrap()
}

/// A different value at each node, row and layer, some of them transparent.
fn mixed(i: usize, j: usize, k: usize) -> [f32; 4] {
    let of = |m: usize| ((i * 7 + j * 13 + k * 29 + 3) * m % 17) as f32 / 17.0;
    [of(2), of(3), of(5), 3.0 * (of(7) - 0.3).max(0.0)]
}

fn through(segment: &JointSegment, length: f64) -> ([f32; 4], u64) {
    let mut out = Accumulator::TRANSPARENT;
    let pieces = segment.composite(0.0, 1.0, length, &mut out);
    (out.pixel(), pieces)
}

/// Colour and opacity of many slices, each with the values in its middle.
fn in_slices(table: &JointTable, scalars: [f64; 2], values: [f64; 2], cell: f64, length: f64, slices: u32) -> [f64; 4] {
    let (mut rgba, mut transmittance) = ([0.0; 4], 1.0);
    for i in 0..slices {
        let u = (f64::from(i) + 0.5) / f64::from(slices);
        let at = |[near, far]: [f64; 2]| near + u * (far - near);
        let Node { rgb: [r, g, b], tau, .. } = table.eval(at(scalars), at(values), cell);
        let opacity = -(-tau * length / f64::from(slices)).exp_m1();
        let color = [r, g, b, 1.0];
        rgba = std::array::from_fn(|c| rgba[c] + transmittance * opacity * color[c]);
        transmittance *= 1.0 - opacity;
    }
    rgba
}

fn worst(a: [f32; 4], b: [f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max)
}

const AXIS: [f64; 4] = [-0.6, -0.1, 0.3, 0.9];
const LAYERS: [f64; 4] = [-0.5, 0.1, 0.1, 0.7];

/// Bound of the error of 20,000 slices. Between lines of the table the midpoint rule is exact for optical depths. Extinctions of up to 2.1
/// change within 0.4, 26 along a segment of 2.4 in both directions; of a kink, at which the slope changes by twice that, 4 long, a slice
/// leaves 52 / 20,000^2 / 8 x 4 = 6.5e-8, and there are a dozen at most. Pieces are rounded by 6e-8 each. Measured: 1.6e-7 over 3,000
/// segments.
const OF_SLICES: f64 = 2e-6;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn a_segment_is_the_sum_of_its_slices(ends in prop::array::uniform4(-1.2..1.2_f64), cell in -1.0..1.0_f64, length in 0.01..4.0_f64) {
        let table = table(&AXIS, &AXIS, &LAYERS, mixed);
        let (scalars, values) = ([ends[0], ends[1]], [ends[2], ends[3]]);
        let segment = JointSegment::new(&table, scalars, values, cell);
        let expected = in_slices(&table, scalars, values, cell, length, 20_000);
        let off = worst(through(&segment, length).0, expected);
        prop_assert!(off < OF_SLICES, "{off:e}");
    }

    #[test]
    fn parts_of_a_segment_add_up_to_it(ends in prop::array::uniform4(-1.2..1.2_f64), cut in 0.05..0.95_f64) {
        let table = table(&AXIS, &AXIS, &LAYERS, mixed);
        let segment = JointSegment::new(&table, [ends[0], ends[1]], [ends[2], ends[3]], 0.4);
        let mut parts = Accumulator::TRANSPARENT;
        segment.composite(0.0, cut, 2.0 * cut, &mut parts);
        segment.composite(cut, 1.0, 2.0 * (1.0 - cut), &mut parts);
        let whole = through(&segment, 2.0).0;
        // One piece more, rounded in f32.
        prop_assert!(worst(whole, parts.pixel().map(f64::from)) < 1e-6);
    }

    #[test]
    fn one_row_and_one_layer_are_a_table_of_the_scalar(s0 in -1.2..1.2_f64, s1 in -1.2..1.2_f64, value in -2.0..2.0_f64) {
        let scalars = [-0.6, -0.1, 0.3, 0.3, 0.9];
        let joint = table(&scalars, &[0.5], &[7.0], mixed);
        let node = |i: usize| {
            let [r, g, b, tau] = mixed(i, 0, 0).map(f64::from);
            Node { scalar: scalars[i], rgb: [r, g, b], tau }
        };
        let exact = ExactTable::new(&NodeTable::new((0..5).map(node).collect()).unwrap(), 1.0);
        let mut expected = Accumulator::TRANSPARENT;
        exact.segment(&mut exact.enter(s0), s0, s1, 1.7, &mut expected);
        let segment = JointSegment::new(&joint, [s0, s1], [value, -value], f64::NAN);
        // The same pieces, rounded in another order.
        prop_assert!(worst(through(&segment, 1.7).0, expected.pixel().map(f64::from)) < 1e-6);
        let share = segment.first_visible(0.0, 1.0).unwrap_or(1.0);
        prop_assert!((share - exact.transparent_share(s0, s1)).abs() < 1e-12, "{share}");
    }
}

#[test]
fn the_comparison_with_slices_notices_a_shift_along_each_axis() {
    let table = table(&AXIS, &AXIS, &LAYERS, mixed);
    let (scalars, values, cell) = ([-0.5, 0.7], [0.6, -0.2], 0.4);
    let here = through(&JointSegment::new(&table, scalars, values, cell), 1.5).0;
    let slices = |scalars, values, cell| worst(here, in_slices(&table, scalars, values, cell, 1.5, 20_000));
    assert!(slices(scalars, values, cell) < OF_SLICES);
    assert!(slices(scalars.map(|s| s + 1e-4), values, cell) > OF_SLICES);
    assert!(slices(scalars, values.map(|v| v + 1e-4), cell) > OF_SLICES);
    assert!(slices(scalars, values, cell + 1e-4) > OF_SLICES);
}

/// A table with extinction at one corner of a square, at scalar 1 and row 0.
fn corner() -> JointTable {
    table(&[0.0, 1.0], &[0.0, 1.0], &[0.0], |i, j, _| [1.0, 1.0, 1.0, if (i, j) == (1, 0) { 2.0 } else { 0.0 }])
}

/// The opacity of a segment of length 1.
fn alpha(table: &JointTable, scalars: [f64; 2], values: [f64; 2]) -> f64 {
    f64::from(through(&JointSegment::new(table, scalars, values, 0.0), 1.0).0[3])
}

#[test]
fn along_the_diagonal_and_above_it_a_corner_below_shows_nothing() {
    let table = corner();
    for (scalars, values) in [([0.0, 1.0], [0.0, 1.0]), ([1.0, 0.0], [1.0, 0.0]), ([0.2, 0.7], [0.3, 0.9])] {
        let segment = JointSegment::new(&table, scalars, values, 0.0);
        assert_eq!(through(&segment, 1.0), ([0.0; 4], 0), "{scalars:?} {values:?}");
        assert_eq!(segment.first_visible(0.0, 1.0), None);
    }
    // Below it extinction is twice the scalar less the row: from 0 to 1.2 on the second half.
    let segment = JointSegment::new(&table, [0.2, 0.8], [0.5, 0.2], 0.0);
    let crosses = 0.3 / 0.9;
    assert!((segment.first_visible(0.0, 1.0).unwrap() - crosses).abs() < 1e-15);
    let expected = -(-(1.0 - crosses) * 1.2 / 2.0_f64).exp_m1();
    let (rgba, pieces) = through(&segment, 1.0);
    assert!((f64::from(rgba[3]) - expected).abs() < 2e-7 && pieces == 1, "{rgba:?} {expected}");
}

#[test]
fn along_rows_and_columns_values_are_those_of_the_line() {
    let table = corner();
    let expected = |mean: f64| -(-mean).exp_m1();
    for (scalars, values, mean) in [
        ([0.0, 1.0], [0.0, 0.0], 1.0),
        ([1.0, 0.0], [0.0, 0.0], 1.0),
        ([1.0, 1.0], [0.0, 1.0], 1.0),
        ([1.0, 1.0], [0.0, 0.0], 2.0),
        ([0.0, 1.0], [1.0, 1.0], 0.0),
        ([0.0, 0.0], [0.0, 1.0], 0.0),
        // Beyond the ends of both axes.
        ([3.0, 9.0], [-5.0, -4.0], 2.0),
        ([-3.0, 1.0], [-5.0, -4.0], 0.25),
        ([1.0, 1.0], [-3.0, 5.0], (3.0 * 2.0 + 1.0) / 8.0),
    ] {
        let off = (alpha(&table, scalars, values) - expected(mean)).abs();
        // A rounding or two of f32 below 1.
        assert!(off < 2e-7, "{scalars:?} {values:?}: {off:e}");
    }
}

#[test]
fn a_step_has_its_upper_side_at_itself_and_the_side_that_a_segment_comes_from() {
    let table = table(&[0.0, 0.5, 0.5, 1.0], &[0.0], &[0.0, 1.0, 1.0, 2.0], |i, _, k| {
        [1.0, 1.0, 1.0, if i < 2 { 1.0 } else { 3.0 } * if k < 2 { 1.0 } else { 0.5 }]
    });
    let of = |scalars, cell| through(&JointSegment::new(&table, scalars, [0.0; 2], cell), 1.0).0[3];
    let is = |alpha: f32, depth: f64| (f64::from(alpha) + (-depth).exp_m1()).abs() < 2e-7;
    assert!(is(of([0.5, 0.5], 0.0), 3.0) && is(of([0.5, 0.9], 0.0), 3.0) && is(of([0.5, 0.1], 0.0), 1.0));
    assert!(is(of([0.9, 0.5], 0.0), 3.0) && is(of([0.1, 0.5], 0.0), 1.0) && is(of([0.0, 1.0], 0.0), 2.0));
    // Layers: at the step the upper one, beyond the ends the outermost ones, for NaN the lowest.
    assert!(is(of([0.1, 0.1], 1.0), 0.5) && is(of([0.1, 0.1], 0.999), 1.0) && is(of([0.1, 0.1], 9.0), 0.5));
    for cell in [f64::NAN, f64::NEG_INFINITY, -1e300] {
        assert!(is(of([0.1, 0.1], cell), 1.0), "{cell}");
    }
    assert!(is(of([0.1, 0.1], f64::INFINITY), 0.5));
}

#[test]
fn tiny_and_huge_axes_have_the_values_of_others() {
    for unit in [4e-310, 1e-30, 1e30, 8e307] {
        let axis = [-unit, unit];
        let plane = |i: usize, j: usize, _| [1.0, 1.0, 1.0, (i + j) as f32];
        let table = table(&axis, &axis, &[0.0], plane);
        // The mean extinction over a straight line is that in its middle.
        for (scalars, values, mean) in [
            ([-unit, unit], [-unit, unit], 1.0),
            ([-unit, unit], [unit, 0.0], 1.25),
            ([0.0, 0.0], [0.0, 0.0], 1.0),
            ([unit, -unit], [0.0, 0.5 * unit], 1.125),
        ] {
            let off = (alpha(&table, scalars, values) + f64::exp_m1(-mean)).abs();
            assert!(off < 2e-7, "{unit:e}: {off:e}");
        }
    }
}

#[test]
fn the_largest_extinctions_and_the_longest_segments_are_opaque_and_finite() {
    let table = table(&[0.0, 1.0], &[0.0, 1.0], &[0.0], |i, _, _| [0.25, 0.5, 1.0, f32::MAX * i as f32]);
    for length in [1e-30, 1.0, 1e30, f64::from(f32::MAX)] {
        let (rgba, _) = through(&JointSegment::new(&table, [0.5, 1.0], [0.2, 0.7], 0.0), length);
        assert!(rgba.iter().all(|c| c.is_finite()) && (rgba[3] - 1.0).abs() < 1e-6, "{length:e}: {rgba:?}");
        assert!((rgba[0] - 0.25).abs() < 1e-6 && (rgba[2] - 1.0).abs() < 1e-6, "{length:e}: {rgba:?}");
    }
    // Segments of the least length, and of none.
    let (rgba, _) = through(&JointSegment::new(&corner(), [0.5, 1.0], [0.0, 0.0], 0.0), 1e-300);
    assert_eq!(rgba[3], 0.0);
}
