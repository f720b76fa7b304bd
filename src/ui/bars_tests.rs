//! Columns and images against the histograms they are of.

use super::*;
use crate::moments::AxisScale;
use proptest::prelude::*;

fn linear(lo: f64, hi: f64) -> MappedRange {
    MappedRange::new(lo, hi, false).unwrap()
}

fn logarithmic(lo: f64, hi: f64) -> MappedRange {
    MappedRange::new(lo, hi, true).unwrap()
}

fn of_values(range: [f32; 2], scale: AxisScale, values: &[f32]) -> Histogram1d {
    let mut histogram = Histogram1d::over(Bins::new(Some(range), scale, 256));
    histogram.add(values);
    histogram
}

/// Counts that grow from 1 to 65,536 over 0..=1.
fn slope() -> Histogram1d {
    let counts = (1..=256_u64).map(|i| i * i).collect();
    Histogram1d::from_counts(Bins::new(Some([0.0, 1.0]), AxisScale::Linear, 256), counts, 3).unwrap()
}

/// Counts of pairs over 0..=1 and four octaves.
fn pairs() -> Histogram2d {
    let mut histogram = Histogram2d::over(
        Bins::new(Some([0.0, 1.0]), AxisScale::Linear, 256),
        Bins::new(Some([0.0, 7.0]), AxisScale::Octaves, 64),
    );
    let xs: Vec<f32> = (0..5000).map(|i| (i % 97) as f32 / 96.0).collect();
    let ys: Vec<f32> = (0..5000).map(|i| 7.0 * ((i % 89) as f32 / 88.0).powi(3)).collect();
    histogram.add(&xs, &ys);
    histogram
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
}

fn assert_near(a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(b).all(|(&a, &b)| near(a, b)), "{a:?} {b:?}");
}

#[test]
fn the_identity_gives_the_plain_picture() {
    let (histogram, identity, range) = (slope(), RangeMap::default(), linear(0.0, 1.0));
    let plain: Vec<f64> = histogram.counts().iter().map(|&count| count as f64).collect();
    for axis in [DrawnAxis::Bins(&RangeMap::default()), DrawnAxis::Values(&range, &identity)] {
        let bars = columns(&histogram, axis, 256);
        assert_near(&bars.counts, &plain);
        assert!(near(bars.outside, 0.0));
        let heights = CountScale::Log.heights(histogram.counts());
        assert!(bars.heights.iter().zip(&heights).all(|(a, b)| (a - b).abs() < 1e-6));
        // Half as many pixels have sums, twice as many the same heights.
        let sums: Vec<f64> = plain.chunks(2).map(|pair| pair.iter().sum()).collect();
        assert_near(&columns(&histogram, axis, 128).counts, &sums);
        let wide = columns(&histogram, axis, 512);
        assert!(wide.heights.iter().zip(0..).all(|(a, i)| (a - bars.heights[i / 2]).abs() < 1e-6));
    }
    let stretched = RangeMap::new(&[[0.5, 0.25]]).unwrap();
    let bars = columns(&histogram, DrawnAxis::Values(&range, &stretched), 256);
    assert!(!near(bars.counts[0], plain[0]), "the test can fail");
}

#[test]
fn a_stretched_part_has_a_lower_density_and_the_same_area() {
    let histogram = of_values([0.0, 1.0], AxisScale::Linear, &[0.1; 800]);
    let (map, range) = (RangeMap::new(&[[0.25, 0.75]]).unwrap(), linear(0.0, 1.0));
    // Bins are 3 times as wide as before on three quarters of 1024 pixels: 12 pixels instead of 4.
    let bars = columns(&histogram, DrawnAxis::Values(&range, &map), 1024);
    let filled: Vec<f64> = bars.counts.iter().copied().filter(|&count| count > 1e-9).collect();
    assert!(near(filled.iter().sum(), 800.0) && (12..=13).contains(&filled.len()), "{filled:?}");
    assert!(near(filled[5], 800.0 / 12.0));
}

