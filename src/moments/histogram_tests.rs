//! Histograms against counting by the definition.

use super::{AxisScale, Bins, CountScale, Histogram1d, Histogram2d};
use proptest::prelude::*;

/// Index of a value's bin by the definition, over a range of integers, one bin after the other.
fn naive([lo, hi]: [i64; 2], n: i64, scale: AxisScale, value: i64) -> usize {
    if scale == AxisScale::Octaves {
        // Octave from 1 on, and position within it: bins between a value and the greatest.
        let place = |v: i64| n / 16 * i64::from(v.ilog2()) + (v - (1 << v.ilog2())) * n / 16 / (1 << v.ilog2());
        // The last bin of the quarter of an octave that the greatest is in.
        let last = place(hi) | (n / 64 - 1).max(0);
        let from_top = if value <= 0 { n - 1 } else { (last - place(value)).clamp(0, n - 1) };
        return (n - 1 - from_top) as usize;
    }
    (0..n).find(|bin| (value - lo) * n < (hi - lo) * (bin + 1)).unwrap_or(n - 1) as usize
}

fn of(range: [f32; 2], values: &[f32]) -> Histogram1d {
    let mut histogram = Histogram1d::new(Some(range));
    histogram.add(values);
    histogram
}

fn of_pairs(x: Bins, y: Bins, pairs: &[[f32; 2]]) -> Histogram2d {
    let mut histogram = Histogram2d::over(x, y);
    let [xs, ys] = [0, 1].map(|i| pairs.iter().map(|pair| pair[i]).collect::<Vec<_>>());
    histogram.add(&xs, &ys);
    histogram
}

fn scales() -> impl Strategy<Value = AxisScale> {
    prop_oneof![Just(AxisScale::Linear), Just(AxisScale::Octaves)]
}

fn whole_range() -> impl Strategy<Value = [i64; 2]> {
    (-5000_i64..5000, 1_i64..9000).prop_map(|(lo, width)| [lo, lo + width])
}

