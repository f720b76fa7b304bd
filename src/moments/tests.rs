use super::*;

/// Two passes in f64 over the finite samples of one vertex: mean, variance, count.
fn two_pass(samples: impl Iterator<Item = f32>) -> (f64, f64, f64) {
    let finite: Vec<f64> = samples.filter(|v| v.is_finite()).map(f64::from).collect();
    let n = finite.len() as f64;
    let mean = finite.iter().sum::<f64>() / n;
    (mean, finite.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n, n)
}

/// A fixed pseudo-random sequence in [-1, 1): a multiplicative congruence, enough for tests.
fn noise(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed | 1;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}

fn moments_of(steps: &[Vec<f32>]) -> Moments {
    let mut moments = Moments::new(steps.first().map_or(0, Vec::len));
    for step in steps {
        moments.add_step(step);
    }
    moments
}

/// The series of one vertex.
fn single(samples: &[f32]) -> Moments {
    moments_of(&samples.iter().map(|&v| vec![v]).collect::<Vec<_>>())
}

/// How many means and variances are not those of two passes. `scale` is the largest magnitude among the samples: each of the n
/// updates rounds the mean by at most an ulp of it, so the mean is within n ulps, and the variance within the corresponding product.
fn wrong(statistics: &VertexStatistics, steps: &[Vec<f32>], scale: f64) -> [usize; 2] {
    let slack = 4.0 * steps.len() as f64 * f64::EPSILON;
    let mut wrong = [0; 2];
    for vertex in 0..statistics.mean.len() {
        let (mean, variance, count) = two_pass(steps.iter().map(|s| s[vertex]));
        assert_eq!(statistics.finite_count[vertex], count);
        if count == 0.0 {
            assert!(statistics.mean[vertex].is_nan() && statistics.variance[vertex].is_nan());
            continue;
        }
        let bound = slack * scale * (variance.sqrt() + slack * scale) + slack * variance;
        let is_close = |a: f64, b: f64, bound: f64| (a - b).abs() <= bound;
        wrong[0] += usize::from(!is_close(statistics.mean[vertex], mean, slack * scale));
        wrong[1] += usize::from(!is_close(statistics.variance[vertex], variance, bound));
    }
    wrong
}

/// Checks against two passes, and that a sample of each vertex that is off by a thousandth of the scale is noticed.
fn check(steps: &[Vec<f32>], scale: f64) {
    assert_eq!(wrong(&moments_of(steps).vertex_statistics(), steps, scale), [0; 2]);
    let mut other = steps.to_vec();
    other[steps.len() - 1].iter_mut().for_each(|v| *v += 1e-3 * scale as f32);
    assert_eq!(wrong(&moments_of(&other).vertex_statistics(), steps, scale), [steps[0].len(); 2]);
}

#[test]
fn one_pass_agrees_with_two_passes() {
    let mut next = noise(7);
    let steps: Vec<Vec<f32>> = (0..97).map(|_| (0..1000).map(|_| next()).collect()).collect();
    check(&steps, 1.0);
}

#[test]
fn a_huge_offset_does_not_drown_a_small_signal() {
    let steps: Vec<Vec<f32>> = (0..64).map(|t| vec![1e9, 1e9 + 64.0 * (t % 2) as f32]).collect();
    check(&steps, 1e9 + 64.0);
    let statistics = moments_of(&steps).vertex_statistics();
    assert_eq!(statistics.variance[0], 0.0);
    // Half of the samples 64 above the others: the deviation is 32. `wrong` allows 1.8e-3 of the variance.
    assert!((statistics.variance[1].sqrt() - 32.0).abs() < 3e-5);
    let cov = statistics.coefficient_of_variation(None, CovDenominator::Plain);
    assert_eq!(cov[0], 0.0);
    // The deviation's 3e-5 of 32, and 32 of 1e9, by which the mean is larger.
    assert!((cov[1] / (32.0 / 1e9) - 1.0).abs() < 1e-6, "{:e}", cov[1]);
    // The mean of the squares less the square of the mean: 1024 is what is left of two numbers of 1e18, which have a bit for 128.
    let naive = |vertex: usize| {
        let mean = |f: fn(f64) -> f64| steps.iter().map(|s| f(f64::from(s[vertex]))).sum::<f64>() / steps.len() as f64;
        mean(|x| x * x) - mean(|x| x).powi(2)
    };
    assert!((naive(1) - 1024.0).abs() >= 32.0, "{}", naive(1));
    // One pass in f32 does not even find the mean.
    let sum = steps.iter().fold(0.0f32, |sum, s| sum + s[1]);
    assert!((f64::from(sum) / steps.len() as f64 - (1e9 + 32.0)).abs() > 32.0);
}

#[test]
fn constants_have_exactly_no_variance() {
    for value in [0.0, -0.0, 0.1, 1e9, f32::MAX, f32::MIN_POSITIVE, 1e-45, -3.3e-7] {
        let statistics = single(&[value; 360]).vertex_statistics();
        assert_eq!(statistics.variance[0], 0.0, "{value:e}");
        assert_eq!(statistics.mean[0], f64::from(value), "{value:e}");
    }
}