#[test]
fn an_equalised_histogram_is_level() {
    let (histogram, range) = (slope(), linear(0.0, 1.0));
    let mean = histogram.finite() as f64 / 64.0;
    let steepest = |map: &RangeMap| {
        let counts = columns(&histogram, DrawnAxis::Values(&range, map), 64).counts;
        counts.into_iter().map(|count| (count / mean - 1.0).abs()).fold(0.0, f64::max)
    };
    // The map is within 1/512 of the equalised positions at both ends of a column of 1/64, and spreads 1/256 of the axis evenly.
    let (plain, equalised) = (steepest(&RangeMap::default()), steepest(&RangeMap::equalised(histogram.counts())));
    assert!(equalised < 64.0 * 2.0 / 512.0 + 0.05 && plain > 1.5, "{equalised} {plain}");
}

#[test]
fn heights_grow_with_counts_and_a_single_value_is_visible() {
    let mut values = vec![0.5; 1_000_000];
    values.extend([0.1, 0.9, 0.9]);
    // Four bins a pixel.
    let bars = columns(&of_values([0.0, 1.0], AxisScale::Linear, &values), DrawnAxis::Bins(&RangeMap::default()), 64);
    let mut order: Vec<usize> = (0..64).collect();
    order.sort_by(|&a, &b| bars.counts[a].total_cmp(&bars.counts[b]));
    assert!(order.windows(2).all(|pair| bars.heights[pair[0]] <= bars.heights[pair[1]]));
    let full: Vec<f32> = order[61..].iter().map(|&i| bars.heights[i]).collect();
    assert!(full[0] > 0.01 && full[0] < full[1] && full[2] == 1.0 && bars.heights[order[60]] == 0.0, "{full:?}");
}

#[test]
fn what_a_range_leaves_out_is_outside() {
    let (histogram, identity) = (slope(), RangeMap::default());
    for (lo, hi) in [(0.25, 0.5), (-1.0, 0.5), (0.75, 3.0), (2.0, 3.0)] {
        let range = linear(lo, hi);
        let bars = columns(&histogram, DrawnAxis::Values(&range, &identity), 77);
        let inside: u64 =
            (0..256).filter(|&i| i as f64 >= 256.0 * lo && (i as f64) < 256.0 * hi).map(|i| (i + 1) * (i + 1)).sum();
        assert!(near(bars.counts.iter().sum(), inside as f64), "{lo} {hi}");
        assert!(near(bars.outside, (histogram.finite() - inside) as f64));
    }
    let none = columns(&histogram, DrawnAxis::Bins(&RangeMap::default()), 0);
    assert!(none.counts.is_empty() && none.outside == histogram.finite() as f64);
}

#[test]
fn extreme_ranges_are_drawn() {
    let (identity, values) = (RangeMap::default(), [1e-30_f32, 1e-10, 1.0, 1e30]);
    let (octaves, range) = (of_values([0.0, 1e30], AxisScale::Octaves, &values), logarithmic(1e-30, 2e30));
    for (range, outside) in [(range, 1e-6), (linear(0.0, 2e30), 1e-6)] {
        let bars = columns(&octaves, DrawnAxis::Values(&range, &identity), 300);
        assert!(bars.counts.iter().all(|count| count.is_finite()) && bars.outside < outside, "{bars:?}");
        assert!(bars.heights.iter().all(|height| (0.0..=1.0).contains(height)));
    }
    // One decade in five pixels: where the greatest value is drawn.
    let bars = columns(&octaves, DrawnAxis::Values(&logarithmic(1e-30, 1e30), &identity), 300);
    assert!(bars.counts[299] > 0.1 && bars.counts[..290].iter().sum::<f64>() < 3.1);
    let linear_bins = of_values([1e-30, 1e30], AxisScale::Linear, &values);
    assert_eq!(columns(&linear_bins, DrawnAxis::Bins(&RangeMap::default()), 256).counts[0], 3.0);
}

