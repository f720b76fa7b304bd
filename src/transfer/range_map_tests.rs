use super::*;
use proptest::prelude::*;

/// Maps with gentle and with steep pieces.
pub(super) fn map() -> impl Strategy<Value = RangeMap> {
    let gap = || prop_oneof![0.001..1.0_f64, 1e-7..1e-6_f64];
    prop::collection::vec((gap(), gap()), 1..9).prop_map(|gaps| {
        let total = |c: fn(&(f64, f64)) -> f64| gaps.iter().map(c).sum::<f64>();
        let (width, height) = (total(|g| g.0), total(|g| g.1));
        let (mut x, mut y) = (0.0, 0.0);
        let point = |g: &(f64, f64)| {
            (x, y) = (x + g.0, y + g.1);
            [x / width, y / height]
        };
        let points: Vec<[f64; 2]> = gaps.iter().map(point).collect();
        RangeMap::new(&points[..points.len() - 1]).unwrap()
    })
}

fn is_valid(map: &RangeMap) -> bool {
    let inner = &map.points()[1..map.points().len() - 1];
    RangeMap::new(inner).is_ok_and(|again| again == *map)
}

#[test]
fn a_map_follows_equation_7_4() {
    let map = RangeMap::new(&[[0.25, 0.5], [0.5, 0.75]]).unwrap();
    assert_eq!([0.0, 0.125, 0.25, 0.375, 0.75, 1.0].map(|x| map.eval(x)), [0.0, 0.25, 0.5, 0.625, 0.875, 1.0]);
    assert_eq!([0.25, 0.5, 0.875].map(|y| map.inverse(y)), [0.125, 0.25, 0.75]);
    assert_eq!(
        [-3.0, 7.0, f64::NEG_INFINITY, f64::INFINITY].map(|x| map.eval(x)),
        [-3.0, 7.0, f64::NEG_INFINITY, f64::INFINITY]
    );
    assert!(map.eval(f64::NAN).is_nan());
}

#[test]
fn the_map_that_changes_nothing_does_so_bit_for_bit() {
    let map = RangeMap::default();
    for x in [0.0, 1e-300, 0.1, 1.0 / 3.0, 0.7, 1.0 - 1e-16, 1.0, -0.1, 1e9] {
        assert_eq!((map.eval(x).to_bits(), map.inverse(x).to_bits()), (x.to_bits(), x.to_bits()));
    }
}

