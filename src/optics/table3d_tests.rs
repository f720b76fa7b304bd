//! The pre-integrated table against closed forms and the exact integrator.

use super::*;

const SMALL: Table3dResolution = Table3dResolution { scalars: 33, lengths: 9 };

fn nodes(of: &[(f64, [f64; 3], f64)]) -> NodeTable {
    NodeTable::new(of.iter().map(|&(scalar, rgb, tau)| Node { scalar, rgb, tau }).collect()).unwrap()
}

fn build(table: &NodeTable, length_max: f64) -> Table3d {
    Table3d::new(table, Table3d::range_of(table), length_max, 1.0, SMALL)
}

/// The pixel of one segment.
fn pixel<I: Integrator>(table: &I, s0: f64, s1: f64, length: f64) -> [f32; 4] {
    let mut light = Accumulator::TRANSPARENT;
    table.segment(&mut table.enter(s0), s0, s1, length, &mut light);
    light.pixel()
}

/// The largest difference of two pixels.
fn difference(a: [f32; 4], b: [f32; 4]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(x, y)| f64::from((x - y).abs()))
        .fold(0.0, |m, d| if d.is_nan() { f64::NAN } else { m.max(d) })
}

fn uneven() -> NodeTable {
    nodes(&[
        (-1.0, [0.1, 0.2, 0.9], 0.3),
        (-0.25, [0.9, 0.1, 0.5], 0.0),
        (0.3, [0.2, 0.7, 0.1], 5.0),
        (0.3, [1.0, 0.4, 0.0], 1.0),
        (1.0, [0.0, 0.0, 1.0], 2.5),
    ])
}

#[test]
fn constant_extinction_and_color_are_exact_at_any_length() {
    let agrees = |pixel: [f32; 4], depth: f64| {
        let mut channels = pixel.into_iter().zip([1.0, 0.5, 0.25, 1.0].map(|share| share * -(-depth).exp_m1()));
        // Each factor of the pixel is rounded to f32 (6e-8), the exponent relative to its size: x e^-x < 0.4.
        channels.all(|(found, exact)| (f64::from(found) / exact - 1.0).abs() < 1e-6)
    };
    for tau in [0.02, 1.0, 30.0, 1e6] {
        let table = build(&nodes(&[(2.0, [1.0, 0.5, 0.25], tau), (3.0, [1.0, 0.5, 0.25], tau)]), 0.7);
        // Inside the range, across its ends and outside; up to ten times the longest length.
        for (s0, s1) in [(2.1, 2.9), (2.5, 2.5), (2.0, 3.0), (1.0, 4.0), (3.5, 2.2), (5.0, 6.0), (0.0, 0.0)] {
            for length in [1e-20, 1e-6, 0.013, 0.3, 0.7, 2.0, 7.0] {
                let found = pixel(&table, s0, s1, length);
                assert!(agrees(found, tau * length), "tau {tau}, {s0} to {s1}, length {length}: {found:?}");
            }
        }
        assert!(!agrees(pixel(&table, 2.1, 2.9, 0.1 / tau), 0.1 * 1.000_01), "a depth off by 1e-5");
    }
}

#[test]
fn entries_are_what_the_exact_integrator_gives() {
    let table = uneven();
    let (exact, looked_up) = (ExactTable::new(&table, 1.0), build(&table, 2.0));
    let worst = |other: &ExactTable| {
        let mut worst: f64 = 0.0;
        for i in 0..SMALL.scalars {
            for j in 0..SMALL.scalars {
                let scalar = |i: usize| -1.0 + 2.0 * i as f64 / 32.0;
                for k in 1..SMALL.lengths {
                    let length = 2.0 * (k as f64 / 8.0).powi(2);
                    let (s0, s1) = (scalar(i), scalar(j));
                    worst = worst.max(difference(pixel(&looked_up, s0, s1, length), pixel(other, s0, s1, length)));
                }
            }
        }
        worst
    };
    // Twice the bound of the exact integrator's weights, 4e-7 a piece, over up to five pieces.
    assert!(worst(&exact) < 4e-6, "{:e}", worst(&exact));
    // An extinction that is off by 1e-2 is noticed.
    let mut moved = table.nodes().to_vec();
    moved[4].tau += 1e-2;
    assert!(worst(&ExactTable::new(&NodeTable::new(moved).unwrap(), 1.0)) > 1e-4);
}