proptest! {
    #[test]
    fn every_value_is_in_the_bin_of_the_definition(
        range in whole_range(),
        values in prop::collection::vec(-10_000_i64..10_000, 0..200),
    ) {
        let floats: Vec<f32> = values.iter().map(|&v| v as f32).collect();
        let ours = of(range.map(|v| v as f32), &floats);
        let mut expected = vec![0; Histogram1d::BINS];
        values.iter().for_each(|&v| expected[naive(range, 256, AxisScale::Linear, v)] += 1);
        prop_assert_eq!(ours.counts(), &expected[..]);
        prop_assert_eq!(ours.finite(), values.len() as u64);
        // The test can fail: one value moved to the next bin shows.
        if let Some((first, rest)) = values.split_first() {
            let bin = naive(range, 256, AxisScale::Linear, *first);
            let other = if bin == 255 { bin - 1 } else { bin + 1 };
            let middle = (ours.bounds(other).unwrap()[0] + ours.bounds(other).unwrap()[1]) / 2.0;
            let moved: Vec<f32> = [middle as f32].into_iter().chain(rest.iter().map(|&v| v as f32)).collect();
            let moved = of(range.map(|v| v as f32), &moved);
            prop_assert_eq!(moved.finite(), ours.finite());
            prop_assert_ne!(moved.counts(), &expected[..]);
        }
    }

    #[test]
    fn every_pair_is_in_the_bin_of_the_definition_on_either_scale(
        ranges in prop::array::uniform2(whole_range()),
        scales in prop::array::uniform2(scales()),
        pairs in prop::collection::vec(prop::array::uniform2(-10_000_i64..10_000), 0..200),
        holes in prop::collection::vec(0_usize..200, 0..5),
    ) {
        // Octaves need positive values.
        let ranges = [0, 1].map(|i| if scales[i] == AxisScale::Linear { ranges[i] } else { [0, ranges[i][1].abs().max(1)] });
        let bins = |i: usize, count| Bins::new(Some(ranges[i].map(|v| v as f32)), scales[i], count);
        let mut floats: Vec<[f32; 2]> = pairs.iter().map(|pair| pair.map(|v| v as f32)).collect();
        let holes: std::collections::BTreeSet<usize> = holes.into_iter().filter(|&i| i < pairs.len()).collect();
        holes.iter().for_each(|&i| floats[i][i % 2] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i % 3]);
        let ours = of_pairs(bins(0, 256), bins(1, 64), &floats);
        let mut expected = vec![0; 256 * 64];
        for (_, pair) in pairs.iter().enumerate().filter(|(i, _)| !holes.contains(i)) {
            let y = naive(ranges[1], 64, scales[1], pair[1]);
            expected[y * 256 + naive(ranges[0], 256, scales[0], pair[0])] += 1;
        }
        prop_assert_eq!(ours.counts(), &expected[..]);
        prop_assert_eq!((ours.finite(), ours.nonfinite()), ((pairs.len() - holes.len()) as u64, holes.len() as u64));
        // The sums of columns are the counts of x alone.
        let mut across = Histogram1d::over(bins(0, 256));
        across.add(&floats.iter().filter(|p| p[1].is_finite()).map(|p| p[0]).collect::<Vec<_>>());
        let columns: Vec<u64> = (0..256).map(|x| ours.counts().iter().skip(x).step_by(256).sum()).collect();
        prop_assert_eq!(across.counts(), &columns[..]);
    }

    #[test]
    fn a_value_lies_within_the_bounds_of_its_bin_whatever_the_range(
        a: f32, b: f32, share in 0.0..=1.0_f64, scale in scales(), count in 1_usize..300, bits in 0_u32..5,
    ) {
        prop_assume!(a.is_finite() && b.is_finite() && a != b);
        let range = [a.min(b), a.max(b)];
        let [lo, hi] = range.map(f64::from);
        let value = ((lo + share * (hi - lo)) as f32).clamp(range[0], range[1]);
        let (range, value, count) = match scale {
            AxisScale::Linear => (range, value, count),
            AxisScale::Octaves => ([0.0, range[1].abs()], value.abs().min(range[1].abs()), 16 << bits),
        };
        let bins = Bins::new(Some(range), scale, count);
        let bin = bins.bin(value).unwrap();
        let [from, to] = bins.bounds(bin).unwrap();
        let value = f64::from(value);
        prop_assert!(from <= value && (value < to || bin + 1 == count && value <= to), "{value:e} in {from:e}..{to:e}");
        let along = bins.position(value as f32) * count as f64;
        // The quotient rounds, a few times by 2^-53 of at most 300 bins.
        let off = |along: f64| (bin as f64 - along).max(along - (bin as f64 + 1.0));
        prop_assert!(off(along) <= 1e-12, "{along} in bin {bin}");
        prop_assert!(off(along + 1.001).min(off(along - 1.001)) > 1e-12, "the places beside it are in other bins");
    }

    #[test]
    fn mirrored_values_have_mirrored_counts_if_the_range_is_symmetric(
        half in prop::num::f32::POSITIVE | prop::num::f32::SUBNORMAL,
        values in prop::collection::vec(any::<f32>(), 0..100),
        shares in prop::collection::vec(-1.0_f32..1.0, 0..100),
    ) {
        let half = half.abs().max(f32::MIN_POSITIVE * f32::EPSILON);
        let bins = Bins::new(Some([-half, half]), AxisScale::Linear, 256);
        prop_assert_eq!(bins.bounds(128).unwrap()[0], 0.0);
        let on_edge = |v: f32| (0..256).any(|bin| bins.bounds(bin).unwrap()[0] == f64::from(v));
        let values: Vec<f32> =
            values.into_iter().chain(shares.into_iter().map(|s| s * half)).filter(|&v| !on_edge(v)).collect();
        let mirrored: Vec<f32> = values.iter().map(|v| -v).collect();
        let [ours, theirs] = [&values, &mirrored].map(|values| of([-half, half], values));
        let counts: Vec<u64> = theirs.counts().iter().rev().copied().collect();
        prop_assert_eq!(ours.counts(), &counts[..]);
    }

    #[test]
    fn parts_together_are_the_whole(
        values in prop::collection::vec(prop::array::uniform2(any::<f32>()), 0..100), at in 0_usize..100,
    ) {
        let (a, b) = values.split_at(at.min(values.len()));
        let range = [-1e20, 1e30];
        let [xs, xs_a, xs_b] = [&values, a, b].map(|pairs| pairs.iter().map(|pair| pair[0]).collect::<Vec<_>>());
        let mut merged = of(range, &xs_a);
        merged.merge(&of(range, &xs_b));
        prop_assert_eq!(merged, of(range, &xs));
        let bins = || [Bins::new(Some(range), AxisScale::Linear, 7), Bins::new(Some([0.0, 3e38]), AxisScale::Octaves, 16)];
        let of = |pairs: &[[f32; 2]]| { let [x, y] = bins(); of_pairs(x, y, pairs) };
        let mut merged = of(a);
        merged.merge(&of(b));
        prop_assert_eq!(merged, of(&values));
    }
}