#[test]
fn points_that_do_not_increase_are_errors() {
    for bad in [
        [[0.5, 0.5], [0.5, 0.6]],
        [[0.5, 0.5], [0.6, 0.5]],
        [[0.5, 0.5], [0.4, 0.6]],
        [[0.0, 0.5], [0.4, 0.6]],
        [[0.1, 0.5], [0.4, 1.0]],
        [[0.1, f64::NAN], [0.4, 0.9]],
        [[0.1, 0.2], [f64::INFINITY, 0.9]],
    ] {
        assert!(matches!(RangeMap::new(&bad), Err(TransferError::BadRangeMap { .. })), "{bad:?}");
    }
    assert!(serde_json::from_str::<RangeMap>(r#"{"points": [[0.5, 0.7], [0.4, 0.8]]}"#).is_err());
    assert!(serde_json::from_str::<RangeMap>(r#"{"points": [], "more": 1}"#).is_err());
}

#[test]
fn equalising_gives_equal_parts_of_the_axis_to_equally_many_values() {
    // 89 of 100 values in the second of ten bins.
    let counts = [1, 89, 2, 1, 1, 2, 1, 1, 1, 1];
    let map = RangeMap::equalised(&counts);
    let off = |map: &RangeMap| {
        let below = |i: usize| counts[..i].iter().sum::<u64>() as f64 / 100.0;
        (0..10).map(|i| (map.eval(i as f64 / 10.0) - below(i)).abs()).fold(0.0, f64::max)
    };
    // Even share and simplification; two values elsewhere change more.
    assert!(off(&map) <= EVEN_SHARE + EQUALISED_TOLERANCE, "{}", off(&map));
    assert!(off(&RangeMap::equalised(&[3, 87, 2, 1, 1, 2, 1, 1, 1, 1])) > EVEN_SHARE + EQUALISED_TOLERANCE);
    assert!(map.eval(0.2) - map.eval(0.1) > 0.88 && is_valid(&map));
    assert_eq!(RangeMap::equalised(&[]), RangeMap::default());
    assert_eq!(RangeMap::equalised(&[0, 0, 0]), RangeMap::default());
    assert_eq!(RangeMap::equalised(&[5; 1000]), RangeMap::default(), "what is even already needs no points");
    assert!(is_valid(&RangeMap::equalised(&[u64::MAX, u64::MAX, 0])));
    // All values in one of many bins.
    let mut crowd = vec![0; 65_536];
    crowd[40_000] = 1_000_000;
    let map = RangeMap::equalised(&crowd);
    assert!(is_valid(&map) && map.points().len() <= 5, "{map:?}");
    assert!(map.eval(40_001.0 / 65_536.0) - map.eval(40_000.0 / 65_536.0) > 0.98);
}

#[test]
fn points_are_added_dragged_and_removed() {
    let line = RangeMap::default();
    let (map, index) = line.with_point(0.25).unwrap();
    assert_eq!((index, map.points()[1]), (1, [0.25, 0.25]));
    let dragged = map.with_moved(1, [0.25, 0.75]);
    assert_eq!(dragged.eval(0.125), 0.375);
    assert_eq!(map.with_moved(1, [-5.0, 9.0]).points()[1], [RangeMap::GAP, 1.0 - RangeMap::GAP]);
    assert_eq!(map.with_moved(0, [0.5, 0.5]), map);
    assert_eq!(map.with_moved(1, [f64::NAN, 0.5]), map);
    assert_eq!(map.with_moved(9, [0.5, 0.5]), map);
    assert_eq!(
        (dragged.without_point(1), dragged.without_point(0), dragged.without_point(2)),
        (line.clone(), dragged.clone(), dragged.clone())
    );
    for x in [0.0, 1.0, 0.25, 0.25 + 1e-12, -1.0, 2.0, f64::NAN] {
        assert!(map.with_point(x).is_none(), "{x}");
    }
}

#[test]
fn points_outside_of_two_that_are_pulled_apart_follow_in_proportion() {
    let map = RangeMap::new(&[[0.2, 0.2], [0.4, 0.4], [0.5, 0.5], [0.6, 0.6], [0.8, 0.8]]).unwrap();
    let pulled = map.pulled_apart(2, 4, [0.1, 0.9]);
    let ys: Vec<f64> = pulled.points().iter().map(|p| p[1]).collect();
    let is_close = |ys: &[f64], of: [f64; 7]| ys.iter().zip(of).all(|(y, expected)| (y - expected).abs() < 1e-15);
    // But for some roundings of numbers below 1, 2^-54 each.
    assert!(is_close(&ys, [0.0, 0.05, 0.1, 0.5, 0.9, 0.95, 1.0]), "{ys:?}");
    assert!(!is_close(&ys, [0.0, 0.05, 0.1, 0.5, 0.9, 0.950_001, 1.0]));
    assert!(pulled.points().iter().zip(map.points()).all(|(a, b)| a[0] == b[0]));
    let flat = map.pulled_apart(2, 4, [-1.0, 2.0]);
    assert!(is_valid(&flat) && flat.points()[4][1] - flat.points()[2][1] > 0.999);
    for (i, j) in [(4, 2), (2, 2), (2, 99)] {
        assert_eq!(map.pulled_apart(i, j, [0.1, 0.9]), map);
    }
    assert_eq!(map.pulled_apart(0, 6, [0.3, 0.6]), map, "the ends stay");
}

proptest! {
    #[test]
    fn a_map_rises_between_fixed_ends_and_has_an_inverse(map in map(), mut at in prop::collection::vec(0.0..=1.0_f64, 30)) {
        at.extend(map.points().iter().flat_map(|p| [p[0].next_down(), p[0], p[0].next_up()]));
        at.sort_by(f64::total_cmp);
        let ys: Vec<f64> = at.iter().map(|&x| map.eval(x)).collect();
        prop_assert!(ys.is_sorted());
        prop_assert_eq!([map.eval(0.0), map.eval(1.0), map.inverse(0.0), map.inverse(1.0)], [0.0, 1.0, 0.0, 1.0]);
        for (x, y) in at.iter().zip(&ys).filter(|(x, _)| (0.0..=1.0).contains(*x)) {
            let i = map.points().partition_point(|p| p[0] <= *x).clamp(1, map.points().len() - 1);
            let (a, b) = (map.points()[i - 1], map.points()[i]);
            prop_assert!((a[1]..=b[1]).contains(y), "out of its segment");
            // y is rounded by a unit of 2^-53 or two, which the inverse of a flat piece magnifies.
            let bound = 8.0 * f64::EPSILON * (1.0 + (b[0] - a[0]) / (b[1] - a[1]));
            prop_assert!((map.inverse(*y) - x).abs() <= bound);
        }
        prop_assert!((map.inverse(0.9) - map.inverse(0.1)).abs() > 1e-9, "an inverse that is constant would do for one place");
    }

    #[test]
    fn equalising_stays_within_its_bound(counts in prop::collection::vec(prop_oneof![Just(0_u64), 0..100_u64, Just(1_000_000)], 1..300)) {
        let map = RangeMap::equalised(&counts);
        prop_assert!(is_valid(&map));
        let total = counts.iter().sum::<u64>() as f64;
        let mut below = 0.0;
        for (i, n) in counts.iter().enumerate() {
            below += *n as f64;
            let x = (i + 1) as f64 / counts.len() as f64;
            let exact = if total > 0.0 { lerp(below / total, x, EVEN_SHARE) } else { x };
            // Points nearer than a gap are left out, too. That other counts are noticed shows the test of ten bins above.
            prop_assert!((map.eval(x) - exact).abs() <= EQUALISED_TOLERANCE + 1e-9, "{x}");
        }
        let slopes = map.points().windows(2).map(|p| (p[1][1] - p[0][1]) / (p[1][0] - p[0][0]));
        // The even share, less the tolerance at both ends of a piece, gives no bound; slopes are positive.
        prop_assert!(slopes.into_iter().all(|s| s > 0.0));
    }

    #[test]
    fn editing_keeps_a_map_valid(map in map(), i in 0_usize..10, j in 0_usize..10, to in [-0.5..1.5_f64, -0.5..1.5_f64], x in -0.5..1.5_f64) {
        for edited in [map.with_moved(i, to), map.without_point(i), map.pulled_apart(i, j, to)] {
            prop_assert!(is_valid(&edited), "{edited:?}");
        }
        if let Some((more, index)) = map.with_point(x) {
            prop_assert!(is_valid(&more) && more.points()[index][0] == x);
            for p in map.points() {
                prop_assert_eq!(more.eval(p[0]), p[1]);
            }
            prop_assert_eq!(more.without_point(index), map);
        }
    }

    #[test]
    fn a_mix_lies_between_its_maps_everywhere(a in map(), b in map(), f in 0.0..=1.0_f64, at in prop::collection::vec(0.0..=1.0_f64, 20)) {
        let mixed = RangeMap::mix(&a, &b, f);
        prop_assert!(is_valid(&mixed));
        prop_assert_eq!(RangeMap::mix(&a, &a, f), a.clone());
        prop_assert_eq!((RangeMap::mix(&a, &b, 0.0), RangeMap::mix(&a, &b, 1.0)), (a.clone(), b.clone()));
        for x in at {
            let expected = (1.0 - f) * a.eval(x) + f * b.eval(x);
            // Slopes are below 1e8: positions of doubles near each other.
            prop_assert!((mixed.eval(x) - expected).abs() <= 1e-8, "{}", x);
        }
        if (a.eval(0.5) - b.eval(0.5)).abs() > 0.1 {
            prop_assert!((RangeMap::mix(&a, &b, (f + 0.5) % 1.0).eval(0.5) - mixed.eval(0.5)).abs() > 1e-3);
        }
    }

    #[test]
    fn data_comes_back_as_it_went_in(map in map()) {
        let text = serde_json::to_string(&map).unwrap();
        prop_assert_eq!(serde_json::from_str::<RangeMap>(&text).unwrap(), map);
    }
}