#[test]
fn a_linear_ramp_has_the_exact_opacity_between_entries_too() {
    // The mean of a linear function is linear in both ends, so interpolation is exact, and so is opacity.
    let table = build(&nodes(&[(0.0, [0.0, 0.5, 1.0], 0.5), (1.0, [1.0, 0.5, 0.0], 4.0)]), 1.0);
    let exact = ExactTable::new(&nodes(&[(0.0, [0.0, 0.5, 1.0], 0.5), (1.0, [1.0, 0.5, 0.0], 4.0)]), 1.0);
    let moved = ExactTable::new(&nodes(&[(0.0, [0.0, 0.5, 1.0], 0.5), (1.0, [0.98, 0.5, 0.0], 4.001)]), 1.0);
    let mut noticed = [0; 2];
    for (s0, s1) in [(0.013, 0.977), (0.5, 0.503), (0.9, 0.02), (-0.5, 0.7), (0.3, 1.4)] {
        for length in [1e-9, 0.01, 0.1, 0.77, 2.3] {
            let (a, b) = (pixel(&table, s0, s1, length), pixel(&exact, s0, s1, length));
            // The interval's place is known to 2^-24 of the axis; opacity changes by less than 4 over it.
            assert!((a[3] - b[3]).abs() < 2e-6, "{s0} {s1} {length}: {a:?} {b:?}");
            // Extinction times colour is quadratic: over an interval of 1/32 interpolation is off by 3.5 / 32^2 / 4 at
            // most, and that of lengths by less than as much again.
            let bound = 2e-3 * f64::from(b[3].max(1e-9)) + 2e-6;
            assert!(difference(a, b) < bound, "{s0} {s1} {length}: {a:?} {b:?}");
            let other = pixel(&moved, s0, s1, length);
            noticed[0] += usize::from((a[3] - other[3]).abs() > 2e-6);
            noticed[1] += usize::from(difference(a, other) > bound);
        }
    }
    assert!(noticed.iter().all(|n| *n > 5), "another extinction and another color are noticed {noticed:?} of 25 times");
}

#[test]
fn short_segments_keep_relative_accuracy() {
    let table = uneven();
    let (table, exact) = (build(&table, 2.0), ExactTable::new(&table, 1.0));
    let mut noticed = 0;
    // On entries of the scalar axes, so that only the length is interpolated.
    for (s0, s1) in [(-1.0, -0.5), (0.5, -0.75), (1.0, 0.75)] {
        for length in [1e-3, 1e-6, 1e-12, 1e-30] {
            let (a, b) = (pixel(&table, s0, s1, length), pixel(&exact, s0, s1, length));
            // Some roundings of f32 (6e-8), and how far the mean colour bends on its way to the next entry, 1/32 long. Measured: 1.2e-7,
            // and 7.0e-7 at the longest.
            let bound = 2e-6;
            let agrees = |b: [f32; 4]| a.iter().zip(b).all(|(x, y)| (f64::from(*x) / f64::from(y) - 1.0).abs() < bound);
            assert!(agrees(b), "{s0} {s1} {length}: {a:?} {b:?}");
            noticed += usize::from(!agrees(pixel(&exact, s0, s1, length * 1.000_1)));
        }
    }
    assert_eq!(noticed, 12, "lengths that are off by 1e-4 are noticed");
}

#[test]
fn without_extinction_there_is_nothing_to_be_seen() {
    let table = build(&nodes(&[(0.0, [1.0; 3], 0.0), (1.0, [0.5; 3], 0.0)]), 1.0);
    assert!(table.exact().is_transparent());
    let mut light = Accumulator::TRANSPARENT;
    for (s0, s1) in [(0.2, 0.8), (-3.0, 5.0), (0.0, 0.0), (1.0, 1.0)] {
        assert_eq!(table.segment(&mut (), s0, s1, 0.5, &mut light), 0);
        assert_eq!(table.exact().transparent_share(s0, s1), 1.0);
    }
    assert_eq!(light, Accumulator::TRANSPARENT);
}