proptest! {
    #[test]
    fn octaves_that_were_widened_hold_what_wide_ones_count(
        values in prop::collection::vec(prop::array::uniform2(prop::num::f32::ANY), 0..60),
        small in prop::collection::vec(prop::array::uniform2(0.0_f32..100.0), 0..60),
        at in 0_usize..120,
    ) {
        let values: Vec<[f32; 2]> = values.into_iter().chain(small).map(|pair| pair.map(f32::abs)).collect();
        let most = |pairs: &[[f32; 2]], i: usize| {
            pairs.iter().map(|p| p[i]).filter(|v| v.is_finite()).reduce(f32::max).map(|top| [0.0, top])
        };
        let octaves = |range| Bins::new(range, AxisScale::Octaves, 64);
        let mut grown = Histogram2d::over(octaves(None), octaves(None));
        let mut one = Histogram1d::over(octaves(None));
        let (a, b) = values.split_at(at.min(values.len()));
        for part in [a, b] {
            let [xs, ys] = [0, 1].map(|i| part.iter().map(|pair| pair[i]).collect::<Vec<_>>());
            grown.widen(most(part, 0), most(part, 1));
            grown.add(&xs, &ys);
            one.widen(most(part, 0));
            one.add(&xs);
        }
        prop_assert_eq!(grown, of_pairs(octaves(most(&values, 0)), octaves(most(&values, 1)), &values));
        let mut whole = Histogram1d::over(octaves(most(&values, 0)));
        whole.add(&values.iter().map(|pair| pair[0]).collect::<Vec<_>>());
        prop_assert_eq!(one, whole);
    }
}

#[test]
fn a_linear_axis_is_not_widened() {
    let mut ours = of([0.0, 1.0], &[0.5]);
    let before = ours.clone();
    ours.widen(Some([0.0, 9.0]));
    assert_eq!(ours, before);
}

#[test]
fn next_to_nothing_on_either_side_of_zero_is_on_its_side_of_the_middle() {
    // The quotient by the definition rounds to one half for either.
    let ours = of([-1.0, 1.0], &[-1e-30, -1e-45, 1e-45, 0.0, -0.0, 1e-30]);
    assert_eq!(ours.counts()[127..129], [2, 4]);
}

#[test]
fn the_greatest_value_is_in_the_last_bin_whatever_the_range() {
    for range in [[0.0, 1.0], [f32::MIN, f32::MAX], [-0.3, 0.7], [1e-45, 3e-45], [1.0, 1.0_f32.next_up()]] {
        let histogram = of(range, &range);
        let counts = histogram.counts();
        assert_eq!((counts[0], counts[Histogram1d::BINS - 1]), (1, 1), "{range:?}");
        assert_eq!(histogram.bounds(Histogram1d::BINS - 1).unwrap()[1], f64::from(range[1]), "{range:?}");
    }
}

