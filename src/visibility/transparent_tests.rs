use super::*;
use proptest::prelude::*;

fn table(nodes: &[(f64, f64)]) -> NodeTable {
    NodeTable::new(nodes.iter().map(|&(scalar, tau)| Node { scalar, rgb: [0.5; 3], tau }).collect()).unwrap()
}

fn intervals(nodes: &[(f64, f64)]) -> Vec<[f32; 2]> {
    TransparentIntervals::of(&table(nodes)).intervals
}

#[test]
fn intervals_end_at_nodes_and_at_the_side_of_steps() {
    const ALL: [f32; 2] = [f32::MIN, f32::MAX];
    assert_eq!(intervals(&[(0.0, 0.0)]), [ALL]);
    assert_eq!(intervals(&[(0.0, 1.0)]), [] as [[f32; 2]; 0]);
    // A tent is transparent at its feet.
    assert_eq!(intervals(&[(1.0, 0.0), (2.0, 1.0), (3.0, 0.0)]), [[f32::MIN, 1.0], [3.0, f32::MAX]]);
    // A step is visible at its scalar.
    let step = intervals(&[(1.0, 0.0), (1.0, 2.0), (3.0, 2.0), (3.0, 0.0)]);
    assert_eq!(step, [[f32::MIN, 1.0f32.next_down()], [3.0f32.next_up(), f32::MAX]]);
    // Two tents that share a foot: one transparent scalar.
    let two = intervals(&[(0.0, 1.0), (1.0, 0.0), (2.0, 1.0)]);
    assert_eq!(two, [[1.0, 1.0]]);
    // A node that is not an f32 lies between two of them.
    let tenth = intervals(&[(0.1, 0.0), (0.2, 1.0)])[0][1];
    assert!(f64::from(tenth) <= 0.1 && f64::from(tenth.next_up()) > 0.1);
    // Nodes far beyond f32, and two so close that no f32 lies between.
    assert_eq!(intervals(&[(-1e300, 1.0), (-1e299, 0.0), (1e299, 0.0), (1e300, 1.0)]), [ALL]);
    assert_eq!(intervals(&[(0.1, 1.0), (0.1 + 1e-12, 0.0), (0.1 + 2e-12, 1.0)]), [] as [[f32; 2]; 0]);
    // Subnormal scalars count.
    let tiny = f32::from_bits(1);
    assert_eq!(intervals(&[(f64::from(tiny), 0.0), (3.0 * f64::from(tiny), 1.0)])[0][1], tiny);
}

#[test]
fn a_spike_of_any_width_is_seen() {
    for width in [1e-3, 1.0 / 4096.0, 1e-5, 1e-7, 1e-9] {
        for at in [0.0, 0.123_456_7, 0.5, 1.0 - 1e-9] {
            let spike = table(&[(at - width, 0.0), (at, 5.0), (at + width, 0.0)]);
            let transparent = TransparentIntervals::of(&spike);
            // A cell across it has two labels, however narrow it is.
            let (below, above) = (transparent.label(-1.0), transparent.label(2.0));
            assert!(below != above && below != VISIBLE && above != VISIBLE, "{width} at {at}");
            assert_eq!(transparent.label_of_range(-1.0, 2.0), None);
            // A cell that just reaches into it.
            let (side, f32_at) = (at as f32, at as f32);
            assert_eq!(transparent.label_of_range(-1.0, side.max(f32_at)).is_some(), f64::from(f32_at) <= at - width);
        }
    }
}

#[test]
fn what_is_not_finite_is_a_hole() {
    for nodes in [[(0.0, 0.0), (1.0, 0.0)], [(0.0, 1.0), (1.0, 0.0)]] {
        let transparent = TransparentIntervals::of(&table(&nodes));
        for s in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!((transparent.label(s), transparent.label_of_range(s, s)), (HOLE, None));
        }
        let mut labels = [9; 3];
        transparent.label_all(&[f32::NAN, f32::INFINITY, -f32::INFINITY], &mut labels);
        assert_eq!(labels, [HOLE; 3]);
    }
}

#[test]
fn intervals_without_a_label_count_as_visible() {
    let nodes: Vec<_> = (0..2000).map(|i| (f64::from(i), if i % 4 < 2 { 0.0 } else { 1.0 })).collect();
    let transparent = TransparentIntervals::of(&table(&nodes));
    assert_eq!(transparent.intervals.len(), INTERVALS_MAX);
    assert_eq!((transparent.label(0.5), transparent.label(4.5), transparent.label(2.5)), (1, 2, VISIBLE));
    assert_eq!(transparent.label(1996.5), VISIBLE, "one of the last");
    assert!((0..2000).all(|i| transparent.label(i as f32) != HOLE));
}