#[test]
fn a_histogram_of_one_value_or_none_is_drawn() {
    let identity = RangeMap::default();
    let one = of_values([2.5; 2], AxisScale::Linear, &[2.5; 7]);
    for (range, at) in [(linear(2.0, 3.0), 50), (linear(2.5, 3.0), 0), (linear(1.5, 2.5), 99)] {
        let bars = columns(&one, DrawnAxis::Values(&range, &identity), 100);
        assert_eq!((bars.counts[at], bars.heights[at], bars.outside), (7.0, 1.0, 0.0), "{range:?}");
    }
    assert_eq!(columns(&one, DrawnAxis::Values(&linear(3.0, 4.0), &identity), 9).outside, 7.0);
    assert_eq!(columns(&one, DrawnAxis::Bins(&RangeMap::default()), 256).counts[0], 7.0);
    let mut holes = Histogram1d::new(None);
    holes.add(&[f32::NAN; 5]);
    for axis in [DrawnAxis::Bins(&RangeMap::default()), DrawnAxis::Values(&linear(0.0, 1.0), &identity)] {
        let bars = columns(&holes, axis, 50);
        assert!(bars.counts.iter().all(|&c| c == 0.0) && bars.heights.iter().all(|&h| h == 0.0) && bars.outside == 0.0);
    }
}

#[test]
fn an_image_has_the_columns_of_its_rows_and_its_top_is_the_high_end() {
    let (histogram, map, range) = (pairs(), RangeMap::new(&[[0.3, 0.6]]).unwrap(), linear(0.0, 1.0));
    let x = DrawnAxis::Values(&range, &map);
    let bars = image(&histogram, [x, DrawnAxis::Bins(&RangeMap::default())], [100, 64]);
    for (row, counts) in histogram.counts().chunks(256).enumerate() {
        let row_alone = Histogram1d::from_counts(histogram.x().clone(), counts.to_vec(), 0).unwrap();
        assert_near(&bars.counts[(63 - row) * 100..][..100], &columns(&row_alone, x, 100).counts);
    }
    assert!(near(bars.counts.iter().sum(), 5000.0) && bars.heights.contains(&1.0));
    // Twice as many pixels each way: four times the pixels with a quarter of the counts, and the same shades.
    let small = image(&histogram, [DrawnAxis::Bins(&RangeMap::default()); 2], [256, 64]);
    let large = image(&histogram, [DrawnAxis::Bins(&RangeMap::default()); 2], [512, 128]);
    for (i, &shade) in large.heights.iter().enumerate() {
        let of = (i / 512 / 2) * 256 + i % 512 / 2;
        assert!((shade - small.heights[of]).abs() < 1e-6 && near(4.0 * large.counts[i], small.counts[of]));
    }
    assert_eq!(image(&histogram, [DrawnAxis::Bins(&RangeMap::default()); 2], [0, 5]).counts.len(), 0);
    assert_eq!(image(&histogram, [DrawnAxis::Bins(&RangeMap::default()); 2], [5, 0]).outside, 5000.0);
}

proptest! {
    #[test]
    fn counts_are_conserved_whatever_the_map_and_the_width(
        values in prop::collection::vec(1e-3..1e3_f32, 1..200),
        points in prop::collection::btree_map(1..99_u32, 1..99_u32, 0..5),
        width in 1..600_usize,
        log in any::<bool>(),
    ) {
        let mut ys: Vec<u32> = points.values().copied().collect();
        ys.sort_unstable();
        ys.dedup();
        let inner: Vec<[f64; 2]> =
            points.keys().zip(ys).map(|(&x, y)| [f64::from(x) / 100.0, f64::from(y) / 100.0]).collect();
        let map = RangeMap::new(&inner).unwrap();
        let (lo, hi) = values.iter().fold((f32::MAX, 0.0_f32), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        let histogram = of_values([lo, hi], AxisScale::Linear, &values);
        if lo < hi {
            let range = MappedRange::new(f64::from(lo), f64::from(hi), log).unwrap();
            let bars = columns(&histogram, DrawnAxis::Values(&range, &map), width);
            prop_assert!((bars.counts.iter().sum::<f64>() - values.len() as f64).abs() < 1e-6, "{bars:?}");
            prop_assert!(bars.counts.iter().all(|&count| count >= 0.0));
        }
        let native = columns(&histogram, DrawnAxis::Bins(&RangeMap::default()), width).counts.iter().sum::<f64>();
        prop_assert!((native - values.len() as f64).abs() < 1e-6);
    }
}