#[test]
fn a_table_with_one_scalar_is_exact() {
    let one = nodes(&[(0.5, [0.2, 0.4, 0.6], 2.0)]);
    let step = nodes(&[(0.5, [1.0, 0.0, 0.0], 0.0), (0.5, [0.2, 0.4, 0.6], 2.0)]);
    for table in [one, step] {
        let (table, exact) = (build(&table, 1.0), ExactTable::new(&table, 1.0));
        for (s0, s1) in [(0.0, 1.0), (1.0, 0.0), (0.5, 0.5), (0.5, 0.9), (0.1, 0.5), (0.1, 0.2), (0.5, 0.1)] {
            for length in [1e-5, 0.4, 3.0] {
                let (a, b) = (pixel(&table, s0, s1, length), pixel(&exact, s0, s1, length));
                // Two constant pieces at most, each with some roundings of f32 (6e-8).
                assert!(difference(a, b) < 1e-6, "{s0} {s1} {length}: {a:?} {b:?}");
            }
        }
        let [a, b] = [pixel(&table, 0.5, 0.9, 0.4), pixel(&exact, 0.5, 0.9, 0.400_01)];
        assert!(difference(a, b) > 2e-6, "a length off by 1e-5: {a:?} {b:?}");
    }
}

#[test]
fn what_leaves_the_range_is_cut_there() {
    let table = uneven();
    let (table, exact) = (build(&table, 1.0), ExactTable::new(&table, 1.0));
    let mut noticed = 0;
    // Ends of the inner parts lie on entries, so that only lengths are interpolated.
    for (s0, s1) in [(-2.0, 2.0), (2.0, -2.0), (-1.5, 0.5), (0.5, 1.75), (1.25, 0.0), (-3.0, -1.0), (1.0, 1.5)] {
        let (a, b) = (pixel(&table, s0, s1, 0.01), pixel(&exact, s0, s1, 0.01));
        // Opacity is 0.05 at most, and rounded some times by 2^-24 of it; colour bends on its way to the next entry, 1/64 long, as for
        // short segments. Measured: 1.9e-9 and 3.5e-8.
        assert!(difference(a, b) < 2e-7 && (a[3] - b[3]).abs() < 2e-8, "{s0} {s1}: {a:?} {b:?}");
        let other = pixel(&exact, s0, s1, 0.010_01);
        noticed += usize::from(difference(a, other) > 2e-7 && (a[3] - other[3]).abs() > 2e-8);
    }
    assert_eq!(noticed, 7, "lengths that are off by a thousandth are noticed");
}

#[test]
fn offsets_and_scales_of_the_range_do_not_matter() {
    let plain = build(&uneven(), 1.0);
    let mut noticed = 0;
    for (offset, scale) in [(1e7, 1.0), (1e7, 64.0), (0.0, 1e-42), (0.0, 3e38), (-3e5, 1e-3)] {
        let map = |s: f64| offset + scale * s;
        let moved = uneven().nodes().iter().map(|n| Node { scalar: map(n.scalar), ..*n }).collect();
        let moved = build(&NodeTable::new(moved).unwrap(), 1.0);
        for (s0, s1) in [(-0.9, 0.8), (0.11, 0.12), (0.7, -0.99), (-1.4, 0.2)] {
            let (a, b) = (pixel(&plain, s0, s1, 0.3), pixel(&moved, map(s0), map(s1), 0.3));
            // f64 tells 6e-11 apart at 3e5: 6e-8 of a scale of 1e-3, and 2e-9 at 1e7. A place on the axis is an f32: 32 * 2^-24
            // intervals. Over an interval opacity changes by less than 5 * 0.3. Measured: 6e-8, at the scale of 1e-3.
            assert!(difference(a, b) < 2e-6, "offset {offset}, scale {scale}: {a:?} {b:?}");
            let other = pixel(&moved, map(s0 + 0.01), map(s1), 0.3);
            noticed += usize::from(difference(a, other) > 2e-6);
        }
    }
    assert!(noticed > 15, "{noticed} of 20 ends that are off by 0.01 are noticed");
}

