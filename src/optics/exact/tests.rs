//! What lies behind deep pieces, and segments at once against segments one by one.

use super::*;

/// Nodes at each tenth, some with a step, one interval transparent.
fn table() -> ExactTable {
    let mut nodes = Vec::new();
    for i in 0..1000 {
        let of = |k: f64| 0.5 + 0.5 * (k * f64::from(i)).sin();
        let tau = if (40..=41).contains(&i) { 0.0 } else { 3.0 * of(0.7) };
        nodes.push(Node { scalar: 0.1 * f64::from(i), rgb: [of(1.0), of(2.0), of(3.0)], tau });
        if i % 7 == 0 {
            nodes.push(Node { scalar: 0.1 * f64::from(i), rgb: [of(2.0), of(3.0), of(1.0)], tau: of(0.3) });
        }
    }
    ExactTable::new(&NodeTable::new(nodes).unwrap(), 1.0)
}

/// Scalars and lengths along a ray: within an interval, at nodes, over many of them, and constant.
fn along(step: f64) -> Vec<(f64, f64)> {
    let at = |i: i32| match i % 9 {
        0 => 0.1 * f64::from(i),
        1 => 0.1 * f64::from(i - 1),
        8 => 100.0 * (f64::from(i)).sin(),
        _ => 4.0 + step * f64::from(i).sin(),
    };
    (0..200).map(|i| (at(i), 1e-4 + 0.03 * (0.5 + 0.5 * (1.3 * f64::from(i)).sin()))).collect()
}

#[test]
fn nothing_behind_a_deep_piece_is_looked_at_and_the_light_is_the_same() {
    let node = |i: u32, tau: f64| Node { scalar: f64::from(i), rgb: [0.01 * f64::from(i), 0.5, 1.0], tau };
    for (tau, of_all, expected) in [(1e12, 100, 1), (20.0, 100, 1), (5.0, 100, 100), (0.01, 100, 100)] {
        let table = ExactTable::new(&NodeTable::new((0..=100).map(|i| node(i, tau)).collect()).unwrap(), 1.0);
        for (from, to) in [(0.0, 100.0), (100.0, 0.0)] {
            let (mut whole, mut in_parts) = (Accumulator::TRANSPARENT, Accumulator::TRANSPARENT);
            let mut ray = table.enter(from);
            assert_eq!(table.segment(&mut ray, from, to, 100.0, &mut whole), expected, "{tau}");
            // The ray is where it would have come to: a segment behind has the light of a ray that begins there.
            let (mut behind, mut new) = (Accumulator::TRANSPARENT, Accumulator::TRANSPARENT);
            let back = 0.3 * from + 0.7 * to;
            table.segment(&mut ray, to, back, 0.1, &mut behind);
            table.segment(&mut table.enter(to), to, back, 0.1, &mut new);
            assert_eq!(behind, new, "{tau}");
            let mut ray = table.enter(from);
            let places = (1..=100).map(|i| if to > from { f64::from(i) } else { f64::from(100 - i) });
            let pieces: u64 = places
                .scan(from, |s, to| Some((std::mem::replace(s, to), to)))
                .map(|(s, to)| table.segment(&mut ray, s, to, 1.0, &mut in_parts))
                .sum();
            assert_eq!(pieces, of_all);
            // The transmittance of a deep piece is the rounding of 1; pieces of runs differ by the bound of a run, and half a bit for each
            // sum of pieces.
            let off = whole.pixel().iter().zip(in_parts.pixel()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let bound = if expected == 1 { 2.0 } else { 15.0 + 0.5 * 100.0 };
            assert!(off <= bound / (1 << 24) as f32, "{tau}: {off:e}");
            assert!(whole.is_opaque() == (tau > 1.0));
        }
    }
}

#[test]
fn segments_at_once_are_those_one_by_one_to_the_last_bit() {
    let table = table();
    for step in [0.01, 0.3, 9.0] {
        let along = along(step);
        let (mut one, mut all) = (Accumulator::TRANSPARENT, Accumulator::TRANSPARENT);
        let (mut place, mut place_all) = (table.enter(4.0), table.enter(4.0));
        let mut s0 = 4.0;
        for (i, some) in along.chunks(17).enumerate() {
            let mut pieces = 0;
            let first = s0;
            for &(s1, length) in some {
                pieces += table.segment(&mut place, s0, s1, length, &mut one);
                s0 = s1;
            }
            let found = table.segments(&mut place_all, first, some.iter().copied(), &mut all);
            assert_eq!((one, pieces), (all, found), "step {step}, part {i}");
            assert!(pieces > ROOM as u64, "{pieces} pieces: never more than there is room for");
        }
        // And a last bit more of one length would be seen.
        let mut other = Accumulator::TRANSPARENT;
        let longer = along.iter().map(|&(s, length)| (s, length * 1.000_001));
        table.segments(&mut table.enter(4.0), 4.0, longer, &mut other);
        assert_ne!(one, other);
    }
}