/// Random tables: nodes at few scalars, so that there are steps, and many transparent nodes.
fn tables() -> impl Strategy<Value = NodeTable> {
    let tau = prop_oneof![2 => Just(0.0), 1 => 0.1..5.0f64];
    prop::collection::vec((-20..20i32, tau), 1..40).prop_map(|mut nodes| {
        nodes.sort_by_key(|node| node.0);
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for (at, tau) in nodes {
            let at = f64::from(at) * 0.05;
            if kept.len() < 2 || kept[kept.len() - 2].0 < at {
                kept.push((at, tau));
            }
        }
        table(&kept)
    })
}

/// Scalars at nodes, beside them and anywhere.
fn scalars() -> impl Strategy<Value = f32> {
    prop_oneof![
        (-21..21i32).prop_map(|i| (f64::from(i) * 0.05) as f32),
        (-21..21i32, any::<bool>()).prop_map(|(i, up)| {
            let at = (f64::from(i) * 0.05) as f32;
            if up { at.next_up() } else { at.next_down() }
        }),
        -1.2..1.2f32,
    ]
}

proptest! {
    #[test]
    fn cells_on_both_sides_of_a_value_are_in_no_interval_that_was_cut_there(
        table in tables(), values in prop::collection::vec(-1.3..1.3f64, 0..5), at_scalars in any::<bool>(),
        a in scalars(), b in scalars(), c in scalars(),
    ) {
        let values: Vec<f64> = if at_scalars { vec![f64::from(a), f64::from(c)] } else { values };
        let (transparent, cut) = (TransparentIntervals::of(&table), TransparentIntervals::of(&table).cut_at(&values));
        let (lo, hi) = (a.min(b), a.max(b));
        let is_met = values.iter().any(|&value| (f64::from(lo) >= value) != (f64::from(hi) >= value));
        let expected = transparent.label_of_range(lo, hi).is_some() && !is_met;
        prop_assert_eq!(cut.label_of_range(lo, hi).is_some(), expected);
        let mut labels = [0; 2];
        cut.label_all(&[a, b], &mut labels);
        prop_assert_eq!(labels, [a, b].map(|s| cut.label(s)));
        prop_assert_eq!(transparent.cut_at(&[]), transparent);
    }

    #[test]
    fn labels_say_what_the_table_says(table in tables(), a in scalars(), b in scalars()) {
        let transparent = TransparentIntervals::of(&table);
        let (lo, hi) = (a.min(b), a.max(b));
        let visible = table.is_visible_in(f64::from(lo), f64::from(hi));
        prop_assert_eq!(transparent.label_of_range(lo, hi).is_none(), visible);
        let mut labels = [0; 2];
        transparent.label_all(&[a, b], &mut labels);
        prop_assert_eq!(labels, [a, b].map(|s| transparent.label(s)));
        // A table with a spike in between is distinguished.
        let at = 0.5 * (f64::from(lo) + f64::from(hi));
        let mut nodes: Vec<Node> = table.nodes().iter().filter(|n| n.scalar < at - 0.01).copied().collect();
        nodes.push(Node { scalar: at, rgb: [0.0; 3], tau: 1.0 });
        let spiked = TransparentIntervals::of(&NodeTable::new(nodes).unwrap());
        prop_assert_eq!(spiked.label_of_range(lo, hi), None);
    }

    #[test]
    fn a_sampled_table_is_clear_only_where_samples_around_are(table in tables(), a in scalars(), b in scalars(), n in 2..200usize) {
        let transparent = TransparentIntervals::of_sampled(&table, n);
        let (lo, hi) = (f64::from(a.min(b)), f64::from(a.max(b)));
        let nodes = table.nodes();
        let step = (nodes[nodes.len() - 1].scalar - nodes[0].scalar) / (n - 1) as f64;
        if transparent.label_of_range(lo as f32, hi as f32).is_some() {
            prop_assert!(!table.is_visible_in(lo - step, hi + step));
        }
        if step == 0.0 {
            prop_assert_eq!(transparent, TransparentIntervals::of(&table));
        }
    }
}