/// A number in [0, 1) from a seed and an index.
fn random(seed: u64, index: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(index.wrapping_mul(0xD1B5_4A32_D192_ED03));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[test]
fn no_table_and_no_segment_gives_anything_but_a_pixel() {
    let resolution = Table3dResolution { scalars: 9, lengths: 5 };
    for seed in 0..60 {
        let scale = [1.0, 1e-44, 3e38, 1e7, 1e-3][seed as usize % 5];
        let mut scalars: Vec<f64> = (0..2 + seed % 7).map(|i| scale * (2.0 * random(seed, i) - 1.0)).collect();
        scalars.sort_by(f64::total_cmp);
        let taus = [0.0, 1e-300, 1e-40, 1e-3, 1.0, 1e6, 1e30, f64::MAX];
        let node = |(i, &scalar): (usize, &f64)| {
            let at = |k: u64| random(seed, 100 + 10 * i as u64 + k);
            Node { scalar, rgb: [at(0), at(1), at(2)], tau: taus[(at(3) * 8.0) as usize] }
        };
        let table = NodeTable::new(scalars.iter().enumerate().map(node).collect()).unwrap();
        let table = Table3d::new(&table, Table3d::range_of(&table), 0.5, 1.0, resolution);
        assert!(table.entries().iter().all(|e| e.is_finite()), "seed {seed}");
        for i in 0..200 {
            let scalar = |k| f64::from((scale * (3.0 * random(seed, 1000 + 3 * i + k) - 1.5)) as f32);
            let s0 = if scalar(0).is_finite() { scalar(0) } else { 0.0 };
            let s1 = if i % 5 == 0 || !scalar(1).is_finite() { s0 } else { scalar(1) };
            let length = 10.0f64.powf(-40.0 * random(seed, 1002 + 3 * i));
            let p = pixel(&table, s0, s1, length);
            // Rounding may lift a channel above 1, or above opacity, by a few 2^-24 of it (measured: never); 1e-37 is where colour
            // fades.
            assert!(p.iter().all(|v| (0.0..=1.000_001).contains(v)), "seed {seed}, segment {i}: {p:?}");
            assert!(p[0].max(p[1]).max(p[2]) <= p[3] * 1.000_001 + 1e-37, "seed {seed}, segment {i}: {p:?}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build(&uneven(), 1.0).entries)
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn visibility_is_that_of_the_transfer_function() {
    // A tent between two entries: the table leaks to both sides, [`ExactTable::transparent_share`] does not.
    let tent = nodes(&[
        (-1.0, [1.0; 3], 0.0),
        (0.1, [1.0; 3], 0.0),
        (0.11, [1.0; 3], 9.0),
        (0.12, [1.0; 3], 0.0),
        (1.0, [1.0; 3], 0.0),
    ]);
    let (table, exact) = (build(&tent, 1.0), ExactTable::new(&tent, 1.0));
    assert!(pixel(&table, 0.09, 0.098, 0.1)[3] > 0.0 && pixel(&exact, 0.09, 0.098, 0.1)[3] == 0.0);
    for (s0, s1) in [(0.09, 0.098), (0.0, 0.2), (0.5, 0.0), (0.115, 0.3)] {
        assert_eq!(table.exact().transparent_share(s0, s1), exact.transparent_share(s0, s1));
    }
}

#[test]
fn parameters_are_finite_and_place_the_ends_on_the_axis() {
    for (lo, hi) in [(-1.0, 3.0), (1e7, 1e7 + 1.0), (-3e38, 3e38), (1e-42, 3e-41), (0.0, 0.0), (5.0, 5.0), (0.0, 1.0)] {
        let table = nodes(&[(lo, [1.0; 3], 1.0), (hi, [0.5; 3], 2.0)]);
        let map = ScalarMap::of_table(&table, if hi.abs() < 1e-30 { 2f64.powi(100) } else { 1.0 });
        let p = build(&table, 1.5).params(map);
        let numbers = [p.scalar_lo, p.scalar_lo_rest, p.scalar_hi, p.scalar_hi_rest];
        assert!(numbers.iter().all(|v| v.is_finite()), "{lo} {hi}: {p:?}");
        // The shader's arithmetic for the upper end.
        let at = ((map.apply(hi) as f32 - p.scalar_lo) - p.scalar_lo_rest) * p.intervals_per_scalar;
        let expected = if hi > lo { 32.0 } else { 0.0 };
        // Both ends are sums of two f32: what is left is some roundings of 32 (2e-6). Measured: none.
        assert!((at - expected).abs() <= 1e-5, "{lo} {hi}: {at}");
        assert!(hi == lo || (1.000_01 * at - expected).abs() > 1e-5, "intervals off by 1e-5 are noticed");
    }
}

/// A table of smooth waves with 40 nodes, and the same with one node of it changed.
fn edited(at: usize) -> [NodeTable; 2] {
    let wave = |i: usize, k: f64| 0.5 + 0.5 * (k * i as f64).sin();
    let smooth: Vec<_> =
        (0..40).map(|i| (i as f64 / 39.0, [wave(i, 0.3), wave(i, 0.5), wave(i, 0.7)], 3.0 * wave(i, 0.9))).collect();
    let mut other = smooth.clone();
    other[at].2 += 1.0;
    other[at].1[0] *= 0.5;
    [nodes(&smooth), nodes(&other)]
}

fn build_from(last: Option<&Table3d>, table: &NodeTable, length_max: f64) -> Table3d {
    Table3d::changed(last, table, Table3d::range_of(table), length_max, 1.0, SMALL, &Cancel::new())
}

#[test]
fn a_table_is_rebuilt_where_the_transfer_function_has_changed_and_is_the_same_to_the_last_bit() {
    let all = SMALL.scalars * SMALL.scalars * SMALL.lengths;
    for at in [0, 1, 7, 20, 33, 38, 39] {
        let [before, after] = edited(at);
        let (old, new) = (build(&before, 1.0), build(&after, 1.0));
        let changed = build_from(Some(&old), &after, 1.0);
        assert_eq!((old.entries_built(), new.entries_built()), (all, all));
        assert_eq!(changed.entries(), new.entries(), "node {at}");
        assert_eq!((changed.below, changed.above), (new.below, new.above));
        assert_ne!(changed.entries(), old.entries());
        // Entries of segments that lie on one side of both neighbours of the node are kept.
        let (lo, hi) = (at.saturating_sub(1) as f64 / 39.0, (at + 1) as f64 / 39.0);
        let scalar = |i: usize| i as f64 / 32.0;
        let meets = |i: &usize, j: usize| scalar(*i).min(scalar(j)) <= hi && scalar(*i).max(scalar(j)) >= lo;
        let met: usize = (0..33).map(|j| (0..33).filter(|i| meets(i, j)).count()).sum();
        let expected = if at == 0 { 0.0..=1.0 } else { 0.0..=(met * SMALL.lengths) as f64 / all as f64 };
        assert!(expected.contains(&(changed.entries_built() as f64 / all as f64)), "node {at}");
        if (7..=33).contains(&at) {
            assert_eq!(changed.entries_built(), met * SMALL.lengths, "node {at}");
            assert!(changed.entries_built() < all * 3 / 4);
        }
    }
}

#[test]
fn what_a_change_is_may_be_an_added_a_removed_or_a_doubled_node() {
    let [base, _] = edited(0);
    let with = |edit: &dyn Fn(&mut Vec<Node>)| {
        let mut nodes = base.nodes().to_vec();
        edit(&mut nodes);
        NodeTable::new(nodes).unwrap()
    };
    let old = build(&base, 1.0);
    for (name, other) in [
        ("removed", with(&|nodes| _ = nodes.remove(12))),
        ("added", with(&|nodes| nodes.insert(13, Node { scalar: 12.4 / 39.0, tau: 9.0, ..nodes[12] }))),
        ("a step", with(&|nodes| nodes.insert(12, Node { tau: 9.0, ..nodes[12] }))),
        ("doubled", with(&|nodes| nodes.insert(12, nodes[12]))),
        ("moved", with(&|nodes| nodes[12].scalar += 0.01)),
        ("first", with(&|nodes| nodes[0].tau = 7.0)),
        ("two", with(&|nodes| (nodes[5].tau, nodes[30].tau) = (7.0, 8.0))),
    ] {
        let (new, changed) = (build(&other, 1.0), build_from(Some(&old), &other, 1.0));
        assert_eq!(changed.entries(), new.entries(), "{name}");
        assert!(changed.entries_built() < new.entries_built(), "{name}");
    }
    // An unchanged table computes no entries; one with other axes computes all.
    assert_eq!(build_from(Some(&old), &base.clone(), 1.0).entries_built(), 0);
    let longer = build_from(Some(&old), &base, 1.5);
    assert_eq!((longer.entries_built(), longer.entries()), (old.entries_built(), build(&base, 1.5).entries()));
    let wider = with(&|nodes| nodes[39].scalar = 1.1);
    let rebuilt = build_from(Some(&old), &wider, 1.0);
    assert_eq!((rebuilt.entries_built(), rebuilt.entries()), (old.entries_built(), build(&wider, 1.0).entries()));
}

#[test]
fn a_table_that_is_cancelled_is_not_finished() {
    let [before, after] = edited(20);
    let cancel = Cancel::new();
    cancel.cancel();
    let old = build(&before, 1.0);
    let range = Table3d::range_of(&after);
    let stopped = Table3d::changed(Some(&old), &after, range, 1.0, 1.0, SMALL, &cancel);
    assert_eq!(stopped.entries_built(), 0);
}