#[test]
fn nan_and_infinity_are_kept_out_and_counted() {
    let mut next = noise(3);
    let mut steps: Vec<Vec<f32>> = (0..50).map(|_| (0..40).map(|_| next()).collect()).collect();
    steps[4][7] = f32::NAN;
    steps[5][7] = f32::INFINITY;
    steps[0][0] = f32::NEG_INFINITY;
    check(&steps, 1.0);
    let moments = moments_of(&steps);
    assert_eq!(moments.series().nonfinite, 3);
    assert_eq!(moments.steps()[4].nonfinite, 1);
    assert!(moments.series().range.is_some_and(|[lo, hi]| lo >= -1.0 && hi <= 1.0));
}

#[test]
fn a_vertex_that_is_never_finite_has_no_mean_and_no_importance() {
    let moments = moments_of(&[vec![f32::NAN, 1.0], vec![f32::INFINITY, 2.0]]);
    let statistics = moments.vertex_statistics();
    assert!(statistics.mean[0].is_nan() && statistics.variance[0].is_nan());
    assert_eq!(statistics.finite_count, [0.0, 2.0]);
    let cov = statistics.coefficient_of_variation(moments.series().range, CovDenominator::default());
    assert_eq!(cov[0], 0.0);
    // Two quotients below 1, rounded.
    assert!((cov[1] - 0.5 / 1.5).abs() <= f64::EPSILON);
}

#[test]
fn a_step_without_a_finite_value_has_no_range() {
    let moments = moments_of(&[vec![1.0, 2.0], vec![f32::NAN, f32::INFINITY]]);
    assert_eq!(moments.steps()[1], StepSummary { range: None, nonfinite: 2 });
    assert_eq!(moments.series(), StepSummary { range: Some([1.0, 2.0]), nonfinite: 2 });
    assert_eq!(moments_of(&[vec![f32::NAN]]).series().range, None);
}

#[test]
fn no_step_and_no_vertex_are_no_error() {
    assert_eq!(Moments::new(3).series(), StepSummary::EMPTY);
    assert_eq!(moments_of(&[vec![], vec![]]).series(), StepSummary::EMPTY);
    assert!(Moments::new(0).vertex_statistics().mean.is_empty());
}

#[test]
fn extremes_of_the_format_neither_overflow_nor_vanish() {
    let statistics = single(&[f32::MAX, f32::MIN]).vertex_statistics();
    assert_eq!(statistics.mean[0], 0.0);
    assert_eq!(statistics.variance[0].sqrt(), f64::from(f32::MAX));
    let tiny = f32::from_bits(1); // the smallest denormal
    let statistics = single(&[tiny, -tiny]).vertex_statistics();
    assert_eq!(statistics.variance[0].sqrt(), f64::from(tiny));
}

#[test]
fn negative_zero_is_below_zero_in_any_order() {
    for step in [[0.0, -0.0], [-0.0, 0.0]] {
        let range = StepSummary::of(&step).range.unwrap().map(f32::to_bits);
        assert_eq!(range, [(-0.0f32).to_bits(), 0.0f32.to_bits()]);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mut next = noise(11);
    // Not a multiple of the chunk length.
    let steps: Vec<Vec<f32>> = (0..5).map(|_| (0..3 * CHUNK + 17).map(|_| next()).collect()).collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let moments = pool.install(|| moments_of(&steps));
        let statistics = moments.vertex_statistics();
        let bits = |v: Vec<f64>| v.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        (bits(statistics.mean), bits(statistics.variance), moments.steps().to_vec())
    };
    assert_eq!(run(1), run(4));
    let expected: Vec<StepSummary> = steps.iter().map(|s| StepSummary::of(s)).collect();
    assert_eq!(run(3).2, expected);
}

#[test]
fn the_floor_tames_a_zero_mean_and_the_plain_formula_does_not() {
    let moments = moments_of(&[vec![1.0, 5.0, -100.0, 0.0], vec![-1.0, 5.0, 100.0, 0.0]]);
    let statistics = moments.vertex_statistics();
    let range = moments.series().range;
    let floored = statistics.coefficient_of_variation(range, CovDenominator::default());
    // Range 200, floor 2: deviation 1 over 2.
    assert_eq!(floored, [0.5, 0.0, 50.0, 0.0]);
    let plain = statistics.coefficient_of_variation(range, CovDenominator::Plain);
    assert_eq!(plain, [f64::INFINITY, 0.0, f64::INFINITY, 0.0]);
}