#[test]
fn a_range_of_one_value_or_none_has_one_bin() {
    let histogram = of([2.5, 2.5], &[2.5, 2.5, f32::NAN]);
    assert_eq!((histogram.counts()[0], histogram.finite(), histogram.nonfinite()), (2, 2, 1));
    assert_eq!(histogram.bounds(7), Some([2.5, 2.5]));
    let mut none = Histogram1d::new(None);
    none.add(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
    assert_eq!((none.finite(), none.nonfinite(), none.bounds(0)), (0, 3, None));
    let [x, y] = [Some([0.0, 0.0]), None].map(|range| Bins::new(range, AxisScale::Octaves, 16));
    assert_eq!(of_pairs(x, y, &[[0.0, 7.0], [-0.0, -1.0]]).counts()[0], 2);
}

#[test]
fn octaves_give_every_decade_room_down_to_the_first_bin() {
    let bins = Bins::new(Some([0.0, 100.0]), AxisScale::Octaves, 64);
    // 100 is in the third quarter of 64..128, 96..112, which is the last bin.
    assert_eq!(bins.bounds(63), Some([96.0, 112.0]));
    assert_eq!([111.9, 96.0, 95.9, 64.0, 63.9, 1.0].map(|v| bins.bin(v).unwrap()), [63, 63, 62, 61, 60, 37]);
    assert_eq!((bins.position(112.0), bins.position(88.0), bins.position(0.0)), (1.0, 62.5 / 64.0, 0.0));
    // 16 octaves below 112, in quarters.
    let least = 112.0 / 65536.0;
    assert_eq!(bins.bounds(0).unwrap()[0], 0.0);
    assert_eq!([0.0, -0.0, -7.0, 1e-45, least, 2.0 * least, 1e9].map(|v| bins.bin(v).unwrap()), [0, 0, 0, 0, 0, 4, 63]);
    for top in [f32::MAX, 2.0_f32.powi(127), 1.0, f32::MIN_POSITIVE, 1e-45, 0.0] {
        let bins = Bins::new(Some([0.0, top]), AxisScale::Octaves, 64);
        let ends = [0, 63].map(|bin| bins.bounds(bin).unwrap());
        assert!(ends[0][0] == 0.0 && ends[1][1] > f64::from(top) && ends[1][1].is_finite(), "{top:e}");
        assert_eq!(bins.bin(0.0), Some(0));
        let is_subnormal = top < 1e-33;
        assert!(is_subnormal || (bins.bin(top), ends[1][0] <= f64::from(top)) == (Some(63), true), "{top:e}");
    }
    assert_eq!(Bins::new(Some([0.0, f32::MAX]), AxisScale::Octaves, 64).bounds(63).unwrap()[1], 2.0_f64.powi(128));
    assert_eq!(Bins::new(Some([-9.0, -3.0]), AxisScale::Octaves, 16).range(), Some([0.0, 0.0]));
}

#[test]
fn positions_of_octaves_are_the_same_however_many_bins_there_are() {
    for top in [f32::MAX, 1.03, 2.0, 0.96, 100.0, 1e-37, 3e-39, 0.0] {
        let [few, many] = [64, 256].map(|count| Bins::new(Some([0.0, top]), AxisScale::Octaves, count));
        for at in (0..=100).map(|i| f64::from(i) / 100.0) {
            assert_eq!(few.value_at(at), many.value_at(at), "{top:e}");
        }
        assert_eq!(few.position(0.7 * top), many.position(0.7 * top), "{top:e}");
    }
}

proptest! {
    /// Counts up to the bin of the greatest value, by their definition.
    #[test]
    fn counts_up_to_the_bin_of_the_greatest_value_are_read(
        values in prop::collection::vec(prop_oneof![Just(0.0), 1e-7..1e-4_f32, 1e-3..9.0_f32], 1..200),
    ) {
        let top = values.iter().copied().fold(0.0, f32::max);
        let bins = Bins::new(Some([0.0, top]), AxisScale::Octaves, 256);
        let key = |v: f32| v.to_bits() >> (23 - 4);
        let first = (key(top) + 1).saturating_sub(256);
        let mut tight = vec![0; 256];
        values.iter().for_each(|&v| tight[(key(v).saturating_sub(first)) as usize] += 1);
        let mut expected = Histogram1d::over(bins.clone());
        expected.add(&values);
        let shown = Histogram1d::from_tight_counts(bins.clone(), tight.clone(), 0).unwrap();
        prop_assert_eq!(&shown, &expected);
        prop_assert!(bins.raised_by() == 0 || Histogram1d::from_counts(bins, tight, 0).unwrap() != shown || top == 0.0);
    }
}

#[test]
fn counts_are_drawn_as_shares_of_the_greatest_or_of_its_logarithm() {
    let counts = [0, 1, 99, 0, 9];
    assert_eq!(CountScale::Linear.heights(&counts), [0.0, 1.0 / 99.0, 1.0, 0.0, 1.0 / 11.0]);
    // ln 100 is twice ln 10; a quotient is rounded to f32.
    let log = CountScale::Log.heights(&counts);
    assert!((log[4] - 0.5).abs() <= f32::EPSILON && log[0] == 0.0 && log[2] == 1.0 && log[1] > 0.1);
    for scale in [CountScale::Linear, CountScale::Log] {
        assert_eq!(scale.heights(&[0, 0]), [0.0, 0.0]);
        assert!(scale.heights(&[]).is_empty());
        assert_eq!(scale.heights(&[u64::MAX, 1])[0], 1.0);
    }
}

#[test]
fn counts_that_were_written_down_come_back_if_there_is_one_a_bin() {
    let bins = |count| Bins::new(Some([-1.0, 3.0]), AxisScale::Linear, count);
    let one = of([-1.0, 3.0], &[0.0, 2.0, f32::NAN]);
    assert_eq!(Histogram1d::from_counts(bins(256), one.counts().to_vec(), 1), Some(one));
    assert_eq!(Histogram1d::from_counts(bins(256), vec![0; 255], 0), None);
    let two = of_pairs(bins(3), bins(2), &[[0.0, 1.0], [f32::NAN, 0.0]]);
    assert_eq!(Histogram2d::from_counts(bins(3), bins(2), two.counts().to_vec(), 1), Some(two));
    assert_eq!(Histogram2d::from_counts(bins(3), bins(2), vec![0; 5], 0), None);
}

proptest! {
    #[test]
    fn the_value_at_a_position_has_that_position(hi in prop_oneof![1e-30..1e30_f32, 0.5..2.0_f32], at in 0.0..=1.0_f64) {
        for (range, scale) in [([-hi, hi], AxisScale::Linear), ([0.0, hi], AxisScale::Octaves)] {
            let bins = Bins::new(Some(range), scale, 64);
            let value = bins.value_at(at) as f32;
            // Single precision has 2^-24 of the greatest value, and 2^-21 of a bin of octaves.
            prop_assert!((bins.position(value) - at).abs() <= 1e-6, "{scale:?}: {} for {at}", bins.position(value));
            let (below, above) = (bins.value_at(at - 0.01), bins.value_at(at + 0.01));
            prop_assert!(below <= f64::from(value) && f64::from(value) <= above);
        }
    }
}

#[test]
fn positions_of_an_axis_without_extent_all_have_its_value() {
    for scale in [AxisScale::Linear, AxisScale::Octaves] {
        assert_eq!([0.0, 0.3, 1.0].map(|at| Bins::new(None, scale, 16).value_at(at)), [0.0; 3]);
    }
    assert_eq!([0.0, 0.3, 1.0].map(|at| Bins::new(Some([2.5; 2]), AxisScale::Linear, 16).value_at(at)), [2.5; 3]);
    let none_varies = Bins::new(Some([0.0; 2]), AxisScale::Octaves, 64);
    assert_eq!([0.0, 0.3, 1.0].map(|at| none_varies.value_at(at)), [0.0; 3]);
}

#[test]
fn counts_between_scalars_are_those_of_the_bins_and_shares_of_them() {
    let mut histogram = Histogram1d::over(Bins::new(Some([0.0, 8.0]), AxisScale::Linear, 8));
    histogram.add(&[0.5, 1.5, 1.5, 3.5, 7.0, 8.0]);
    // Whole bins, and what is outside does not count.
    assert_eq!(histogram.between(&[0.0, 1.0, 2.0, 8.0]), [1.0, 2.0, 3.0]);
    assert_eq!(histogram.between(&[1.0, 2.0]), [2.0]);
    // Narrower than a bin, and across two.
    assert_eq!(histogram.between(&[1.0, 1.25, 1.5, 2.0]), [0.5, 0.5, 1.0]);
    assert_eq!(histogram.between(&[0.5, 1.5]), [0.5 + 1.0]);
    assert_eq!(histogram.between(&[]), [0.0; 0]);
    // A series of one value.
    let mut constant = Histogram1d::over(Bins::new(Some([3.0, 3.0]), AxisScale::Linear, 8));
    constant.add(&[3.0; 5]);
    assert_eq!(constant.between(&[2.0, 2.5, 3.5, 4.0]), [0.0, 5.0, 0.0]);
    assert_eq!(constant.between(&[4.0, 5.0]), [0.0]);
    // At an end of the scalars, and at an edge between two intervals.
    assert_eq!([[3.0, 4.0], [2.0, 3.0]].map(|ends| constant.between(&ends)), [[5.0], [5.0]]);
    assert_eq!(constant.between(&[2.0, 3.0, 4.0]), [0.0, 5.0]);
}