#[test]
fn statistics_that_were_written_down_go_on_within_the_bound_of_one_pass() {
    let mut next = noise(11);
    let mut sample = |step: usize, v: usize| match v {
        0 => 3.25,
        1 if step < 40 => f32::NAN,
        2 if step % 7 == 3 => f32::INFINITY,
        3 => f32::NAN,
        _ => 1e3 * next() + v as f32,
    };
    let steps: Vec<Vec<f32>> = (0..90).map(|step| (0..50).map(|v| sample(step, v)).collect()).collect();
    let whole = moments_of(&steps);
    // Interrupted behind these numbers of steps.
    let cuts = [1, 40, 41, 88];
    let mut moments = moments_of(&steps[..cuts[0]]);
    for (i, &cut) in cuts.iter().enumerate() {
        let ranges: Vec<_> = moments.steps().iter().map(|s| s.range).collect();
        moments = Moments::resume(&moments.vertex_statistics(), &ranges, moments.series().nonfinite).unwrap();
        let end = cuts.get(i + 1).copied().unwrap_or(steps.len());
        steps[cut..end].iter().for_each(|step| _ = moments.add_step(step));
    }
    assert_eq!(moments.series(), whole.series());
    assert!(moments.steps().iter().zip(whole.steps()).all(|(a, b)| a.range == b.range));
    let [a, b] = [&moments, &whole].map(Moments::vertex_statistics);
    let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!((bits(&a.mean), &a.finite_count), (bits(&b.mean), &b.finite_count));
    let unit = 0.5 * f64::EPSILON;
    let bound = 2.0 * unit * (cuts.len() + steps.len() - cuts[0] + 1) as f64;
    let mut other = steps.clone();
    other[89].iter_mut().for_each(|v| *v *= 1.000_001);
    let other = moments_of(&other).vertex_statistics();
    let (mut differ, mut noticed) = (0, 0);
    for (v, (a, b)) in a.variance.iter().zip(&b.variance).enumerate().filter(|(_, (_, b))| !b.is_nan()) {
        assert!((a - b).abs() <= bound * b, "{a:e} instead of {b:e}");
        differ += usize::from(a != b);
        noticed += usize::from((a - other.variance[v]).abs() > bound * b);
    }
    assert!(a.variance[3].is_nan() && a.variance[0] == 0.0 && differ > 0, "the bound is of use");
    assert!(noticed > 40, "a value off by a millionth is noticed at {noticed} of 49 vertices");
}

#[test]
fn what_is_no_statistics_is_not_resumed() {
    let statistics = |mean: f64, variance: f64, count: f64| VertexStatistics {
        mean: vec![mean],
        variance: vec![variance],
        finite_count: vec![count],
    };
    let ranges = [None; 3];
    assert!(Moments::resume(&statistics(1.0, 0.5, 3.0), &ranges, 0).is_some());
    assert!(Moments::resume(&statistics(f64::NAN, f64::NAN, 0.0), &ranges, 0).is_some());
    for bad in [(1.0, -0.5, 3.0), (1.0, 0.5, 4.0), (1.0, 0.5, 0.5), (f64::NAN, 0.5, 1.0), (1.0, f64::INFINITY, 1.0)] {
        assert!(Moments::resume(&statistics(bad.0, bad.1, bad.2), &ranges, 0).is_none(), "{bad:?}");
    }
}

#[test]
fn a_state_goes_on_bit_for_bit_and_what_is_none_is_refused() {
    let mut next = noise(7);
    let mut step = |hole: usize| (0..50).map(|i| if i == hole { f32::NAN } else { next() }).collect::<Vec<f32>>();
    let steps: Vec<Vec<f32>> = (0..9).map(&mut step).chain([vec![f32::INFINITY; 50], vec![-0.0; 50]]).collect();
    let whole = moments_of(&steps);
    let state = moments_of(&steps[..10]).state();
    let mut resumed = Moments::from_state(&state).unwrap();
    resumed.add_step(&steps[10]);
    let bits = |state: MomentsState| {
        let MomentsState { means, squares, counts, ranges, nonfinite, nonfinite_before } = state;
        let [means, squares] = [means, squares].map(|of| of.into_iter().map(f64::to_bits).collect::<Vec<_>>());
        let ranges: Vec<_> = ranges.into_iter().map(|range| range.map(f32::to_bits)).collect();
        (means, squares, counts, ranges, nonfinite, nonfinite_before)
    };
    assert_eq!(bits(resumed.state()), bits(whole.state()));
    assert_ne!(bits(resumed.state()), bits(Moments::from_state(&state).unwrap().state()), "a step is noticed");
    let spoils: [fn(&mut MomentsState); 8] = [
        |state| state.means[3] = f64::NAN,
        |state| state.squares[3] = -1.0,
        |state| state.counts[3] = 11,
        |state| state.ranges[2] = [1.0, 0.0],
        |state| state.ranges[2] = [f32::NAN, 0.0],
        |state| state.nonfinite[2] = 51,
        |state| _ = state.squares.pop(),
        |state| state.nonfinite_before = u64::MAX,
    ];
    for spoil in spoils {
        let mut state = state.clone();
        spoil(&mut state);
        assert!(Moments::from_state(&state).is_none());
    }
}
